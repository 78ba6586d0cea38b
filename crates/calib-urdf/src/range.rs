//! Where the joints that move on their own may stand: within their limits and within those of the joints that follow them.

use crate::{Joint, JointId, JointKind, MimicLaw, Problem, RobotModel, doubt};

/// Range of a joint that moves on its own, rad or m: its limits, narrowed by those of all joints that follow it. `None`: nothing limits it.
/// Where the limits leave nothing, the lower end is not below the upper one; so where they are exchanged, since nobody knows which are meant.
#[must_use]
pub fn range(model: &RobotModel, joint: JointId) -> Option<(f64, f64)> {
    match are_reversed(model, joint) {
        true => Some((0.0, 0.0)),
        false => narrowed(model, joint, limits(model.joint(joint))),
    }
}

/// Whether the lower limit of a joint is written above the upper one.
#[must_use]
pub fn are_reversed(model: &RobotModel, joint: JointId) -> bool {
    let name = &model.joint(joint).name;
    model.warnings().iter().any(
        |found| matches!(&found.problem, Problem::LimitsReversed { joint, .. } if joint == name),
    )
}

/// A range of a joint that moves on its own, narrowed by the limits of all joints that follow it.
#[must_use]
pub fn narrowed(
    model: &RobotModel,
    joint: JointId,
    range: Option<(f64, f64)>,
) -> Option<(f64, f64)> {
    let all = followers(model, joint).filter_map(|f| of_source(&f.law, limits(f)?));
    all.fold(range, |range, (low, high)| match range {
        Some((a, b)) => Some((low.max(a), high.min(b))),
        None => Some((low, high)),
    })
}

/// The joints that follow a joint.
pub fn followers(model: &RobotModel, joint: JointId) -> impl Iterator<Item = &Joint> {
    let all = model.joint_ids().filter(move |id| *id != joint);
    all.map(|id| model.joint(id))
        .filter(move |j| j.law.source == joint)
}

/// Where joints stand that nothing moves, rad or m by joint index: at the position nearest to 0 that their range allows.
#[must_use]
pub fn resting_positions(model: &RobotModel) -> Vec<f64> {
    let mut q = model.zero_positions();
    let doubtful = doubt::limits_in_degrees(model);
    for id in model.independent_joints().filter(|j| !doubtful.contains(j)) {
        q[id.index()] = match range(model, id) {
            Some((low, high)) if low <= high => 0.0_f64.clamp(low, high),
            Some((low, _)) => low,
            None => 0.0,
        };
    }
    q
}

fn limits(joint: &Joint) -> Option<(f64, f64)> {
    let endless = matches!(joint.kind, JointKind::Continuous { .. });
    doubt::range(joint).filter(|_| !endless)
}

/// Limits of a follower as those of the joint that it follows: `q_source = (q − offset)/multiplier`.
fn of_source(law: &MimicLaw, (low, high): (f64, f64)) -> Option<(f64, f64)> {
    if law.multiplier == 0.0 {
        return None;
    }
    let ends = [low, high].map(|q| (q - law.offset) / law.multiplier);
    // A negative multiplier exchanges the ends.
    Some(if law.multiplier > 0.0 {
        (ends[0], ends[1])
    } else {
        (ends[1], ends[0])
    })
}
