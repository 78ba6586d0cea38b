//! From joints to a tree: circles, mimics, and the order from the root.

use super::{RawJoint, Reader};
use crate::error::Problem;
use crate::model::{Joint, JointId, JointKind, Link, LinkId, MimicLaw};

impl Reader<'_> {
    /// Every link has at most one parent here, so a walk upwards ends at a root or goes round.
    pub(super) fn circles(&mut self, links: &[Link], joints: &[Joint], raw: &[RawJoint<'_, '_>]) {
        let mut seen_in_walk = vec![usize::MAX; links.len()];
        for start in 0..links.len() {
            let mut here = start;
            while seen_in_walk[here] == usize::MAX {
                seen_in_walk[here] = start;
                match links[here].parent_joint {
                    Some(joint) => here = joints[joint.index()].parent.index(),
                    None => break,
                }
            }
            if seen_in_walk[here] != start || links[here].parent_joint.is_none() {
                continue;
            }
            // Round once more, from parent to child: collect upwards, then reverse.
            let mut path = Vec::new();
            let mut at = here;
            while let Some(joint) = links[at].parent_joint {
                path.push(links[at].name.clone());
                at = joints[joint.index()].parent.index();
                if at == here {
                    break;
                }
            }
            path.reverse();
            if let Some(joint) = links[here].parent_joint {
                self.report(
                    raw[joint.index()].node.range().start,
                    Problem::Cycle { path },
                );
            }
        }
    }

    /// Fills [`Joint::law`] by walking along the mimics.
    pub(super) fn follow_mimics(&mut self, joints: &mut [Joint], raw: &[RawJoint<'_, '_>]) {
        let mut reported = vec![false; joints.len()];
        for start in 0..joints.len() {
            let mut law = joints[start].law;
            let mut path = vec![start];
            while let Some(mimic) = joints[law.source.index()].mimic {
                // q = m·q_s + b  and  q_s = m'·q_t + b'   ⇒   q = m·m'·q_t + (m·b' + b)
                law = MimicLaw {
                    source: mimic.joint,
                    multiplier: law.multiplier * mimic.multiplier,
                    offset: law.multiplier * mimic.offset + law.offset,
                };
                let next = mimic.joint.index();
                if let Some(begin) = path.iter().position(|joint| *joint == next) {
                    if !path.iter().any(|joint| reported[*joint]) {
                        let circle = path[begin..]
                            .iter()
                            .map(|joint| joints[*joint].name.clone())
                            .collect();
                        self.report(
                            raw[next].node.range().start,
                            Problem::MimicCycle { path: circle },
                        );
                    }
                    path.iter().for_each(|joint| reported[*joint] = true);
                    break;
                }
                path.push(next);
            }
            if joints[law.source.index()].kind == JointKind::Fixed {
                law.multiplier = 0.0;
            }
            joints[start].law = law;
        }
    }
}

/// Every joint after the joint that carries its parent link.
pub(super) fn breadth_first(root: LinkId, links: &[Link], joints: &[Joint]) -> Vec<JointId> {
    let mut order = links[root.index()].child_joints.clone();
    let mut next = 0;
    while next < order.len() {
        let child = joints[order[next].index()].child;
        order.extend(&links[child.index()].child_joints);
        next += 1;
    }
    order
}
