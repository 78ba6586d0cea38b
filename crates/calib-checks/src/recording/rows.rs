//! Rows that stand in a table twice.

use calib_finding::{Fact, Finding, Subject, catalog};
use calib_recording::Poses;
use std::collections::BTreeMap;

/// Repeated rows that make a finding: one or two may come from a robot that stood still on a coarse grid of numbers.
const REPEATED: usize = 3;

/// Rows that are not neighbors and agree in every joint and every tracked coordinate, to the last digit: a table that
/// was pasted twice. Measured twice they would differ by noise.
pub(super) fn repeated(poses: &Poses) -> Option<Finding> {
    let mut first: BTreeMap<Vec<u64>, usize> = BTreeMap::new();
    let mut rows = Vec::new();
    for row in 0..poses.len() {
        let Some(key) = digits(poses, row) else {
            continue;
        };
        match first.get_mut(&key) {
            // A run of equal rows is a tracker that froze, which another check names.
            Some(last) if *last + 1 == row => *last = row,
            Some(_) => rows.push(poses.rows[row]),
            None => drop(first.insert(key, row)),
        }
    }
    (rows.len() >= REPEATED).then(|| {
        Finding::new(catalog::ROWS_REPEATED, Subject::default())
            .with("repeated", Fact::count(rows.len()))
            .with("rows", Fact::count(poses.len()))
            .at_rows(rows)
    })
}

/// All values of a row, bit by bit; `None` where nothing was tracked.
fn digits(poses: &Poses, row: usize) -> Option<Vec<u64>> {
    /// Stands for a lost sample: no measurement has these bits.
    const LOST: u64 = u64::MAX;
    let bits = |value: Option<f64>| value.map_or(LOST, f64::to_bits);
    let markers = poses.markers.values().flat_map(|track| {
        let point = track[row];
        (0..3).map(move |axis| bits(point.map(|p| p[axis])))
    });
    let bodies = poses.bodies.values().flat_map(|track| {
        let place = track[row].map(|pose| pose.translation.vector);
        (0..3).map(move |axis| bits(place.map(|p| p[axis])))
    });
    let tracked: Vec<u64> = markers.chain(bodies).collect();
    if tracked.iter().all(|&bits| bits == LOST) {
        return None;
    }
    let joints = poses.joints.values().map(|q| bits(q[row]));
    Some(joints.chain(tracked).collect())
}
