//! A tracker or a stand that does not stand still, seen by the body on the robot's table.

use std::collections::BTreeMap;

use crate::scratch;

use nalgebra::Vector3;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use scratch::{Scratch, root};
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

/// Displacement of a marker by its name, its place and the middle of the markers that joints move, m.
type Displacement = dyn Fn(&str, &Vector3<f64>, &Vector3<f64>) -> Vector3<f64>;
type Places = BTreeMap<String, Vector3<f64>>;

/// A table with every marker displaced, m, by what `displacement` says of its name, its place and the middle of the markers that joints move.
fn displaced(text: &str, displacement: &Displacement) -> String {
    const AXES: [&str; 3] = ["x_m", "y_m", "z_m"];
    let mut header: Vec<&str> = Vec::new();
    let mut out = String::new();
    for line in text.lines() {
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        if line.starts_with('#') || header.is_empty() {
            if !line.starts_with('#') {
                header = line.split(',').collect();
            }
            out += &format!("{line}\n");
            continue;
        }
        let coordinate = |column: &str| {
            let (marker, axis) = column.split_once('.')?;
            Some((marker.to_owned(), AXES.iter().position(|a| *a == axis)?))
        };
        let mut places = Places::new();
        for (column, cell) in header.iter().zip(&cells) {
            if let (Some((marker, axis)), Ok(at)) = (coordinate(column), cell.parse::<f64>()) {
                places.entry(marker).or_default()[axis] = at;
            }
        }
        let arm = places.iter().filter(|(name, _)| !name.starts_with("table"));
        let arm: Vec<&Vector3<f64>> = arm.map(|(_, place)| place).collect();
        let middle = arm.iter().copied().sum::<Vector3<f64>>() / arm.len().max(1) as f64;
        for (column, cell) in header.iter().zip(&mut cells) {
            let Some((marker, axis)) = coordinate(column) else {
                continue;
            };
            if let Some(place) = places.get(&marker).filter(|_| !cell.is_empty()) {
                let moved = place + displacement(&marker, place, &middle);
                *cell = format!("{:.6}", moved[axis]);
            }
        }
        out += &format!("{}\n", cells.join(","));
    }
    out
}

/// The report of the shipped robot with all tables displaced.
fn judged_displaced(displacement: &Displacement) -> Value {
    let mut dir = Scratch::new().brief("ripley");
    for file in FILES {
        let text = std::fs::read_to_string(root().join(file)).expect("shipped");
        dir = dir.file(file, displaced(&text, displacement));
    }
    let ran = dir.calib(["run", PROFILE, "--out", "out"]);
    assert!(ran.code != 3, "{}", ran.stderr);
    dir.json("out/report.json")
}

/// The table leans with the arm: its body says so, and no effect of a joint is named in its place. Without the lean nothing is said.
#[test]
fn a_base_that_yields_under_the_arm_is_named() {
    let lean = |_: &str, _: &Vector3<f64>, arm: &Vector3<f64>| {
        Vector3::new(1e-3 * arm.x, 1e-3 * arm.y, 0.0)
    };
    let report = judged_displaced(&lean);
    let named = findings(&report, "base-moves");
    let [one] = named[..] else {
        panic!("{:#}", report["findings"]);
    };
    let facts = &one["facts"];
    assert_eq!(facts["body"], "table");
    assert!(facts["share"]["value"].as_f64() > Some(0.2), "{facts}");
    let motion = facts["motion"]["value"].as_f64().expect("m");
    assert!((1e-4..1e-3).contains(&motion), "{motion}");
    assert!(findings(&report, "missing-physics").is_empty());
    assert_ne!(report["verdict"], "accepted");
    let still = |_: &str, _: &Vector3<f64>, _: &Vector3<f64>| Vector3::zeros();
    let report = judged_displaced(&still);
    for id in ["base-moves", "errors-follow-place"] {
        assert!(findings(&report, id).is_empty(), "{id}");
    }
}

/// A tracker that distorts its volume: the markers are displaced by a quadratic function of where they are.
#[test]
fn a_tracker_that_distorts_its_volume_is_named() {
    let bend = |_: &str, p: &Vector3<f64>, _: &Vector3<f64>| {
        let d = p - Vector3::new(0.0, 0.0, 1.3);
        6e-3 * Vector3::new(d.y * d.z, d.x * d.x - d.z * d.z, d.x * d.y + d.z * d.z)
    };
    let report = judged_displaced(&bend);
    let named = findings(&report, "errors-follow-place");
    assert_eq!(named.len(), 1, "{:#}", report["findings"]);
    assert_ne!(report["verdict"], "accepted");
}
