//! The checked profile: units, references, places, and what is free of a joint.

use calib_profile::{OriginFreeSet, Profile, check, parse};
use calib_urdf::RobotModel;

const URDF: &str = r#"<robot name="arm">
  <link name="base"/> <link name="slide"/> <link name="upper"/> <link name="tip"/>
  <joint name="rail" type="prismatic"><parent link="base"/><child link="slide"/><axis xyz="1 0 0"/>
    <limit lower="0" upper="0.5" effort="1" velocity="1"/></joint>
  <joint name="pan" type="revolute"><parent link="slide"/><child link="upper"/><axis xyz="0 0 1"/>
    <limit lower="-2" upper="2" effort="1" velocity="1"/></joint>
  <joint name="tilt" type="revolute"><parent link="upper"/><child link="tip"/><axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" effort="1" velocity="1"/></joint>
</robot>"#;

const PROFILE: &str = "calib: 1
robot: {name: arm, urdf: arm.urdf}
tracker: {frame: world, marker_sigma_mm: 0.3}
bodies:
  hand: {link: tip, markers: [a, b, c]}
recordings:
  sweep: {file: sweep.csv, use: sweep, joints: {pan_deg: [-90, 90], tilt_deg: [-30, 60]}, hold: {rail_mm: 250}}
origins:
  wrist: {joint: tilt, body: hand, sweep: sweep, axes: {z: pan, y: tilt}}
";

fn robot() -> RobotModel {
    RobotModel::from_urdf_text(URDF, "arm.urdf").expect("a robot")
}

fn checked(text: &str) -> Result<Profile, String> {
    let raw = parse(text, "arm.yaml").map_err(|e| e.to_string())?;
    check(&raw, text, "arm.yaml", &robot()).map_err(|e| e.to_string())
}

#[test]
fn units_become_si() {
    let profile = checked(PROFILE).expect("a good profile");
    let robot = robot();
    let sweep = &profile.recordings["sweep"];
    let (low, high) = sweep.ranges[&robot.joint_id("tilt").expect("known")];
    assert!((low + 30f64.to_radians()).abs() < 1e-15 && (high - 60f64.to_radians()).abs() < 1e-15);
    assert_eq!(sweep.hold[&robot.joint_id("rail").expect("known")], 0.25);
    assert!((profile.tracker.marker_sigma.expect("stated") - 3e-4).abs() < 1e-18);
}

#[test]
fn axes_are_sorted_from_the_root_whatever_their_letters() {
    let profile = checked(PROFILE).expect("a good profile");
    let robot = robot();
    let names: Vec<&str> = profile.origins["wrist"]
        .axes
        .iter()
        .map(|a| robot.joint(a.joint).name.as_str())
        .collect();
    assert_eq!(names, ["pan", "tilt"]);
}

/// What is wrong, the place that the message names, and a word that it must say.
const WRONG: &[(&str, &str, &str, &str)] = &[
    (
        "calib: 1",
        "plan: {joints: {pan_deg: [-200, 90]}}\ncalib: 1",
        "arm.yaml:1:",
        "limits",
    ),
    (
        "calib: 1",
        "plan: {cameras: {c: {at_mm: [0, 0, 0], toward_mm: [0, 0, 0], field_deg: 50}}, min_cameras: 1}\ncalib: 1",
        "arm.yaml:1:",
        "looks at itself",
    ),
    (
        "calib: 1",
        "plan: {cameras: {c: {at_mm: [0, 0, 0], toward_mm: [1, 0, 0], field_deg: 50}}}\ncalib: 1",
        "arm.yaml:1:",
        "2 cameras are asked for, 1 are declared",
    ),
    (
        "calib: 1",
        "plan: {facing: {hend: {normal: [0, 0, 1], within_deg: 60}}}\ncalib: 1",
        "arm.yaml:1:",
        "did you mean `hand`?",
    ),
    (
        "calib: 1",
        "plan: {task_box_mm: [[0, 0, 0], [100, 0, 100]]}\ncalib: 1",
        "arm.yaml:1:",
        "differ in all three",
    ),
    (
        "calib: 1",
        "plan: {hold: {pan_deg: 3}, joints: {pan_deg: [0, 9]}}\ncalib: 1",
        "arm.yaml:1:",
        "both move and be held",
    ),
    ("calib: 1", "calib: 2", "arm.yaml:1:8", "version 2"),
    (
        "frame: world",
        "frame: base",
        "arm.yaml:3:",
        "the name of a link of the URDF",
    ),
    (
        "frame: world",
        "frame: hand",
        "arm.yaml:3:",
        "the name of a body",
    ),
    (
        "link: tip",
        "link: tup",
        "arm.yaml:5:16",
        "did you mean `tip`?",
    ),
    (
        "pan_deg: [-90",
        "pan_degg: [-90",
        "arm.yaml:7:",
        "does not say its unit",
    ),
    ("rail_mm: 250", "rail_deg: 250", "arm.yaml:7:", "wrong unit"),
    ("rail_mm: 250", "rail_mm: 900", "arm.yaml:7:", "limits"),
    (
        "rail_mm: 250",
        "pan_deg: 10",
        "arm.yaml:7:",
        "both move and be held",
    ),
    (
        "body: hand",
        "body: hend",
        "arm.yaml:9:",
        "did you mean `hand`?",
    ),
    (
        "sweep: sweep,",
        "sweep: sweap,",
        "arm.yaml:9:",
        "did you mean `sweep`?",
    ),
    (
        "axes: {z: pan, y: tilt}",
        "axes: {x: pan, y: tilt}",
        "arm.yaml:9:",
        "turns about",
    ),
    (
        "axes: {z: pan, y: tilt}",
        "axes: {y: tilt}",
        "arm.yaml:9:",
        "only a line",
    ),
    (
        "axes: {z: pan, y: tilt}",
        "axes: {q: pan, y: tilt}",
        "arm.yaml:9:",
        "`q` is not an axis",
    ),
    (
        "markers: [a, b, c]",
        "markers: [a, b]",
        "arm.yaml:9:",
        "points, not a frame",
    ),
    (
        "markers: [a, b, c]",
        "markers: [a, b, c], pose: true",
        "arm.yaml:5:",
        "contradict",
    ),
    (
        "marker_sigma_mm: 0.3",
        "marker_sigma_mm: -0.3",
        "arm.yaml:3:",
        "not a standard deviation",
    ),
    ("use: sweep", "use: validation", "arm.yaml:9:", "held out"),
    (
        "urdf: arm.urdf}",
        "urdf: arm.urdf, gravity: [0, 0, 0]}",
        "arm.yaml:2:",
        "no direction",
    ),
    (
        "urdf: arm.urdf}",
        "urdf: arm.urdf, payload: {tup: {mass_kg: 2}}}",
        "arm.yaml:2:",
        "did you mean `tip`?",
    ),
    (
        "urdf: arm.urdf}",
        "urdf: arm.urdf, total_mass_kg: -4}",
        "arm.yaml:2:",
        "-4 is not a mass",
    ),
    (
        "urdf: arm.urdf}",
        "urdf: arm.urdf, stiffness_nm_per_rad: {rail: 9000}}",
        "arm.yaml:2:",
        "does not turn",
    ),
    (
        "urdf: arm.urdf}",
        "urdf: arm.urdf}\nsolve: {free: [bodies, tracker, masses]}",
        "arm.yaml:3:",
        "no joint yields",
    ),
    (
        "frame: world",
        "frme: world",
        "arm.yaml:3:",
        "did you mean `frame`?",
    ),
];

