//! A tracker with a left-handed frame and an arm that is symmetric about a plane: the recordings are those of reversed joints, too, and which it is they do
//! not show.

use crate::computed::points;
use crate::scratch::Scratch;

use calib_urdf::RobotModel;

/// Axes and origins in the plane y = 0: the mirror image of this arm is the arm with j1, j4 and j6 reversed.
const JOINTS: [(&str, &str); 6] = [
    ("0 0 1", "0 0 0.3"),
    ("0 1 0", "0.06 0 0.1"),
    ("0 1 0", "0 0 0.42"),
    ("1 0 0", "0.1 0 0.05"),
    ("0 1 0", "0.25 0 0"),
    ("1 0 0", "0.08 0 0"),
];

fn arm() -> String {
    let mut text = "<robot name=\"arm\">\n  <link name=\"l0\"/>\n".to_owned();
    for (i, (axis, origin)) in JOINTS.iter().enumerate() {
        text += &format!(
            "  <link name=\"l{n}\"/>\n  <joint name=\"j{n}\" type=\"revolute\">\n    <parent link=\"l{i}\"/>\n    <child link=\"l{n}\"/>\n    \
             <origin xyz=\"{origin}\"/>\n    <axis xyz=\"{axis}\"/>\n    <limit lower=\"-3\" upper=\"3\" effort=\"50\" velocity=\"2\"/>\n  </joint>\n",
            n = i + 1
        );
    }
    text + "</robot>\n"
}

/// The table with the numbers of some columns negated.
fn negated(table: &str, names: &[&str]) -> String {
    let mut lines = table.lines();
    let header = lines.next().expect("a header");
    let which: Vec<bool> = header.split(',').map(|c| names.contains(&c)).collect();
    let of = |line: &str| {
        let cells = line.split(',').zip(&which);
        let cells = cells.map(|(cell, negate)| match (negate, cell.strip_prefix('-')) {
            (false, _) => cell.to_owned(),
            (true, Some(plus)) => plus.to_owned(),
            (true, None) => format!("-{cell}"),
        });
        cells.collect::<Vec<_>>().join(",") + "\n"
    };
    format!("{header}\n{}", lines.map(of).collect::<String>())
}

/// What `calib init` writes and says of the arm's tables with these columns negated, and the code of `calib run`.
fn read(names: &[&str], seed: u64) -> (String, String, i32) {
    let robot = RobotModel::from_urdf_text(&arm(), "arm").expect("an arm");
    let table = |n: usize, seed: u64| negated(&points(&robot, 2e-4, 4, n, seed), names);
    let dir = Scratch::new()
        .file("arm.urdf", arm())
        .file("poses.csv", table(40, seed))
        .file("checks.csv", table(12, seed + 100));
    let said = dir.calib([
        "init",
        "arm.urdf",
        "poses.csv",
        "checks.csv",
        "-o",
        "arm.yaml",
    ]);
    let dir = dir.edit(
        "arm.yaml",
        "# limits: {held_out_rms_mm: 1}",
        "limits: {held_out_rms_mm: 1}",
    );
    let ran = dir.calib(["run", "arm.yaml", "--out", "out"]);
    (dir.read("arm.yaml"), said.words(), ran.code)
}

#[test]
fn a_left_handed_tracker_is_not_corrected_by_reversed_joints() {
    for (seed, axis) in [(1, "X_mm"), (2, "Y_mm"), (3, "Z_mm"), (4, "Z_mm")] {
        let (profile, words, code) = read(&[axis], seed);
        assert!(!profile.contains("reversed: [j"), "{seed}: {profile}");
        assert!(words.contains("left-handed"), "{seed}: {words}");
        assert_ne!(code, 0, "{seed}");
    }
}

/// One reversed joint makes no mirror image of this arm: it is corrected.
#[test]
fn a_reversed_joint_is() {
    for (seed, column) in [(11, "j1_deg"), (12, "j2_deg"), (13, "j5_deg")] {
        let (profile, words, code) = read(&[column], seed);
        let joint = &column[..2];
        assert!(profile.contains(&format!("reversed: [{joint}]")), "{words}");
        assert_eq!(code, 0, "{seed}: {words}");
    }
}
