//! `calib plan` on robots that were and were not recorded.

use crate::scratch::Scratch;

#[test]
fn a_robot_that_was_never_recorded_has_a_plan() {
    if !skipped_tests::thorough() {
        return;
    }
    let dir = Scratch::new().robot("ripley");
    for file in ["base_sweep", "wrist_sweep", "arm_poses", "checks"] {
        std::fs::remove_file(dir.path(&format!("robots/ripley/{file}.csv"))).expect("a recording");
    }
    let ran = dir.calib([
        "plan",
        "robots/ripley.yaml",
        "--poses",
        "18",
        "--candidates",
        "512",
        "--out",
        "out",
    ]);
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    assert!(ran.stdout.lines().count() <= 24, "{}", ran.stdout);
    assert!(
        ran.stdout.contains("18 postures to record"),
        "{}",
        ran.stdout
    );
    assert!(ran.stdout.contains("Not recorded yet"), "{}", ran.stdout);
    for file in ["plan.csv", "held_out.csv", "plan.yaml", "plan.html"] {
        assert!(dir.path(&format!("out/{file}")).is_file(), "{file}");
    }
    let page = dir.read("out/plan.html");
    assert!(page.contains("id=\"view-data\""), "the 3-D view");
    let blocked = page.contains("No collision-free motion");
    assert_eq!(dir.path("out/trajectory.json").is_file(), !blocked);
    // The list itself is a table of postures.
    let again = dir.calib([
        "plan",
        "robots/ripley.yaml",
        "--poses",
        "6",
        "--candidates",
        "256",
        "--task",
        "out/plan.csv",
        "--out",
        "out2",
        "--json",
    ]);
    assert_eq!(again.code, 0, "{}", again.stderr);
    let plan: serde_json::Value = serde_json::from_str(&again.stdout).expect("JSON");
    assert_eq!(plan["postures"].as_array().map(Vec::len), Some(6), "{plan}");
}

#[test]
fn what_is_recorded_already_counts() {
    let dir = Scratch::new().robot("ripley");
    let ran = dir.calib([
        "plan",
        "robots/ripley.yaml",
        "--poses",
        "6",
        "--candidates",
        "256",
        "--out",
        "out",
        "--json",
    ]);
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    let plan: serde_json::Value = serde_json::from_str(&ran.stdout).expect("JSON");
    let (before, after) = (
        plan["sigma_before_mm"].as_f64(),
        plan["sigma_after_mm"].as_f64(),
    );
    let (before, after) = (before.expect("recorded"), after.expect("planned"));
    assert!(after < before && before < 1.0, "{before} {after}");
}

#[test]
fn a_plan_that_is_impossible_says_what_removes_the_postures() {
    let dir = Scratch::new().robot("ripley").edit(
        "robots/ripley.yaml",
        "solve:",
        "plan: {ground_mm: 9000}\nsolve:",
    );
    let ran = dir.calib([
        "plan",
        "robots/ripley.yaml",
        "--candidates",
        "128",
        "--out",
        "out",
    ]);
    assert_eq!(ran.code, 2, "{}", ran.stderr);
    assert!(
        ran.stderr.contains("the ground removes 128"),
        "{}",
        ran.stderr
    );
    assert!(!dir.path("out/plan.csv").exists());
}

/// An arm of two joints with a wall in the middle of the range of the first: no way leads around it.
const WALLED: &str = "<robot name=\"walled\"><link name=\"base\"/><link name=\"arm\"/><link name=\"tip\">
<collision><origin xyz=\"0.5 0 0\"/><geometry><sphere radius=\"0.05\"/></geometry></collision></link>
<joint name=\"j1\" type=\"revolute\"><parent link=\"base\"/><child link=\"arm\"/><axis xyz=\"0 0 1\"/>
<limit lower=\"-2\" upper=\"2\" effort=\"1\" velocity=\"1\"/></joint>
<joint name=\"j2\" type=\"revolute\"><parent link=\"arm\"/><child link=\"tip\"/><axis xyz=\"1 0 0\"/>
<limit lower=\"-2\" upper=\"2\" effort=\"1\" velocity=\"1\"/></joint></robot>
";

/// `trajectory.json` of an earlier plan leads through what a later one keeps out of.
#[test]
fn a_trajectory_that_is_not_written_does_not_remain() {
    let dir = Scratch::new().file("walled.urdf", WALLED);
    let made = dir.calib(["init", "walled.urdf"]);
    assert_eq!(made.code, 0, "{}", made.stderr);
    let profile = dir.path("robots/walled.yaml");
    let plan = || {
        let ran = dir.calib([
            "plan",
            "robots/walled.yaml",
            "--poses",
            "8",
            "--candidates",
            "64",
            "--out",
            "out",
        ]);
        assert_eq!(ran.code, 0, "{}", ran.stderr);
        ran.stdout
    };
    let free = plan();
    assert!(dir.path("out/trajectory.json").exists(), "{free}");
    let text = std::fs::read_to_string(&profile).expect("a profile");
    let wall = "\nplan:\n  keep_outs:\n    wall: {size_mm: [300, 80, 300], center: {xyz_mm: [500, 0, 0]}}\n";
    std::fs::write(&profile, text + wall).expect("written");
    let blocked = plan();
    assert!(blocked.contains("is not written"), "{blocked}");
    assert!(!dir.path("out/trajectory.json").exists(), "{blocked}");
    assert!(!dir.read("out/calib.manifest").contains("trajectory"));
}
