//! A joint that moved although all its readings in a recording are the same.
//!
//! An error of this joint alone explains rows that a fit left out, and is another one from row to row. A body that slipped once on its link, or a joint that
//! stood elsewhere, is off by the same in all of them.

use std::collections::BTreeMap;

use calib_finding::{Fact, Finding, Subject, catalog};
use calib_urdf::{JointId, JointKind, RobotModel};

use crate::prepare::inputs::Loaded;

/// Places of a joint that are not the same one, rad and m: a degree, two millimeters.
const APART: (f64, f64) = (0.0175, 2e-3);
/// Places that a joint has moved to where it did not slip, or stand elsewhere, once.
const PLACES: usize = 3;

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
    joint: JointId,
    /// Its reading in all rows, rad or m.
    at: f64,
    /// From the first to the last of its places, rad or m.
    moved: f64,
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
    let (joint, steps) = by_joint.into_iter().max_by_key(|(_, rows)| rows.len())?;
    let mut readings = loaded.q.iter().flatten().map(|q| q[joint.index()]);
    let at = readings.next()?;
    if 2 * steps.len() < explained.len() || !readings.all(|reading| reading == at) {
        return None;
    }
    let apart = if turns(model, joint) {
        APART.0
    } else {
        APART.1
    };
    // The other rows are off by nothing.
    let mut places: Vec<f64> = steps.iter().map(|(_, step)| *step).chain([0.0]).collect();
    places.sort_by(f64::total_cmp);
    let count = 1 + places.windows(2).filter(|w| w[1] - w[0] > apart).count();
    (count >= PLACES).then(|| Standing {
        joint,
        at,
        moved: places[places.len() - 1] - places[0],
        rows: steps.iter().map(|(row, _)| *row).collect(),
    })
}

impl Standing {
    pub(super) fn finding(&self, model: &RobotModel, body: &str, loaded: &Loaded) -> Finding {
        let size = match turns(model, self.joint) {
            true => Fact::radians,
            false => Fact::meters,
        };
        let rows = self.rows.iter();
        let subject = Subject::joint(&model.joint(self.joint).name).in_recording(&loaded.name);
        Finding::of_kind(catalog::JOINT_NEVER_MOVED, "although", subject)
            .with("at", size(self.at))
            .with("count", Fact::count(self.rows.len()))
            .with("of", Fact::count(loaded.q.len()))
            .with("body", Fact::name(body))
            .with("moved", size(self.moved))
            .at_rows(rows.map(|row| loaded.poses.rows[*row]))
    }
}

fn turns(model: &RobotModel, joint: JointId) -> bool {
    !matches!(model.joint(joint).kind, JointKind::Prismatic { .. })
}
