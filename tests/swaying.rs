//! A tracker or a stand that does not stand still, seen by the body on the robot's table.

use crate::scratch;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use scratch::Scratch;
use serde_json::Value;

const PROFILE: &str = "robots/ripley.yaml";
const FILES: [&str; 4] = [
    "robots/ripley/base_sweep.csv",
    "robots/ripley/wrist_sweep.csv",
    "robots/ripley/arm_poses.csv",
    "robots/ripley/checks.csv",
];

/// A normal number of a row and an axis.
fn normal(row: usize, axis: usize) -> f64 {
    StandardNormal.sample(&mut ChaCha8Rng::seed_from_u64(3 * row as u64 + axis as u64))
}

/// The report of the shipped robot whose markers are moved: by what `motion` says of row and axis, m, where `moves` holds for the marker.
fn judged(moves: impl Fn(&str) -> bool, motion: impl Fn(usize, usize) -> f64) -> Value {
    let mut dir = Scratch::new().brief("ripley");
    for (number, file) in FILES.iter().enumerate() {
        dir = dir.cells(file, |row, column, cell| {
            let coordinate = column.strip_suffix("_m").and_then(|c| c.split_once('.'));
            let Some((_, axis)) = coordinate.filter(|(marker, _)| moves(marker)) else {
                return cell.to_owned();
            };
            let axis = ["x", "y", "z"].iter().position(|a| *a == axis);
            let (Some(axis), Ok(at)) = (axis, cell.parse::<f64>()) else {
                return cell.to_owned();
            };
            format!("{:.6}", at + motion(1000 * number + row, axis))
        });
    }
    let ran = dir.calib(["run", PROFILE, "--out", "out"]);
    assert!(ran.code != 3, "{}", ran.stderr);
    dir.json("out/report.json")
}

fn findings<'a>(report: &'a Value, id: &str) -> Vec<&'a Value> {
    let all = report["findings"].as_array().expect("a list").iter();
    all.filter(|f| f["id"] == id).collect()
}

#[test]
fn a_tracker_that_sways_is_named_by_the_body_that_no_joint_moves() {
    // From row to row, and as one that is carried about.
    let sways = |row: usize, axis: usize| 8e-4 * normal(row, axis);
    let walks = |row: usize, axis: usize| {
        (row / 1000 * 1000..=row)
            .map(|k| 6e-4 * normal(k, axis))
            .sum::<f64>()
    };
    for (motion, expected) in [
        (&sways as &dyn Fn(usize, usize) -> f64, Some(1.39e-3)),
        (&walks, None),
    ] {
        let report = judged(|_| true, motion);
        let named = findings(&report, "tracker-sways");
        let [one] = named[..] else {
            panic!("{:#}", report["findings"]);
        };
        let facts = &one["facts"];
        assert_eq!(facts["body"], "table");
        assert!(facts["explains"]["value"].as_f64() > Some(0.5), "{facts}");
        let size = facts["motion"]["value"].as_f64().expect("m");
        if let Some(expected) = expected {
            assert!((size / expected - 1.0).abs() < 0.25, "{size}");
        }
        assert!(findings(&report, "changed-while-recording").is_empty());
        assert_ne!(report["verdict"], "accepted");
        if !report["diagnosis"].is_null() {
            assert_eq!(report["diagnosis"]["evidence"], "tracker-sways");
        }
    }
}

/// One step is a tracker that was moved once; what a body does alone is no tracker's.
#[test]
fn nothing_else_is_called_a_tracker_that_sways() {
    let bump = |row: usize, _: usize| match row {
        2008..3000 => 2e-3,
        _ => 0.0,
    };
    let report = judged(|_| true, bump);
    assert!(findings(&report, "tracker-sways").is_empty());
    let changed = findings(&report, "changed-while-recording");
    assert_eq!(changed.len(), 1, "{:#}", report["findings"]);
    let sways = |row: usize, axis: usize| 8e-4 * normal(row, axis);
    let of_table = |marker: &str| marker.starts_with("table");
    for report in [judged(of_table, sways), judged(|m| !of_table(m), sways)] {
        assert!(findings(&report, "tracker-sways").is_empty());
    }
}
