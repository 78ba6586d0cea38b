//! Limbs whose places relative to each other the profile leaves open: two arms on stands of a cell, a turntable beside an arm. Hypotheses about
//! readings are asked of the robot with each of them where its own bodies see it, so that a stand that is 300 mm from its drawing is no mistake.

use std::collections::{BTreeMap, BTreeSet};

use calib_profile::OriginFreeSet;
use calib_urdf::{JointId, RobotModel};
use nalgebra::Isometry3;

use crate::estimate::start::registered;
use crate::prepare::inputs::Inputs;
use crate::prepare::tracks::BodyTrack;

/// A place is taken over from the bodies within this many σ of its prior, and beyond one σ of what is usual.
const MOST: f64 = 4.0;
/// A joint that turned by less did not move, rad or m.
const MOVED: f64 = 0.035;
/// Joints that move the bodies of a limb, at least: with fewer its place is not seen.
const JOINTS: usize = 2;

/// The robot with every limb whose place is free where its bodies see it; `None` where none is elsewhere than in the drawing.
pub(super) fn placed(inputs: &Inputs, tracks: &BTreeMap<String, BodyTrack>) -> Option<RobotModel> {
    let model = &inputs.robot.model;
    let open: BTreeSet<JointId> = model.joint_ids().filter(|j| is_open(inputs, *j)).collect();
    if open.is_empty() {
        return None;
    }
    // By the first of these joints above a body; the others first.
    let mut limbs: BTreeMap<Option<JointId>, BTreeSet<&str>> = BTreeMap::new();
    for (name, body) in &inputs.robot.profile.bodies {
        let above = model.chain_to_root(body.link).into_iter();
        let first = above.rev().find(|joint| open.contains(joint));
        limbs.entry(first).or_default().insert(name);
    }
    let seen = limbs.into_iter().filter_map(|(joint, bodies)| {
        let place = registered(inputs, tracks, &bodies).filter(|_| moves(inputs, &bodies))?;
        Some((joint, place))
    });
    let seen: Vec<(Option<JointId>, Isometry3<f64>)> = seen.collect();
    let (_, first) = seen.first()?;
    let mut out = None;
    for (joint, place) in &seen[1..] {
        let Some(joint) = *joint else { continue };
        let root_from_parent =
            model.root_from_link(&model.zero_positions(), model.joint(joint).parent);
        let nominal = model.joint(joint).parent_link_from_joint;
        let own =
            root_from_parent.inverse() * (first.inverse() * place) * root_from_parent * nominal;
        if takes(inputs, joint, &(nominal.inverse() * own)) {
            let before = out.unwrap_or_else(|| model.clone());
            out = Some(before.with_origin(joint, own));
        }
    }
    out
}

/// A joint that stands still, at the end of such joints from the root, whose place is free.
fn is_open(inputs: &Inputs, joint: JointId) -> bool {
    let model = &inputs.robot.model;
    let of = model.joint(joint);
    let stands = |joint: &JointId| model.joint(*joint).kind.axis().is_none();
    let free = inputs
        .robot
        .profile
        .solve
        .free_set(joint, true, false)
        .origin;
    free == OriginFreeSet::Full
        && stands(&joint)
        && model.chain_to_root(of.parent).iter().all(stands)
}

/// Whether the prior of a joint allows the change, and errors of a drawing as they are usual do not make it.
fn takes(inputs: &Inputs, joint: JointId, change: &Isometry3<f64>) -> bool {
    let solve = &inputs.robot.profile.solve;
    let own = solve.joints.get(&joint);
    let (length, angle) = (solve.prior.position, solve.prior.angle);
    let sigma = own.and_then(|own| own.sigma_m).unwrap_or(length);
    let sigma_rad = own.and_then(|own| own.sigma_rad).unwrap_or(angle);
    let (moved, turned) = (change.translation.vector.norm(), change.rotation.angle());
    let unusual = moved > length || turned > angle;
    unusual && moved < MOST * sigma && turned < MOST * sigma_rad
}

/// Whether joints enough move these bodies in the recordings.
fn moves(inputs: &Inputs, bodies: &BTreeSet<&str>) -> bool {
    let model = &inputs.robot.model;
    let of_profile = &inputs.robot.profile.bodies;
    let above = bodies.iter().flat_map(|name| {
        let chain = model.chain_to_root(of_profile[*name].link).into_iter();
        chain.map(|joint| model.joint(joint).law.source)
    });
    let above: BTreeSet<JointId> = above.collect();
    let moved = above.into_iter().filter(|joint| {
        let range = inputs.range(*joint);
        range.is_some_and(|(low, high)| high - low > MOVED)
    });
    moved.count() >= JOINTS
}