#[test]
fn every_mistake_is_named_with_its_place() {
    for (right, wrong, place, word) in WRONG {
        assert!(PROFILE.contains(right), "the profile has no `{right}`");
        let text = PROFILE.replacen(right, wrong, 1);
        let message = checked(&text).expect_err(wrong);
        assert!(
            message.contains(place),
            "`{wrong}`: no {place} in\n{message}"
        );
        assert!(
            message.contains(word),
            "`{wrong}`: no `{word}` in\n{message}"
        );
        assert!(
            message.contains("help: "),
            "`{wrong}`: no remedy in\n{message}"
        );
    }
}

#[test]
fn all_mistakes_are_named_at_once() {
    let text = PROFILE
        .replace("link: tip", "link: tup")
        .replace("body: hand", "body: hend");
    let message = checked(&text).expect_err("two mistakes");
    assert!(
        message.contains("`tup`") && message.contains("`hend`"),
        "{message}"
    );
}

#[test]
fn what_nobody_states_is_estimated() {
    let asked = |solve: &str| checked(&format!("{PROFILE}solve: {{{solve}}}\n"));
    for (solve, missing) in [
        (
            "free: [joint_offsets]",
            &["`tracker` is not free", "`bodies` is not free"][..],
        ),
        ("free: [bodies, joint_offsets]", &["`tracker` is not free"]),
        ("free: [tracker, joint_offsets]", &["the mount of `"]),
    ] {
        let said = asked(solve).expect_err(solve);
        assert!(missing.iter().all(|part| said.contains(part)), "{said}");
        assert_eq!(said.matches("solve.free`").count(), missing.len(), "{said}");
    }
    for solve in [
        "free: [bodies, tracker, joint_offsets]",
        // The nominal robot is looked at, and closed forms do not ask.
        "free: []",
        "method: paper, free: [joint_offsets]",
    ] {
        let said = asked(solve).err().unwrap_or_default();
        assert!(!said.contains("is not free"), "{said}");
    }
}

#[test]
fn joints_that_do_not_move_are_held_unless_the_profile_says_otherwise() {
    let text = format!("{PROFILE}solve: {{joints: {{rail: {{free: [offset], sigma_mm: 3}}}}}}\n");
    let profile = checked(&text).expect("a good profile");
    let robot = robot();
    let (pan, rail) = (
        robot.joint_id("pan").expect("known"),
        robot.joint_id("rail").expect("known"),
    );
    let moved = profile.solve.free_set(pan, true, false);
    assert!(has_offset(&moved) && moved.origin == OriginFreeSet::Axis);
    let still = profile.solve.free_set(pan, false, false);
    assert!(!has_offset(&still) && still.origin == OriginFreeSet::Held);
    let named = profile.solve.free_set(rail, false, true);
    assert!(named.origin == OriginFreeSet::Held);
    assert!(named.effects.len() == 1 && named.effects[0].sigma == Some(3e-3));
    assert!(!has_offset(&named.held()));
}

fn has_offset(free: &calib_profile::JointFreeSet) -> bool {
    free.effects.iter().any(|e| e.effect.id == "offset")
}
