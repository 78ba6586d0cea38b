//! A row that the program that records has lost: from there on, joints and tracker are paired with what belongs to their neighbors.

use crate::computed::{arm, points};
use crate::scratch::Scratch;

use calib_urdf::RobotModel;

/// Columns of the joints.
const JOINTS: usize = 6;

/// The table without the joint values (or without the tracker's) of these rows, from 1: what follows moves up.
fn without(table: &str, rows: &[usize], of_joints: bool) -> String {
    let mut lines = table.lines();
    let header = lines.next().expect("a header");
    let rows_of = |wanted: bool| -> Vec<String> {
        let all = table.lines().skip(1).enumerate();
        let kept = all.filter(|(i, _)| wanted != of_joints || !rows.contains(&(i + 1)));
        let half = |line: &str| -> String {
            let cells: Vec<&str> = line.split(',').collect();
            let (joints, tracked) = cells.split_at(JOINTS);
            if wanted { joints } else { tracked }.join(",")
        };
        kept.map(|(_, line)| half(line)).collect()
    };
    let pairs = rows_of(true).into_iter().zip(rows_of(false));
    let pairs = pairs.map(|(joints, tracked)| format!("{joints},{tracked}\n"));
    format!("{header}\n{}", pairs.collect::<String>())
}

/// What `calib init` says and what `calib check` finds of `n` poses of which a table has lost rows.
fn found(
    (n, error): (usize, f64),
    seed: u64,
    rows: &[usize],
    of_joints: bool,
) -> (String, serde_json::Value) {
    let robot = RobotModel::from_urdf_text(&arm(error, seed), "arm").expect("an arm");
    let poses = points(&robot, 2e-4, 3, n, seed + 1);
    let dir = Scratch::new()
        .file("arm.urdf", arm(0.0, 0))
        .file("poses.csv", without(&poses, rows, of_joints))
        .file("checks.csv", points(&robot, 2e-4, 3, 12, seed + 2));
    let said = dir.calib([
        "init",
        "arm.urdf",
        "poses.csv",
        "checks.csv",
        "-o",
        "arm.yaml",
    ]);
    let json = dir.calib(["check", "arm.yaml", "--json"]).json();
    let findings = json["findings"].as_array().cloned().unwrap_or_default();
    let errors = findings.into_iter().filter(|f| f["severity"] == "error");
    (said.words(), errors.collect())
}

#[test]
fn rows_that_one_table_has_lost_are_named_with_their_place() {
    let cases: [(&[usize], bool); 6] = [
        (&[9], true),
        (&[20], true),
        (&[30, 31], true),
        (&[9], false),
        (&[20, 21], false),
        (&[31], false),
    ];
    let seeds = (1..5).flat_map(|k| (10 * k..).zip(cases));
    for (seed, (rows, of_joints)) in seeds {
        let (_, errors) = found((40, 4e-3), seed, rows, of_joints);
        let case = format!("{seed} {rows:?} {of_joints}: {errors}");
        let error = &errors[0];
        assert_eq!(error["id"], "changed-while-recording", "{case}");
        let kind = if of_joints {
            "rows-earlier"
        } else {
            "rows-later"
        };
        assert_eq!(error["facts"]["kind"], kind, "{case}");
        assert_eq!(
            error["facts"]["rows"].as_u64(),
            Some(rows.len() as u64),
            "{case}"
        );
        // The header is the first line of the file.
        let named: usize = error["facts"]["row"]
            .as_str()
            .and_then(|row| row.parse().ok())
            .unwrap_or_else(|| panic!("{case}"));
        assert!(named.abs_diff(rows[0] + 1) <= 1, "{case}");
        assert_eq!(errors.as_array().map(Vec::len), Some(1), "{case}");
    }
}

/// Where the last rows of many are wrong, `calib init` says that they are, and not that all agree.
#[test]
fn poses_that_do_not_fit_are_not_said_to() {
    let (words, errors) = found((30, 4e-3), 11, &[24], true);
    assert!(
        errors.to_string().contains("changed-while-recording"),
        "{errors}"
    );
    assert!(!words.contains("poses fit it to"), "{words}");
    let (words, errors) = found((30, 4e-3), 11, &[], true);
    assert!(words.contains("42 poses fit it to"), "{words}");
    assert_eq!(errors.as_array().map(Vec::len), Some(0), "{errors}");
}
