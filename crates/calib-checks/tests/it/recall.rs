//! How many injected faults are found, and how many clean recordings are called faulty: the table of the book.

use crate::checks::{Recorded, faults, forward, record, recorded_q};
use crate::flips::FLIPPED;
use calib_checks::model::{spoiled_rows, up_axis};
use calib_checks::{checks, held_out_in_training, other_scales};
use calib_finding::Id;
use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::Path;

/// Recordings of each fault.
const SEEDS: u64 = 100;
/// Clean recordings.
const CLEAN: u64 = 400;

/// Ids of the rows that the checks with the robot's model find in a recording whose joint values are `q`.
fn model_findings(recorded: &Recorded, q: &[[f64; 3]]) -> Vec<&'static str> {
    let track = &recorded.poses.bodies["tool"];
    let predicted: Vec<_> = q.iter().map(|&q| forward(q)).collect();
    let rows = spoiled_rows(track, &predicted).rows;
    let id = |off: f64| {
        if off > FLIPPED {
            "body-flip"
        } else {
            "unsettled-rows"
        }
    };
    rows.iter().map(|row| id(row.off)).collect()
}

/// A fault that the robot's model shows: makes it, and tells what is found.
type ModelFault = fn(u64) -> Vec<&'static str>;

fn model_faults() -> Vec<(&'static str, &'static str, ModelFault)> {
    vec![
        ("unsettled-rows", "5 of 36 rows read while moving", |seed| {
            let recorded = record(seed, false);
            let mut rng = ChaCha8Rng::seed_from_u64(500 + seed);
            let mut q = recorded.q.clone();
            for k in 0..5 {
                let i = 7 * k + rng.random_range(0..7);
                q[i] = [q[i][0] + 0.3, q[i][1] - 0.25, q[i][2] + 0.35];
            }
            model_findings(&recorded, &q)
        }),
        ("body-flip", "half a turn in 3 of 36 rows", |seed| {
            let mut recorded = record(seed, false);
            let mut rng = ChaCha8Rng::seed_from_u64(600 + seed);
            let half = UnitQuaternion::from_scaled_axis(Vector3::y() * std::f64::consts::PI);
            let track = recorded.poses.bodies.get_mut("tool").expect("recorded");
            for k in 0..3 {
                let pose = &mut track[12 * k + rng.random_range(0..12)];
                pose.as_mut().expect("tracked").rotation *= half;
            }
            let q = recorded_q(&recorded.poses);
            model_findings(&recorded, &q)
        }),
        ("up-axis", "a Y-up export taken for Z-up", |seed| {
            let yaw = Isometry3::rotation(Vector3::z() * (0.1 * seed as f64));
            let y_up = Isometry3::rotation(Vector3::x() * -std::f64::consts::FRAC_PI_2) * yaw;
            up_axis("+Z", &y_up, 0.2)
                .into_iter()
                .map(|f| f.id.as_str())
                .collect()
        }),
        (
            "tracker-scale",
            "a recording whose lengths are 1 % longer",
            |seed| {
                let usual = record(seed, false);
                let mut longer = record(seed + 5000, false).poses;
                let seen = longer.markers.values_mut().flatten().flatten();
                seen.for_each(|point| point.coords *= 1.01);
                other_scales_ids(&usual, &longer)
            },
        ),
        (
            "held-out-in-training",
            "a validation row from the fit",
            |seed| {
                let training = record(seed, false).poses;
                let mut validation = record(seed + 5000, false).poses;
                shift(&mut validation);
                let i = (seed % 36) as usize;
                let stolen = training.select(&[i]);
                for (name, q) in &stolen.joints {
                    validation.joints.get_mut(name).expect("recorded")[i] = q[0];
                }
                for (name, track) in &stolen.markers {
                    validation.markers.get_mut(name).expect("recorded")[i] = track[0];
                }
                for (name, track) in &stolen.bodies {
                    validation.bodies.get_mut(name).expect("recorded")[i] = track[0];
                }
                let found = held_out_in_training(&validation, &training);
                found.into_iter().map(|f| f.id.as_str()).collect()
            },
        ),
    ]
}

fn other_scales_ids(recorded: &Recorded, other: &calib_recording::Poses) -> Vec<&'static str> {
    let recordings = [("usual", &recorded.poses), ("other", other)];
    let found = other_scales(&recordings, &recorded.expected);
    found.into_iter().map(|f| f.id.as_str()).collect()
}

/// Other poses of the same robot.
fn shift(poses: &mut calib_recording::Poses) {
    let all = poses.joints.values_mut().flatten().flatten();
    all.for_each(|q| *q += 0.05);
}

