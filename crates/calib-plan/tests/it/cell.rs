//! A robot as it stands in a cell: joints that follow others, joints that nothing moves, wheels on the ground, shapes without files.

use std::fmt::Write as _;

use calib_plan::list::Why;
use calib_plan::{JointNoiseOf, Known, Note, Options, Plan, plan, terminal, write};

use crate::robots::{known, of_text};

/// Joint: name, parent, lower and upper, mimic.
type Line = (&'static str, &'static str, [f64; 2], &'static str);

/// A chain of turning joints with links of 0.3 m, each about another axis than the one before; `shape`: of the link of each joint.
fn urdf(joints: &[Line], shape: &dyn Fn(&str) -> String) -> String {
    let mut text = format!(
        "<robot name=\"arm\"><link name=\"base\">{}</link>",
        shape("base")
    );
    for (i, (name, parent, [lower, upper], mimic)) in joints.iter().enumerate() {
        let axis = ["0 0 1", "0 1 0", "1 0 0"][i % 3];
        let shape = shape(name);
        let mimic = match *mimic {
            "" => String::new(),
            of => format!("<mimic {of}/>"),
        };
        // Writing to a String does not fail.
        let _ = write!(
            text,
            "<link name=\"{name}_l\">{shape}</link><joint name=\"{name}\" type=\"revolute\"><parent link=\"{parent}\"/>\
             <child link=\"{name}_l\"/><origin xyz=\"0 0 0.3\"/><axis xyz=\"{axis}\"/>\
             <limit lower=\"{lower}\" upper=\"{upper}\" effort=\"9\" velocity=\"2\"/>{mimic}</joint>"
        );
    }
    text + "</robot>"
}

/// Markers on one link, nothing recorded; `extra`: further sections.
fn profile(link: &str, extra: &str) -> String {
    format!(
        "calib: 1\nrobot: {{name: arm, urdf: arm.urdf}}\ntracker: {{frame: lab, marker_sigma_mm: 0.1}}\n\
         bodies:\n  hand: {{link: {link}, markers: [f1, f2, f3, f4]}}\n\
         recordings: {{poses: {{file: poses.csv, use: static}}}}\n\
         solve: {{free: [bodies, tracker, joint_offsets]}}\n{extra}"
    )
}

fn no_shape(_: &str) -> String {
    String::new()
}

const ARM: [Line; 4] = [
    ("j1", "base", [-1.5, 1.5], ""),
    ("j2", "j1_l", [-1.4, 1.4], ""),
    (
        "par",
        "j2_l",
        [-0.7, 0.7],
        "joint=\"j2\" multiplier=\"-1\" offset=\"0.1\"",
    ),
    ("j3", "par_l", [-1.2, 1.2], ""),
];

fn planned(known: &Known, poses: usize) -> Plan {
    let options = Options {
        poses: Some(poses),
        candidates: 240,
        ..Options::default()
    };
    plan(known, &options).unwrap_or_else(|e| panic!("{e}"))
}

fn screen(plan: &Plan) -> String {
    let screen = terminal::summary(plan, "out", 80);
    assert!(screen.lines().count() <= 24, "{screen}");
    let words: Vec<&str> = screen.split_whitespace().collect();
    words.join(" ")
}

#[test]
fn joints_that_follow_stay_within_their_limits() {
    for (extra, narrowed) in [("", false), ("plan: {joints: {j2_deg: [-80, 80]}}\n", true)] {
        let known = known(of_text(urdf(&ARM, &no_shape), &profile("j3_l", extra)));
        let plan = planned(&known, 16);
        let model = &known.robot.model;
        let id = |name: &str| model.joint_id(name).expect("a joint");
        let all = plan.postures.iter().map(|p| &p.q).chain(&plan.held_out);
        let at: Vec<f64> = all.map(|q| model.position(q, id("par"))).collect();
        assert!(at.iter().all(|q| q.abs() <= 0.7 + 1e-9), "{at:?}");
        let note = Note::NarrowedByFollower {
            joints: vec![["j2".to_owned(), "par".to_owned()]],
        };
        assert_eq!(plan.notes.contains(&note), narrowed, "{:?}", plan.notes);
    }
}

#[test]
fn what_the_plan_does_not_move_stands_within_its_limits() {
    let mut joints = ARM.to_vec();
    joints.push(("elbow", "base", [-2.3, -0.5], ""));
    let known = known(of_text(urdf(&joints, &no_shape), &profile("j3_l", "")));
    let plan = planned(&known, 12);
    let elbow = known
        .robot
        .model
        .joint_id("elbow")
        .expect("a joint")
        .index();
    let all = plan.postures.iter().map(|p| &p.q).chain(&plan.held_out);
    assert!(all.into_iter().all(|q| q[elbow] == -0.5));
}

/// An arm on a base with a wheel that reaches below the ground.
fn mobile(extra: &str) -> Known {
    let mut joints = ARM.to_vec();
    joints.push(("wheel", "base", [-3.0, 3.0], ""));
    let shape = |name: &str| {
        match name {
        "wheel" => "<collision><origin xyz=\"0 0.9 -0.4\"/><geometry><sphere radius=\"0.1\"/></geometry></collision>".to_owned(),
        "base" => String::new(),
        _ => "<collision><origin xyz=\"0 0 0.15\"/><geometry><sphere radius=\"0.03\"/></geometry></collision>".to_owned(),
    }
    };
    known(of_text(urdf(&joints, &shape), &profile("j3_l", extra)))
}

#[test]
fn what_stands_on_the_ground_removes_no_posture_and_is_named() {
    let plan = planned(&mobile("plan: {ground_mm: -150}\n"), 12);
    assert!(
        plan.counts.ground < plan.counts.tried / 2,
        "{:?}",
        plan.counts
    );
    let said = screen(&plan);
    assert!(
        said.contains("no planned joint moves them") && said.contains("`wheel_l`"),
        "{said}"
    );
    let without = planned(&mobile(""), 12);
    let standing = |n: &Note| matches!(n, Note::StandsThere { .. });
    assert!(!without.notes.iter().any(standing));
}

#[test]
fn files_of_shapes_that_are_missing_are_named_and_said_beside_the_trajectory() {
    let shape = |name: &str| match name {
        "j2" => "<collision><geometry><mesh filename=\"meshes/upper.stl\"/></geometry></collision>"
            .to_owned(),
        "base" | "par" => String::new(),
        _ => "<collision><geometry><sphere radius=\"0.03\"/></geometry></collision>".to_owned(),
    };
    let known = known(of_text(
        urdf(&ARM, &shape),
        &profile("j3_l", "plan: {ground_mm: -900}\n"),
    ));
    let plan = planned(&known, 12);
    let said = screen(&plan);
    for part in [
        "`plan.ground_mm` is not compared with links without shapes: `par_l`",
        "could not be read: `j2_l`",
        "`robot.packages`",
        "trajectory.json are not checked for collisions of",
        "links without shapes (`par_l`)",
        "links whose shapes could not be read (`j2_l`)",
    ] {
        assert!(said.contains(part), "{part}: {said}");
    }
}

/// Every row of `plan.csv` is moved to, and the rows say which of them are recorded.
#[test]
fn the_table_has_the_postures_on_the_way_and_the_reason_of_each() {
    let mut plan = planned(&mobile(""), 12);
    let model = mobile("").robot.model;
    let mut detour = plan.postures[3].clone();
    detour.why = Why::Detour;
    plan.postures.insert(4, detour);
    let files = plan.files(&model, "arm.yaml").expect("files");
    let file = files
        .iter()
        .find(|f| f.name == "plan.csv")
        .expect("a table");
    let table = String::from_utf8(file.bytes.clone()).expect("text");
    let rows: Vec<&str> = table.lines().filter(|l| !l.starts_with('#')).collect();
    assert!(rows[0].starts_with("pose,note,"), "{table}");
    assert_eq!(rows.len(), 1 + plan.postures.len());
    for (k, posture) in plan.postures.iter().enumerate() {
        let detour = rows[k + 1].starts_with(&format!("{k},detour,"));
        assert_eq!(detour, posture.why == Why::Detour, "{table}");
        assert_eq!(plan.pose(k), (!detour).then_some(k));
    }
    let read = write::read_postures(&file.bytes, "plan.csv", &model, &plan.joints);
    assert_eq!(read.expect("postures").len(), plan.recorded());
    let said = screen(&plan);
    assert!(
        said.contains("1 row is on the way around obstacles only"),
        "{said}"
    );
}

#[test]
fn the_noise_of_joints_is_that_of_the_profile_and_is_named() {
    let simulate = "simulate:\n  seed: 1\n  tracker_from_root: {}\n  mounts: {hand: {markers_mm: {f1: [0, 0, 0], f2: [80, 0, 0], f3: [0, 60, 0], f4: [0, 0, 50]}}}\n  \
                    errors: {}\n  noise: {marker_mm: 0.1, joint_deg: 0.05}\n  recordings: {poses: {random: {j1_deg: [-9, 9]}, poses: 2}}\n";
    let of = |profile: &str| known(of_text(urdf(&ARM, &no_shape), profile)).joint_noise();
    let simulated = profile("j3_l", simulate);
    let (sigma, from) = of(&simulated);
    assert!((sigma.to_degrees() - 0.05).abs() < 1e-12);
    assert_eq!(from, JointNoiseOf::Simulation);
    let both = simulated.replace("solve: {", "solve: {noise: {joint_deg: 0.002}, ");
    let (sigma, from) = of(&both);
    assert!((sigma.to_degrees() - 0.002).abs() < 1e-12);
    assert_eq!(from, JointNoiseOf::Solve);
    assert_eq!(of(&profile("j3_l", "")).1, JointNoiseOf::Program);
    // It is what the expected σ is made of.
    let sigma = |profile: &str| {
        let known = known(of_text(urdf(&ARM, &no_shape), profile));
        let plan = planned(&known, 12);
        let named = |n: &Note| matches!(n, Note::JointNoise { .. });
        assert!(plan.notes.iter().any(named));
        plan.sigma.expect("determined")
    };
    assert!(sigma(&simulated) > 1.5 * sigma(&both));
}
