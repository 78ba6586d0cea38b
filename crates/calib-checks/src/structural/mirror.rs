//! Signs of several joints that look like a mirrored tracker: the mirror image of a robot that is symmetric about a plane is the robot itself, with the
//! joints whose axes lie in the plane turned the other way.

use nalgebra::Vector3;

use super::chain::{Motion, Walk};
use super::data::Data;
use super::hypothesis::{Hypothesis, Scope, Scoped};
use super::ids::{JointIndex, LinkIndex};
use super::outcome::Correction;

/// Cosines below this are a right angle, and above 1 minus this a parallel: half a degree.
const RIGHT: f64 = 0.01;

/// For every plane that the directions of the joints at their zeros suggest: the joints that a mirror image reverses. Whether the robot is symmetric
/// about it is not asked.
pub(super) fn sign_patterns(data: &Data, scope: Scope) -> Vec<Correction> {
    let chain = &data.chain;
    let links: Vec<LinkIndex> = data.bodies.iter().map(|b| b.link).collect();
    let mut walk = Walk::new(chain, &links);
    walk.go(chain, &vec![0.0; chain.joints().len()]);
    let direction = |joint: JointIndex| -> Option<(JointIndex, bool, Vector3<f64>)> {
        let r = walk.root_from_joint[joint.0].r;
        match chain.joints()[joint.0].motion {
            Motion::Fixed => None,
            Motion::Revolute(axis) => Some((joint, true, r * axis.into_inner())),
            Motion::Prismatic(axis) => Some((joint, false, r * axis.into_inner())),
        }
    };
    let joints: Vec<_> = data
        .relevant_joints()
        .into_iter()
        .filter_map(direction)
        .collect();
    let mut normals: Vec<Vector3<f64>> = Vec::new();
    let mut add = |n: Vector3<f64>| {
        let known = |m: &Vector3<f64>| m.dot(&n).abs() > 1.0 - RIGHT;
        if !normals.iter().any(known) {
            normals.push(n);
        }
    };
    joints.iter().for_each(|(.., d)| add(*d));
    for (k, (.., a)) in joints.iter().enumerate() {
        let across = joints[k + 1..].iter().map(|(.., b)| a.cross(b));
        across
            .filter_map(|n| n.try_normalize(RIGHT))
            .for_each(&mut add);
    }
    let reversed = |n: &Vector3<f64>| -> Option<Correction> {
        let mut correction = Vec::new();
        for (joint, turns, d) in &joints {
            let along = d.dot(n).abs();
            let in_plane = along < RIGHT;
            if !in_plane && along < 1.0 - RIGHT {
                return None;
            }
            if in_plane == *turns {
                correction.push(Scoped {
                    hypothesis: Hypothesis::Sign { joint: *joint },
                    scope,
                });
            }
        }
        (correction.len() > 1).then_some(correction)
    };
    let mut out: Vec<Correction> = Vec::new();
    for correction in normals.iter().filter_map(reversed) {
        if !out.contains(&correction) {
            out.push(correction);
        }
    }
    out
}