/// Clean recordings in which anything is found, checks with and without the model together.
fn false_alarms() -> Vec<String> {
    let mut alarms = Vec::new();
    for seed in 0..CLEAN {
        let recorded = record(1000 + seed, seed % 4 == 0);
        let mut ids: Vec<&str> = checks(&recorded.poses, &recorded.expected)
            .iter()
            .map(|finding| finding.id.as_str())
            .collect();
        let q = recorded_q(&recorded.poses);
        ids.extend(model_findings(&recorded, &q));
        let upright = Isometry3::rotation(Vector3::z() * (0.1 * seed as f64));
        ids.extend(up_axis("+Z", &upright, 0.2).map(|f| f.id.as_str()));
        let mut other = record(9000 + seed, false).poses;
        shift(&mut other);
        ids.extend(other_scales_ids(&recorded, &other));
        ids.extend(held_out_in_training(&other, &recorded.poses).map(|f| f.id.as_str()));
        if !ids.is_empty() {
            alarms.push(format!("{seed}: {ids:?}"));
        }
    }
    alarms
}

/// Ids that the sources of this crate make findings of.
fn ids_of_the_checks() -> BTreeSet<&'static str> {
    let mut folders = vec![Path::new(env!("CARGO_MANIFEST_DIR")).join("src")];
    let mut ids = BTreeSet::new();
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).expect("a folder of sources") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                folders.push(path);
                continue;
            }
            let source = std::fs::read_to_string(path).expect("a source");
            for name in source.split("catalog::").skip(1) {
                let letters = |c: char| c.is_ascii_uppercase() || c == '_';
                let name: String = name.chars().take_while(|&c| letters(c)).collect();
                let id = Id::parse(&name.to_lowercase().replace('_', "-"));
                ids.extend(id.map(Id::as_str));
            }
        }
    }
    ids
}

/// Found share in percent, rounded down to tenths: 99.96 % is not 100 %.
fn percent(found: u64, of: u64) -> f64 {
    (1000.0 * found as f64 / of as f64).floor() / 10.0
}

#[test]
fn every_fault_is_found() {
    let mut rows: Vec<(&str, &str, u64)> = Vec::new();
    for (id, what, timed, inject) in faults() {
        let found = |seed: &u64| {
            let mut recorded = record(*seed, timed);
            inject(&mut recorded, &mut ChaCha8Rng::seed_from_u64(9000 + seed));
            let findings = checks(&recorded.poses, &recorded.expected);
            findings.iter().any(|finding| finding.id.as_str() == id)
        };
        rows.push((id, what, (0..SEEDS).filter(found).count() as u64));
    }
    for (id, what, findings) in model_faults() {
        let found = (0..SEEDS).filter(|&seed| findings(seed).contains(&id));
        rows.push((id, what, found.count() as u64));
    }
    let alarms = false_alarms();

    // Every finding of the checks has a row; the clocks have a test of their own.
    let listed: BTreeSet<&str> = rows.iter().map(|(id, _, _)| *id).collect();
    let mut ids = ids_of_the_checks();
    assert!(ids.remove("clock-lag"));
    assert_eq!(listed, ids);

    let mut page = String::from(HEAD);
    for (id, what, found) in &rows {
        let _ = writeln!(
            page,
            "| [`{id}`](../findings.md#{id}) | {what} | {:.1} % |",
            percent(*found, SEEDS)
        );
    }
    let _ = write!(
        page,
        "\nClean recordings in which any of these checks found anything: {} of {CLEAN} ({:.1} %).\n",
        alarms.len(),
        100.0 * alarms.len() as f64 / CLEAN as f64
    );
    println!("{page}");
    let missed: Vec<_> = rows
        .iter()
        .filter(|(_, _, found)| percent(*found, SEEDS) < 99.0)
        .collect();
    assert!(missed.is_empty(), "{missed:?}");
    assert!(alarms.len() as u64 * 100 <= CLEAN, "{alarms:#?}");

    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../book/src/reference/recall.md");
    if std::env::var_os("UPDATE_BOOK").is_some() {
        std::fs::write(&path, &page).expect("the page is written");
    }
    let book = std::fs::read_to_string(&path).expect("the book's page");
    assert!(
        book == page,
        "book/src/reference/recall.md is not the table above: UPDATE_BOOK=1 writes it"
    );
}

const HEAD: &str = "# Recall of the data checks

Made by `cargo test -p calib-checks --test it every_fault -- --nocapture`, which fails when a class is found in less than
99 % of the recordings, when more than 1 % of clean recordings raise anything, or when this page differs from its table.

Each row is one fault, injected into 100 simulated recordings of an arm with three joints: 36 static poses, or 300 samples at
100 Hz where the fault is about time; four markers on the hand, three on the table, a 6-DoF body, σ = 0.1 mm. Where the fault
strikes (row, direction, mount, placement of the robot) is drawn again for each. Found means: the finding of this id is there.
The size of the fault is part of the row. A smaller one may go unseen, and that is not shown here.

| finding | fault | found |
|---|---|---|
";
