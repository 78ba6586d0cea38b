//! What the URDF alone says: which links move together, where chains end, and how far the robot reaches.

use calib_urdf::{JointId, JointKind, LinkId, RobotModel, doubt};

use crate::fact::About;

/// The link at the root side of all fixed joints above a link: links with the same one move together.
#[must_use]
pub fn group(model: &RobotModel, link: LinkId) -> LinkId {
    let mut at = link;
    while let Some(joint) = model.link(at).parent_joint {
        let joint = model.joint(joint);
        if joint.kind != JointKind::Fixed {
            break;
        }
        at = joint.parent;
    }
    at
}

/// One link of each rigid group, in the order of the file.
#[must_use]
pub fn groups(model: &RobotModel) -> Vec<LinkId> {
    let all = model.link_ids();
    all.filter(|link| group(model, *link) == *link).collect()
}

/// The joints that move on their own and carry a link, root first.
#[must_use]
pub fn movers(model: &RobotModel, link: LinkId) -> Vec<JointId> {
    let mut found = Vec::new();
    for joint in model.chain_to_root(link) {
        let source = model.joint(joint).law.source;
        if model.joint(source).kind != JointKind::Fixed && !found.contains(&source) {
            found.push(source);
        }
    }
    // The chain may come in either order.
    let depth = |joint: &JointId| model.chain_to_root(model.joint(*joint).child).len();
    found.sort_by_key(depth);
    found
}

/// Whether the limits of a joint and of those that follow it leave it no range; a joint that turns without end has one.
#[must_use]
pub fn has_no_range(model: &RobotModel, joint: JointId) -> bool {
    calib_urdf::range::range(model, joint).is_some_and(|(low, high)| high <= low)
}

/// The end of a chain: a link that moves and carries no other moving link.
#[derive(Debug, Clone, PartialEq)]
pub struct Tip {
    /// The link that the last joint moves.
    pub link: LinkId,
    /// The joints that carry it, root first.
    pub joints: Vec<JointId>,
}

/// Joints of an arm that carry a gripper, at the least: a fork behind fewer is one of wheels, or of arms.
const BEFORE_FINGERS: usize = 2;

/// The ends of the chains, the one with most joints first. Where a chain forks in its last joint the ends are fingers, and the link before the fork
/// stands for them.
#[must_use]
pub fn tips(model: &RobotModel) -> Vec<Tip> {
    let all = groups(model);
    let parent_group = |link: LinkId| {
        let joint = model.link(link).parent_joint?;
        Some(group(model, model.joint(joint).parent))
    };
    let is_end = |link: &LinkId| !all.iter().any(|other| parent_group(*other) == Some(*link));
    let ends = all.iter().filter(|link| is_end(link));
    let mut tips: Vec<Tip> = ends
        .map(|link| Tip {
            link: *link,
            joints: movers(model, *link),
        })
        .filter(|tip| !tip.joints.is_empty())
        .collect();
    let before = |tip: &Tip| tip.joints[..tip.joints.len() - 1].to_vec();
    let forks: Vec<Vec<JointId>> = tips.iter().map(before).collect();
    let is_finger = |joints: &Vec<JointId>| {
        let fork = &joints[..joints.len() - 1];
        fork.len() >= BEFORE_FINGERS && forks.iter().filter(|f| *f == fork).count() > 1
    };
    for tip in &mut tips {
        if is_finger(&tip.joints) {
            tip.joints.pop();
            let last = tip.joints.last().map(|j| model.joint(*j).child);
            tip.link = last.map_or(tip.link, |link| group(model, link));
        }
    }
    let mut known: Vec<LinkId> = Vec::new();
    tips.retain(|tip| {
        let new = !known.contains(&tip.link);
        known.push(tip.link);
        new
    });
    tips.sort_by_key(|tip| std::cmp::Reverse(tip.joints.len()));
    tips
}

/// Links rigidly connected with one, it first.
#[must_use]
pub fn links_of_group(model: &RobotModel, link: LinkId) -> Vec<LinkId> {
    let first = group(model, link);
    let all = model.link_ids();
    all.filter(|other| group(model, *other) == first).collect()
}

/// Names of joints.
#[must_use]
pub fn names<'m>(model: &'m RobotModel, joints: &[JointId]) -> Vec<&'m str> {
    let names = joints.iter().map(|j| model.joint(*j).name.as_str());
    names.collect()
}

/// What is said of the joints and their limits.
#[must_use]
pub fn joints(model: &RobotModel) -> About {
    let moving: Vec<JointId> = model.independent_joints().collect();
    let named = |wanted: &dyn Fn(&JointId) -> bool| -> Vec<String> {
        let of = moving.iter().copied().filter(wanted);
        let of: Vec<JointId> = of.collect();
        let names = names(model, &of).into_iter();
        names.map(str::to_owned).collect()
    };
    let reversed = |j: &JointId| calib_urdf::range::are_reversed(model, *j);
    let endless = |j: &JointId| matches!(model.joint(*j).kind, JointKind::Continuous { .. });
    let in_degrees = doubt::limits_in_degrees(model);
    About::Joints {
        moving: moving.len(),
        // A joint that turns without end says so.
        unlimited: named(&|j| {
            doubt::range(model.joint(*j)).is_none() && !endless(j) && !reversed(j)
        }),
        reversed: named(&reversed),
        endless: named(&endless),
        no_range: named(&|j| has_no_range(model, *j) && !reversed(j)),
        in_degrees: named(&|j| in_degrees.contains(j)),
    }
}

/// Names of the ends of all chains.
#[must_use]
pub fn ends(model: &RobotModel) -> Vec<String> {
    let tips = tips(model).into_iter();
    tips.map(|tip| model.link(tip.link).name.clone()).collect()
}
