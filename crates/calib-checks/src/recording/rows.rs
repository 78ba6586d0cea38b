//! Rows that stand in a table twice, or in two tables.

use calib_finding::{Fact, Finding, Subject, catalog};
use calib_recording::Poses;
use std::collections::{BTreeMap, BTreeSet};
use std::hash::{DefaultHasher, Hash, Hasher};

/// Repeated rows that make a finding: one or two may come from a robot that stood still on a coarse grid of numbers.
const REPEATED: usize = 3;

/// Rows of a recording that agree in every joint and every tracked coordinate, to the last digit, with earlier ones.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Copied {
    /// Which of the recordings.
    pub recording: usize,
    /// The rows, from 0.
    pub rows: Vec<usize>,
    /// The recordings that they are copies of.
    pub of: BTreeSet<usize>,
}

/// Rows that are not neighbors and agree in everything: a table that was pasted or listed twice. Measured twice they would differ by noise.
#[must_use]
pub fn copied_rows(all: &[&Poses]) -> Vec<Copied> {
    // Recording and row by the hash of the row: the values themselves would be held twice.
    let mut first: BTreeMap<u64, Vec<(usize, usize)>> = BTreeMap::new();
    let mut found = Vec::new();
    for (recording, poses) in all.iter().enumerate() {
        let (mut rows, mut of) = (Vec::new(), BTreeSet::new());
        for row in 0..poses.len() {
            let Some(key) = digits(poses, row) else {
                continue;
            };
            let mut hasher = DefaultHasher::new();
            key.hash(&mut hasher);
            let same = first.entry(hasher.finish()).or_default();
            let is_equal = |at: &(usize, usize)| digits(all[at.0], at.1).as_ref() == Some(&key);
            match same.iter_mut().find(|at| is_equal(at)) {
                // A run of equal rows is a tracker that froze, which another check names.
                Some(last) if last.0 == recording && last.1 + 1 == row => last.1 = row,
                Some(earlier) => {
                    rows.push(row);
                    of.insert(earlier.0);
                }
                None => same.push((recording, row)),
            }
        }
        if rows.len() >= REPEATED {
            found.push(Copied {
                recording,
                rows,
                of,
            });
        }
    }
    found
}

/// What is said of rows that are copies of others of their own recording, or of `others`; `used`: they take part all the same.
#[must_use]
pub fn repeated_rows(poses: &Poses, rows: &[usize], others: &[&str], used: bool) -> Finding {
    let kind = match (others.is_empty(), used) {
        (true, _) => "within",
        (false, false) => "recordings",
        (false, true) => "origins",
    };
    Finding::of_kind(catalog::ROWS_REPEATED, kind, Subject::default())
        .with("repeated", Fact::count(rows.len()))
        .with("rows", Fact::count(poses.len()))
        .with_some(
            "of",
            (!others.is_empty()).then(|| Fact::names(others.iter().copied())),
        )
        .at_rows(rows.iter().map(|row| poses.rows[*row]))
}

/// Rows of one table that repeat earlier ones.
pub(super) fn repeated(poses: &Poses) -> Option<Finding> {
    let found = copied_rows(&[poses]);
    found
        .first()
        .map(|copied| repeated_rows(poses, &copied.rows, &[], false))
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
