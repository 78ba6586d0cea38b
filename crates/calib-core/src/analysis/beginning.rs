//! What every fit begins with beside its start values: noise levels, and which observations take part.

use crate::graph::error::Error;
use crate::model::layout::{Model, Observation};

/// σ² of every group as it is stated.
pub(crate) fn stated_levels(model: &Model) -> Vec<f64> {
    let groups = model.problem.groups.iter();
    groups.map(|g| g.sigma * g.sigma).collect()
}

/// σ² of every group to begin with: as given where it is estimated, else as it is stated.
pub(crate) fn first_levels(model: &Model, given: Option<&[f64]>) -> Vec<f64> {
    let mut theta = stated_levels(model);
    if let Some(given) = given.filter(|given| given.len() == theta.len()) {
        let groups = model.problem.groups.iter().zip(&mut theta).zip(given);
        let estimated = groups.filter(|((group, _), _)| group.estimate);
        estimated.for_each(|((_, theta), level)| *theta = *level);
    }
    theta
}

/// Per observation: 1 fitted, 0 held out or rejected before.
pub(crate) fn mask_of(model: &Model, kept: Option<&[f64]>) -> Result<Vec<f64>, Error> {
    let fitted = |(o, observation): (usize, &Observation)| {
        let taken = kept.is_none_or(|kept| kept[o] > 0.0);
        f64::from(u8::from(taken && !model.is_held_out(observation.sample)))
    };
    let mask: Vec<f64> = model.observations.iter().enumerate().map(fitted).collect();
    if mask.iter().all(|w| *w == 0.0) {
        return Err(Error::NoObservations);
    }
    Ok(mask)
}
