//! The noise levels that a fit found, and how much each is found from.

use std::collections::BTreeSet;

use crate::analysis::solution::NoiseEstimate;
use crate::graph::ids::GroupId;
use crate::model::layout::Model;
use crate::solve::rows::add_block;

/// Levels in the order of the groups.
pub(crate) fn levels_found(
    model: &Model,
    weights: &[f64],
    theta: &[f64],
    relative_sigma: &[Option<f64>],
) -> Vec<NoiseEstimate> {
    let samples = samples_per_group(model, weights);
    let groups = model.problem.groups.iter().enumerate();
    groups
        .map(|(g, group)| NoiseEstimate {
            id: GroupId::of(g),
            name: group.name.clone(),
            kind: group.kind,
            stated: group.sigma,
            sigma: theta[g].sqrt(),
            relative_error: relative_sigma[g],
            estimated: group.estimate,
            samples: samples[g],
        })
        .collect()
}

/// What each noise level is found from: kept observations whose covariance has it, and readings of its joints on
/// their paths.
fn samples_per_group(model: &Model, weights: &[f64]) -> Vec<usize> {
    /// In place of an edge, where the observation itself is counted.
    const ITSELF: usize = usize::MAX;
    let mut used = vec![BTreeSet::new(); model.problem.groups.len()];
    for (o, observation) in model.observations.iter().enumerate() {
        if weights[o] == 0.0 {
            continue;
        }
        add_block(model, o, |_, _, group, _| {
            used[group].insert((o, ITSELF));
        });
        for &k in &model.paths[observation.measurement].slots {
            if let Some(group) = model.slots[k].group {
                used[group].insert((observation.sample, model.slots[k].edge));
            }
        }
    }
    used.iter().map(BTreeSet::len).collect()
}
