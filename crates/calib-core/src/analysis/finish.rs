//! What a fit means at its minimum.

use crate::analysis::information::Information;
use crate::analysis::levels_found::levels_found;
use crate::analysis::observability::observe;
use crate::analysis::solution::{Solution, describe_parameters};
use crate::graph::error::Error;
use crate::model::layout::Model;
use crate::solve::kept_rows::KeptRows;
use crate::solve::minimize::Minimum;
use crate::solve::robust::{RejectReason, Rejection};

/// What [`finish`] passes on beside the minimum.
pub(super) struct Outcome {
    pub weights: Vec<f64>,
    pub theta: Vec<f64>,
    pub rejected: Vec<Rejection>,
    pub iterations: usize,
    pub relative_sigma: Vec<Option<f64>>,
    pub chi2_stated: f64,
}

/// Spectrum, covariance and observability at the minimum.
pub(super) fn finish(model: Model, minimum: Minimum, outcome: Outcome) -> Result<Solution, Error> {
    let Outcome {
        weights,
        theta,
        mut rejected,
        iterations,
        relative_sigma,
        chi2_stated,
    } = outcome;
    let information =
        Information::at(&model, &minimum.values, &weights, &theta).ok_or(Error::NotEvaluable)?;
    let noise = levels_found(&model, &weights, &theta, &relative_sigma);
    rejected.extend(
        model
            .lost()
            .into_iter()
            .map(|(measurement, sample, item)| Rejection {
                sample,
                measurement,
                item,
                reason: RejectReason::Occlusion,
                distance: 0.0,
            }),
    );
    // ν = rows − tr(C JᵀV⁻¹J)
    let kept = model.observations.iter().zip(&weights);
    let rows: usize = kept.filter(|(_, w)| **w > 0.0).map(|(o, _)| o.rows).sum();
    let degrees_of_freedom = rows as f64 - information.effective_parameters();
    Ok(Solution {
        parameters: describe_parameters(&model, &minimum.values, &information),
        observability: observe(&model, &minimum.values, &information),
        values: minimum.values,
        status: minimum.status,
        iterations,
        chi2: minimum.data_cost,
        chi2_stated,
        degrees_of_freedom,
        noise,
        information,
        weights,
        rejected,
        theta,
        kept_rows: KeptRows::default(),
        model,
    })
}
