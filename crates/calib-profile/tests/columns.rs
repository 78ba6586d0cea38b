//! Faults of a column map stand in the profile; values that YAML reads as something else are named as what was meant.

use calib_profile::{check, parse};
use calib_urdf::RobotModel;

const URDF: &str = r#"<robot name="arm">
  <link name="base"/> <link name="upper"/> <link name="tip"/>
  <joint name="joint_1" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 0 1"/>
    <limit lower="-2" upper="2" effort="1" velocity="1"/></joint>
  <joint name="joint_2" type="revolute"><parent link="upper"/><child link="tip"/><axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" effort="1" velocity="1"/></joint>
</robot>"#;

const PROFILE: &str = "calib: 1
robot: {name: arm, urdf: arm.urdf}
tracker: {frame: lab, marker_sigma_mm: 0.2}
bodies: {hand: {link: tip, markers: [a, b, c]}}
recordings:
  fit:
    file: fit.csv
    use: static
    robot_log:
      file: robot.csv
      columns: &columns
        angles: deg
        time: {column: time_ms, unit: ms}
        joints: {joint_1: A1, joint_2: A2}
    timing: {}
  validation:
    file: check.csv
    use: validation
    robot_log: {file: log.csv, columns: *columns}
    timing: {}
solve: {free: [bodies, tracker, joint_offsets]}
";

fn said(right: &str, wrong: &str) -> String {
    assert!(PROFILE.contains(right), "no `{right}`");
    let text = PROFILE.replacen(right, wrong, 1);
    let robot = RobotModel::from_urdf_text(URDF, "arm.urdf").expect("a robot");
    let checked = parse(&text, "arm.yaml").and_then(|raw| check(&raw, &text, "arm.yaml", &robot));
    checked.err().map(|e| e.to_string()).unwrap_or_default()
}

/// The text with the fault has one problem, at this line, with these words.
fn one_problem(right: &str, wrong: &str, line: usize, words: &[&str]) {
    let found = said(right, wrong);
    let place = format!("arm.yaml:{line}:");
    assert!(found.starts_with(&place), "`{wrong}`:\n{found}");
    assert_eq!(found.matches("help: ").count(), 1, "`{wrong}`:\n{found}");
    for word in words {
        assert!(found.contains(word), "`{wrong}`: no `{word}` in\n{found}");
    }
    assert!(!found.contains("export the recording"), "{found}");
}

const JOINTS: &str = "joints: {joint_1: A1, joint_2: A2}";

#[test]
fn a_good_map_has_no_problem() {
    assert_eq!(said("angles: deg", "angles: deg"), "");
    let whole = format!("{JOINTS}\n        temperatures: {{robot: T}}");
    assert_eq!(said(JOINTS, &whole), "");
}

#[test]
fn a_name_of_the_map_that_is_not_a_joint_is_named() {
    let words = ["the URDF has no joint `join_2`", "did you mean `joint_2`?"];
    one_problem("joint_2: A2", "join_2: A2", 14, &words);
    // The same typo: nothing more is concluded from it.
    let reversed = "joints: {joint_1: A1, join_2: A2}\n        reversed: [joint_2]";
    one_problem(JOINTS, reversed, 14, &words);
    let torques = format!("{JOINTS}\n        torques: {{join_2: T2}}");
    one_problem(JOINTS, &torques, 15, &words);
    let named = "joint_columns: [joint_1, join_2]";
    one_problem(JOINTS, named, 14, &words);
}

#[test]
fn faults_of_a_map_are_placed_in_it() {
    let with = |more: &str| format!("{JOINTS}\n        {more}");
    one_problem(
        JOINTS,
        &with("reversed: [elbow]"),
        15,
        &["`reversed` names `elbow`", "remove it from `reversed`"],
    );
    one_problem(
        "joint_2: A2",
        "joint_2: A1",
        14,
        &["column `A1` twice", "`joints.joint_1`", "`joints.joint_2`"],
    );
    one_problem(
        JOINTS,
        &with("markers: {a: [a_x_mm, a_y_mm, a_z_mm]}\n        lengths: cm"),
        16,
        &["contradicts the name of column `a_x_mm`", "`lengths: mm`"],
    );
    one_problem(
        JOINTS,
        &with("preset: franca"),
        15,
        &["no preset", "did you mean `franka`?"],
    );
}

#[test]
fn names_that_contradict_the_stated_unit_are_refused_both_ways() {
    let map = |unit: &str, suffix: &str| {
        format!(
            "angles: {unit}\n        time: {{column: t}}\n        joints: {{joint_1: A1_{suffix}}}"
        )
    };
    let rest = "angles: deg\n        time: {column: time_ms, unit: ms}\n        joints: {joint_1: A1, joint_2: A2}";
    let words = ["`angles: rad`", "write `angles: deg`"];
    one_problem(rest, &map("rad", "deg"), 12, &words);
    let words = ["`angles: deg`", "write `angles: rad`"];
    one_problem(rest, &map("deg", "rad"), 12, &words);
    assert_eq!(said(rest, &map("deg", "deg")), "");
    // Not stated: the names say it.
    let unstated = map("rad", "deg").replace("angles: rad", "skip_lines: 0");
    assert_eq!(said(rest, &unstated), "");
}

#[test]
fn what_yaml_reads_otherwise_is_named_as_it_was_meant() {
    let comma = ["`0,2` has a decimal comma", "write a decimal point: `0.2`"];
    let right = "marker_sigma_mm: 0.2";
    one_problem(right, "marker_sigma_mm: 0,2", 3, &comma);
    one_problem(right, "marker_sigma_mm: \"0,2\"", 3, &comma);
    let block = "tracker:\n  frame: lab\n  marker_sigma_mm: 0,2";
    let flow = "tracker: {frame: lab, marker_sigma_mm: 0.2}";
    one_problem(flow, block, 5, &comma);
    let other = said(right, "marker_sigma_mm: 0.2, 7: x");
    assert!(other.contains("unknown key `7`"), "{other}");
    let time = "time: {column: time_ms, unit: ms}";
    for (column, unit) in [("Zeit_ms", "ms"), ("Zeit", "s"), ("t_us", "us")] {
        let meant = format!("write `time: {{column: {column}, unit: {unit}}}`");
        one_problem(time, &format!("time: {column}"), 13, &[&meant]);
    }
    let version = "write `calib: 1` as the first line";
    one_problem("calib: 1\n", "", 1, &[version]);
    one_problem("calib: 1\n", "# my arm\n", 1, &[version]);
}
