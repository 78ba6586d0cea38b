//! What makes a URDF doubtful as a whole: units that its numbers speak against.

use crate::{Joint, JointId, JointKind, RobotModel};

/// Largest reach of a robot whose lengths are believed to be in meters, m: those of cranes and cable robots are below.
pub const LARGEST: f64 = 100.0;
/// Largest limit of a turning joint that is believed to be in radians: two turns, and a bit for makers that round up.
const TURNS: f64 = 13.0;
/// Limits above this stand for none, rad: exporters write 1e3, 1e9, 1e16 or the largest number.
const NO_LIMIT: f64 = 1e3;

/// Longest distance of a link from the root, m: an upper bound, over all positions of the joints.
#[must_use]
pub fn reach(model: &RobotModel) -> f64 {
    let length = |joint: &JointId| {
        let joint = model.joint(*joint);
        let slide = match joint.kind {
            JointKind::Prismatic { .. } => joint.limits.range(),
            _ => None,
        };
        let slide = slide.map_or(0.0, |(low, high)| low.abs().max(high.abs()));
        joint.parent_link_from_joint.translation.vector.norm() + slide
    };
    let of_link = |link| model.chain_to_root(link).iter().map(length).sum::<f64>();
    model.link_ids().map(of_link).fold(0.0, f64::max)
}

/// Limits of a joint, rad or m; `None` where there are none, or numbers that stand for none.
#[must_use]
pub fn range(joint: &Joint) -> Option<(f64, f64)> {
    let range = joint.limits.range()?;
    let stands_for_none = range.0.abs().max(range.1.abs()) >= NO_LIMIT;
    (!stands_for_none).then_some(range)
}

/// Turning joints whose limits are probably in degrees: all limited ones of a robot where one of them turns more often than cables allow.
#[must_use]
pub fn limits_in_degrees(model: &RobotModel) -> Vec<JointId> {
    let largest = |joint: &JointId| {
        let joint = model.joint(*joint);
        let turns = matches!(joint.kind, JointKind::Revolute { .. });
        let (low, high) = range(joint).filter(|_| turns)?;
        Some(low.abs().max(high.abs())).filter(|most| *most > 0.0)
    };
    let joints: Vec<JointId> = model.independent_joints().collect();
    let joints: Vec<JointId> = joints
        .into_iter()
        .filter(|j| largest(j).is_some())
        .collect();
    let doubtful: Vec<JointId> = joints
        .iter()
        .copied()
        .filter(|j| largest(j).is_some_and(|l| l > TURNS))
        .collect();
    // A small limit in degrees looks like one in radians, so its neighbors decide.
    if 2 * doubtful.len() >= joints.len() {
        return match doubtful.is_empty() {
            true => Vec::new(),
            false => joints,
        };
    }
    doubtful
}
