//! What lies on the paths of the measurements: checked walks, joints that never moved, random effects.

use std::collections::BTreeSet;
use std::ops::Range;

use crate::graph::edge::EdgeKind;
use crate::graph::effect::{Drives, Source};
use crate::graph::error::Error;
use crate::graph::ids::{EdgeId, FrameId};
use crate::graph::problem::Problem;
use crate::model::values::Slot;

/// A joint whose reading varies by less than this (rad or m) over the samples that use it did not
/// move: 1 mrad on a lever of 1 m is the tracker's noise, so its axis cannot be seen.
pub const MIN_JOINT_RANGE: f64 = 1e-3;

/// The edges of a path, with the frames checked where they are joined.
pub(crate) fn walk(
    problem: &Problem,
    from: FrameId,
    to: FrameId,
    given: Option<&[(EdgeId, bool)]>,
    measurement: &str,
) -> Result<Vec<(EdgeId, bool)>, Error> {
    let Some(given) = given else {
        return problem.path(from, to);
    };
    let mut here = from;
    for &(id, inverse) in given {
        let edge = &problem.edges[id.index()];
        let (begin, end) = if inverse {
            (edge.child, edge.parent)
        } else {
            (edge.parent, edge.child)
        };
        if begin != here {
            return Err(Error::BrokenPath {
                measurement: measurement.to_owned(),
                edge: edge.name.clone(),
                found: problem.frame_name(begin).to_owned(),
                expected: problem.frame_name(here).to_owned(),
            });
        }
        here = end;
    }
    if here != to {
        return Err(Error::NoPath {
            from: problem.frame_name(from).to_owned(),
            to: problem.frame_name(to).to_owned(),
        });
    }
    Ok(given.to_vec())
}

/// Holds every parameter that only unmoved joints feel; returns those joints.
pub(crate) fn contract_unmoved(
    problem: &mut Problem,
    walks: &[Vec<(EdgeId, bool)>],
    of_sample: &[Range<usize>],
) -> Vec<EdgeId> {
    let on_path: BTreeSet<usize> = walks.iter().flatten().map(|&(e, _)| e.index()).collect();
    let used: Vec<usize> = (0..problem.samples)
        .filter(|&s| !of_sample[s].is_empty() && !problem.held_out.contains(&s))
        .collect();
    let range_of = |f: &dyn Fn(usize) -> f64| {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for &s in &used {
            low = low.min(f(s));
            high = high.max(f(s));
        }
        high - low
    };
    let start: Vec<f64> = problem.parameters.iter().map(|p| p.start).collect();
    let mut unmoved = Vec::new();
    let mut moving_parameters = BTreeSet::new();
    let mut still_parameters = BTreeSet::new();
    for &e in &on_path {
        let EdgeKind::Joint(joint) = &problem.edges[e].kind else {
            continue;
        };
        let reading = |s: usize| {
            joint.q[s]
                + joint
                    .effects
                    .iter()
                    .filter(|f| f.drives == Drives::About)
                    .map(|f| f.value(s, &start) * start[f.parameter.index()])
                    .sum::<f64>()
        };
        let driven = joint.effects.iter().any(|f| {
            let source = f.kind.term().source;
            matches!(
                source,
                Source::OtherJoint | Source::Caller | Source::Temperature
            ) && !problem.parameters[f.parameter.index()].fixed
                && range_of(&|s| f.value(s, &start)) > MIN_JOINT_RANGE
        });
        let own: Vec<usize> = joint.effects.iter().map(|f| f.parameter.index()).collect();
        if driven || range_of(&reading) > MIN_JOINT_RANGE {
            moving_parameters.extend(own);
        } else {
            unmoved.push(EdgeId::of(e));
            still_parameters.extend(own);
        }
    }
    for &e in &unmoved {
        let name = problem.edges[e.index()].name.clone();
        for edge in &problem.edges {
            if let EdgeKind::Unknown(u) = &edge.kind
                && u.role == crate::graph::edge::Role::JointOrigin
                && u.joint.as_deref() == Some(&name)
            {
                still_parameters.extend(u.parameters.iter().flatten().map(|p| p.index()));
            }
        }
    }
    for p in still_parameters.difference(&moving_parameters) {
        problem.parameters[*p].fixed = true;
    }
    unmoved
}

/// One slot per noisy joint, per random direction, per dimension of a measured edge's covariance.
pub(crate) fn random_slots(problem: &Problem, walks: &[Vec<(EdgeId, bool)>]) -> Vec<Slot> {
    let on_path: BTreeSet<usize> = walks.iter().flatten().map(|&(e, _)| e.index()).collect();
    let mut slots = Vec::new();
    for &edge in &on_path {
        let (count, group) = match &problem.edges[edge].kind {
            EdgeKind::Joint(j) => (
                usize::from(j.noise.is_some()),
                j.noise.map(crate::graph::ids::GroupId::index),
            ),
            EdgeKind::Random { directions, group } => (directions.len(), Some(group.index())),
            EdgeKind::Measured {
                covariance: Some(_),
                ..
            } => (6, None),
            _ => (0, None),
        };
        slots.extend((0..count).map(|direction| Slot {
            edge,
            direction,
            group,
        }));
    }
    slots
}
