//! Joints without a column, and where they are taken to stand.

use std::collections::BTreeMap;

use calib_recording::Poses;
use calib_urdf::range::{range, resting_positions};
use calib_urdf::{JointId, RobotModel};

use crate::fact::{About, Fact, Place};
use crate::proposal::Proposal;
use crate::robot;

/// Joints that carry a body and have no column are held where a profile that is edited holds them (`held`), else at 0 or at the end of their range
/// that is nearest to it, and said.
#[must_use]
pub fn missing(
    model: &RobotModel,
    proposal: &mut Proposal,
    tables: &[Poses],
    held: &BTreeMap<JointId, f64>,
) -> Vec<Fact> {
    let mut facts = Vec::new();
    let carriers = proposal
        .bodies
        .iter()
        .flat_map(|body| robot::movers(model, body.link));
    let mut carriers: Vec<JointId> = carriers.collect();
    carriers.sort_unstable();
    carriers.dedup();
    let resting = at_rest(model);
    for (recording, poses) in proposal.recordings.iter_mut().zip(tables) {
        let without = carriers
            .iter()
            .filter(|j| !poses.joints.contains_key(&model.joint(**j).name));
        let without: Vec<JointId> = without.copied().collect();
        let place = || Place::Recording(recording.name.clone());
        let at = |joint: &JointId| held.get(joint).copied().unwrap_or(resting[joint.index()]);
        let (at_zero, elsewhere): (Vec<JointId>, Vec<JointId>) = without
            .iter()
            .partition(|j| !held.contains_key(j) && resting[j.index()] == 0.0);
        if !at_zero.is_empty() {
            let joints = robot::names(model, &at_zero)
                .iter()
                .map(|n| (*n).to_owned())
                .collect();
            facts.push(Fact::new(place(), About::JointsMissing { joints }));
        }
        for &joint in &elsewhere {
            let of = model.joint(joint);
            let at = at(&joint);
            let is_held = held.contains_key(&joint);
            let (joint, turns) = (of.name.clone(), of.kind.turns());
            let about = match is_held {
                true => About::HeldAsElsewhere { joint, at, turns },
                false => About::JointAtItsLimit { joint, at, turns },
            };
            facts.push(Fact::new(place(), about));
        }
        recording.hold = without.iter().map(|j| (*j, at(j))).collect();
    }
    facts
}

/// Where joints stand that nothing moves, as a profile states it: to a tenth of a degree or millimeter, within their limits.
fn at_rest(model: &RobotModel) -> Vec<f64> {
    let mut q = resting_positions(model);
    for id in model.independent_joints() {
        let unit = if model.joint(id).kind.turns() {
            0.1_f64.to_radians()
        } else {
            1e-4
        };
        // Away from 0, which is beyond the limit.
        let steps = q[id.index()] / unit;
        let rounded = steps.abs().ceil().copysign(steps) * unit;
        let within = range(model, id).is_none_or(|(low, high)| (low..=high).contains(&rounded));
        if steps != 0.0 && within {
            q[id.index()] = rounded;
        }
    }
    q
}
