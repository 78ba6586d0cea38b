//! `calib twin` from a profile, a plan and a folder of results.

use crate::scratch::Scratch;

const URDF: &str = r#"<robot name="arm">
<link name="l0"/><link name="l1"/><link name="l2"/><link name="l3"/>
<joint name="j1" type="revolute"><parent link="l0"/><child link="l1"/><origin xyz="0 0 0.3"/><axis xyz="0 0 1"/><limit lower="-2.5" upper="2.5" effort="50" velocity="2"/></joint>
<joint name="j2" type="revolute"><parent link="l1"/><child link="l2"/><origin xyz="0.3 0 0.1"/><axis xyz="0 1 0"/><limit lower="-2.5" upper="2.5" effort="50" velocity="2"/></joint>
<joint name="j3" type="revolute"><parent link="l2"/><child link="l3"/><origin xyz="0.3 0 0"/><axis xyz="0 1 0"/><limit lower="-2.5" upper="2.5" effort="50" velocity="2"/></joint>
</robot>
"#;

const PROFILE: &str = "calib: 1
robot: {name: arm, urdf: arm.urdf}
tracker: {frame: lab, marker_sigma_mm: 0.1}
bodies:
  foot: {link: l0, markers: [b1, b2, b3], mount: {}, template_mm: {b1: [-120, -100, 0], b2: [130, -90, 0], b3: [110, 100, 20]}}
  hand: {link: l3, markers: [f1, f2, f3]}
recordings: {poses: {file: poses.csv, use: static}, checks: {file: checks.csv, use: validation}}
solve:
  free: [bodies, tracker, joint_offsets]
  prior: {offset_deg: 0.3}
simulate:
  seed: 6
  tracker_from_root: {xyz_mm: [900, 300, 100], rpy_deg: [0, 0, 40]}
  mounts:
    foot: {markers_mm: {b1: [-120, -100, 0], b2: [130, -90, 0], b3: [110, 100, 20]}}
    hand: {xyz_mm: [40, 10, 5], rpy_deg: [5, 80, 0], markers_mm: {f1: [0, 0, 0], f2: [70, 0, 0], f3: [20, 60, 0]}}
  errors: {joint_offset_deg: 0.3}
  noise: {marker_mm: 0.1, joint_deg: 0.003}
  recordings:
    poses: {random: {j1_deg: [-110, 110], j2_deg: [-110, 110], j3_deg: [-110, 110]}, poses: 14}
    checks: {random: {j1_deg: [-110, 110], j2_deg: [-110, 110], j3_deg: [-110, 110]}, poses: 6}
";

fn arm() -> Scratch {
    Scratch::new()
        .file("arm.urdf", URDF)
        .file("arm.yaml", PROFILE)
}

#[test]
fn a_session_that_nobody_recorded_has_a_twin() {
    let dir = arm();
    let ran = dir.calib([
        "twin",
        "arm.yaml",
        "--trials",
        "3",
        "--sigma-mm",
        "0.05",
        "--out",
        "out",
    ]);
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    assert!(ran.stdout.lines().count() <= 24, "{}", ran.stdout);
    assert!(
        ran.stdout.contains("Twin of arm: 3 trials"),
        "{}",
        ran.stdout
    );
    assert!(ran.stdout.contains("Nothing is recorded"), "{}", ran.stdout);
    // Nothing is a progress bar where nothing is a terminal.
    assert_eq!(ran.stderr, "");
    let twin: serde_json::Value = serde_json::from_str(&dir.read("out/twin.json")).expect("JSON");
    assert!(
        twin["resemblance"].is_null() && twin["source"] == "simulation",
        "{twin}"
    );
    assert!(!twin["promises"].as_array().expect("promises").is_empty());
    let page = dir.read("out/twin.html");
    assert!(page.contains("What the session of arm can and cannot tell"));
    let schema = dir.calib(["schema", "twin"]);
    let schema: serde_json::Value = serde_json::from_str(&schema.stdout).expect("JSON");
    let valid = jsonschema::validator_for(&schema).expect("a schema");
    assert!(valid.is_valid(&twin));
}

#[test]
fn a_plan_has_a_twin_and_a_plan_for_another_robot_has_none() {
    let dir = arm();
    let planned = dir.calib([
        "plan",
        "arm.yaml",
        "--poses",
        "12",
        "--candidates",
        "128",
        "--out",
        "plan",
    ]);
    assert_eq!(planned.code, 0, "{}", planned.stderr);
    let twin = [
        "twin",
        "arm.yaml",
        "--plan",
        "plan/plan.yaml",
        "--trials",
        "2",
        "--out",
        "out",
    ];
    let ran = dir.calib(twin);
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    let words: Vec<&str> = ran.stdout.split_whitespace().collect();
    let said = words.join(" ");
    assert!(said.contains("of the plan"), "{said}");
    assert!(
        said.contains("joints have a noise of") && said.contains(".noise.joint_deg`"),
        "{said}"
    );
    let dir = dir.edit("plan/plan.yaml", "robot: arm", "robot: leg");
    let ran = dir.calib(twin);
    assert_eq!(ran.code, 3, "{}", ran.stderr);
    assert!(
        ran.stderr.contains("the plan is for `leg`"),
        "{}",
        ran.stderr
    );
}

#[test]
fn results_have_the_twin_of_their_recordings_and_changed_recordings_have_none() {
    let dir = arm();
    let simulated = dir.calib(["simulate", "arm.yaml", "--out", "."]);
    assert_eq!(simulated.code, 0, "{}", simulated.stderr);
    let ran = dir.calib(["run", "arm.yaml", "--out", "results/arm"]);
    assert!(ran.code <= 1, "{}", ran.stderr);
    let twin = [
        "twin",
        "results/arm",
        "--trials",
        "2",
        "--json",
        "--out",
        "out",
    ];
    let ran = dir.calib(twin);
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    let twin_of: serde_json::Value = serde_json::from_str(&ran.stdout).expect("JSON");
    assert_eq!(twin_of["source"], "recordings");
    assert!(
        twin_of["resemblance"]["p_value"].is_null(),
        "2 trials do not tell"
    );
    let text = dir.read("poses.csv");
    let dir = dir.file("poses.csv", text + "# another file\n");
    let ran = dir.calib(twin);
    assert_eq!(ran.code, 3, "{}", ran.stderr);
    assert!(
        ran.stdout.contains("`poses.csv` is not the file"),
        "{}",
        ran.stdout
    );
}
