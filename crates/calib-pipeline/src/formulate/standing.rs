//! A joint that moved although its readings stand: in a recording, or in some of its rows that follow each other.
//!
//! An error of this joint alone explains rows that a fit left out, and is another one from row to row. A body that slipped once on its link, or a joint that
//! stood elsewhere, is off by the same in all of them.

use std::collections::BTreeMap;
use std::ops::Range;

use calib_finding::{Fact, Finding, Severity, Subject, catalog};
use calib_urdf::{JointId, JointKind, RobotModel};

use crate::prepare::inputs::Loaded;

/// Places of a joint that are not the same one, rad and m: a degree, two millimeters.
const APART: (f64, f64) = (0.0175, 2e-3);
/// Places that a joint has moved to where it did not slip, or stand elsewhere, once.
const PLACES: usize = 3;
/// In sweeps of other joints a reading stands in some rows by itself, and backlash has two sides.
const PLACES_IN_ROWS: usize = 4;
/// Correlation with the reading of another joint from which on that joint moves this one.
const FOLLOWS: f64 = 0.98;

/// An error of one joint that explains a row best.
#[derive(Clone, Copy)]
pub(super) struct OneJoint {
    pub(super) joint: JointId,
    /// rad or m.
    pub(super) step: f64,
    /// Part of the row's squared error that it leaves.
    pub(super) left: f64,
}

/// The joint, and the rows that its motion explains.
pub(super) struct Standing {
    pub(super) joint: JointId,
    /// Its reading, rad or m.
    at: f64,
    /// From the first to the last of its places, rad or m.
    moved: f64,
    /// The rows that have this reading.
    pub(super) run: Range<usize>,
    pub(super) rows: Vec<usize>,
}

/// The joint whose errors explain most of these rows, where its readings stand and it moved.
pub(super) fn standing(
    model: &RobotModel,
    loaded: &Loaded,
    explained: &[(usize, OneJoint)],
) -> Option<Standing> {
    let mut by_joint: BTreeMap<JointId, Vec<(usize, f64)>> = BTreeMap::new();
    for (row, of) in explained {
        by_joint.entry(of.joint).or_default().push((*row, of.step));
    }
    let (joint, mut steps) = by_joint.into_iter().max_by_key(|(_, rows)| rows.len())?;
    let within = |run: &Range<usize>| {
        let before = |end: usize| steps.partition_point(|(row, _)| *row < end);
        before(run.end) - before(run.start)
    };
    let run = runs(loaded, joint).into_iter().max_by_key(within)?;
    steps.retain(|(row, _)| run.contains(row));
    if 2 * steps.len() < explained.len() {
        return None;
    }
    let at = loaded.q[run.start].as_ref()?[joint.index()];
    let apart = if turns(model, joint) {
        APART.0
    } else {
        APART.1
    };
    // The other rows are off by nothing.
    let mut places: Vec<f64> = steps.iter().map(|(_, step)| *step).chain([0.0]).collect();
    places.sort_by(f64::total_cmp);
    let count = 1 + places.windows(2).filter(|w| w[1] - w[0] > apart).count();
    let standing = Standing {
        joint,
        at,
        moved: places[places.len() - 1] - places[0],
        run,
        rows: steps.iter().map(|(row, _)| *row).collect(),
    };
    let places = match standing.is_in_rows(loaded) {
        true if standing.is_of_others(loaded, &steps) => return None,
        true => PLACES_IN_ROWS,
        false => PLACES,
    };
    (count >= places).then_some(standing)
}

/// Rows that follow each other with the same reading of a joint.
fn runs(loaded: &Loaded, joint: JointId) -> Vec<Range<usize>> {
    let reading = |row: usize| Some(loaded.q[row].as_ref()?[joint.index()]);
    let mut runs: Vec<Range<usize>> = Vec::new();
    for row in (0..loaded.q.len()).filter(|row| loaded.q[*row].is_some()) {
        match runs.last_mut() {
            Some(run) if reading(run.start) == reading(row) => run.end = row + 1,
            _ => runs.push(row..row + 1),
        }
    }
    runs
}

impl Standing {
    /// Whether something else explains rows within a recording: most of those between the first and the last are right, or the joint follows another one.
    fn is_of_others(&self, loaded: &Loaded, steps: &[(usize, f64)]) -> bool {
        let (Some(first), Some(last)) = (self.rows.first(), self.rows.last()) else {
            return true;
        };
        let follows = |other: usize| {
            let pairs = steps
                .iter()
                .filter_map(|(row, step)| Some((loaded.q[*row].as_ref()?[other], *step)));
            correlation(&pairs.collect::<Vec<_>>()).abs() > FOLLOWS
        };
        let joints = loaded.q[self.run.start].as_ref().map_or(0, Vec::len);
        2 * self.rows.len() <= last - first + 1 || (0..joints).any(follows)
    }

    /// Whether the reading is another one in other rows.
    pub(super) fn is_in_rows(&self, loaded: &Loaded) -> bool {
        let mut others = loaded.q.iter().flatten();
        others.any(|q| q[self.joint.index()] != self.at)
    }

    pub(super) fn finding(&self, model: &RobotModel, body: &str, loaded: &Loaded) -> Finding {
        let size = match turns(model, self.joint) {
            true => Fact::radians,
            false => Fact::meters,
        };
        let (kind, of) = match self.is_in_rows(loaded) {
            true => ("although_in_rows", self.run.len()),
            false => ("although", loaded.q.len()),
        };
        let rows = self.rows.iter();
        let subject = Subject::joint(&model.joint(self.joint).name).in_recording(&loaded.name);
        // Most of a recording is no longer there.
        let severity = match 2 * of > loaded.q.len() {
            true => Severity::Error,
            false => Severity::Warning,
        };
        Finding::of_kind(catalog::JOINT_NEVER_MOVED, kind, subject)
            .with_severity(severity)
            .with("at", size(self.at))
            .with("count", Fact::count(self.rows.len()))
            .with("of", Fact::count(of))
            .with("body", Fact::name(body))
            .with("moved", size(self.moved))
            .at_rows(rows.map(|row| loaded.poses.rows[*row]))
    }
}

/// Correlation coefficient; 0 where one of the two does not vary.
fn correlation(pairs: &[(f64, f64)]) -> f64 {
    let n = pairs.len() as f64;
    let (x, y) = pairs
        .iter()
        .fold((0.0, 0.0), |(x, y), p| (x + p.0 / n, y + p.1 / n));
    let mut sums = [0.0; 3];
    for (a, b) in pairs.iter().map(|p| (p.0 - x, p.1 - y)) {
        sums[0] += a * a;
        sums[1] += b * b;
        sums[2] += a * b;
    }
    let size = (sums[0] * sums[1]).sqrt();
    if size > 0.0 { sums[2] / size } else { 0.0 }
}

fn turns(model: &RobotModel, joint: JointId) -> bool {
    !matches!(model.joint(joint).kind, JointKind::Prismatic { .. })
}
