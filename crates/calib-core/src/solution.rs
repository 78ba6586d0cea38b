//! The whole estimate: values, their uncertainty, and what is not known.

use serde::{Deserialize, Serialize};

use crate::error::Error;
use crate::information::{INDETERMINATE, Information};
use crate::minimize::{MinimizeSettings, Minimum, SolveStatus, minimize};
use crate::model::{Model, Values};
use crate::parameter::{ParameterKind, Unit};
use crate::problem::{NoiseKind, Problem};

/// How far a parameter is known.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ParameterClass {
    /// The data determine it: at most a tenth of its variance is left.
    Solid,
    /// The data say more than the prior, but not much.
    Weak,
    /// The data say less than the prior.
    Prior,
    /// No measurement sees it on its own: it belongs to a gauge, or its joint never moved.
    NotObservable,
}

/// One parameter after the fit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ParameterEstimate {
    /// Its name.
    pub name: String,
    /// The joint it belongs to.
    pub joint: Option<String>,
    /// What it is.
    pub kind: ParameterKind,
    /// Its unit.
    pub unit: Unit,
    /// Nominal value.
    pub nominal: f64,
    /// Estimate.
    pub value: f64,
    /// Posterior σ; `None` where nothing determines it or it was held.
    pub sigma: Option<f64>,
    /// 1 − posterior variance / prior variance (the prior being the scale of the parameter where it has
    /// none); 0 where nothing was learnt.
    pub data_share: f64,
    /// In one word.
    pub class: ParameterClass,
    /// The estimate lies on one of its bounds.
    pub at_bound: bool,
}

/// One noise level after the fit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct NoiseEstimate {
    /// Group.
    pub name: String,
    /// What it is.
    pub kind: NoiseKind,
    /// σ that was stated or guessed.
    pub stated: f64,
    /// σ that was used in the end.
    pub sigma: f64,
    /// Whether the residuals decided it.
    pub estimated: bool,
}

/// Everything that a solve found.
#[derive(Debug, Clone)]
pub struct Solution {
    /// The problem as it was solved.
    pub model: Model,
    /// Values of all parameters, in the order of the problem.
    pub values: Values,
    /// How the minimisation ended.
    pub status: SolveStatus,
    /// Linearisations over all rounds.
    pub iterations: usize,
    /// eᵀV⁻¹e of the kept observations.
    pub chi2: f64,
    /// Rows minus the parameters that the data determined.
    pub degrees_of_freedom: f64,
    /// Parameters, in the order of the problem.
    pub parameters: Vec<ParameterEstimate>,
    /// Noise levels, in the order of the groups.
    pub noise: Vec<NoiseEstimate>,
    /// Spectrum and covariance.
    pub information: Information,
    /// Robust weight per observation: 0 rejected, 1 kept.
    pub weights: Vec<f64>,
    /// σ² per noise group, as used.
    pub theta: Vec<f64>,
}

/// How to solve.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Settings {
    /// Limits of the minimisation.
    pub minimize: MinimizeSettings,
}

/// Solves a problem.
///
/// # Errors
/// [`Error`] when the problem cannot be stated; a fit that does not converge or cannot see something
/// is a [`Solution`] that says so.
pub fn solve(problem: &Problem, settings: &Settings) -> Result<Solution, Error> {
    let model = Model::new(problem)?;
    let theta: Vec<f64> = model
        .problem
        .groups
        .iter()
        .map(|g| g.sigma * g.sigma)
        .collect();
    let weights = vec![1.0; model.observations.len()];
    let minimum = minimize(&model, &model.start(), &weights, &theta, &settings.minimize);
    finish(model, minimum, weights, theta)
}

fn finish(
    model: Model,
    minimum: Minimum,
    weights: Vec<f64>,
    theta: Vec<f64>,
) -> Result<Solution, Error> {
    let information =
        Information::at(&model, &minimum.values, &weights, &theta).ok_or(Error::NotEvaluable)?;
    let parameters = describe_parameters(&model, &minimum.values, &information);
    let noise = model
        .problem
        .groups
        .iter()
        .zip(&theta)
        .map(|(g, t)| NoiseEstimate {
            name: g.name.clone(),
            kind: g.kind,
            stated: g.sigma,
            sigma: t.sqrt(),
            estimated: g.estimate,
        })
        .collect();
    let rows: usize = model
        .observations
        .iter()
        .zip(&weights)
        .filter(|(_, w)| **w > 0.0)
        .map(|(o, _)| o.rows)
        .sum();
    let degrees_of_freedom = rows as f64 - effective_parameters(&information, &model);
    Ok(Solution {
        values: minimum.values,
        status: minimum.status,
        iterations: minimum.iterations,
        chi2: minimum.data_cost,
        degrees_of_freedom,
        parameters,
        noise,
        information,
        weights,
        theta,
        model,
    })
}

/// tr(C JᵀV⁻¹J): how many parameters the data paid for.
fn effective_parameters(information: &Information, model: &Model) -> f64 {
    let n = model.free();
    let rs = &information.r;
    let mut trace = 0.0;
    // R is scaled by S: JᵀV⁻¹J = S⁻¹RᵀR S⁻¹, C carries S on both sides.
    let mut unscaled = information.covariance.clone();
    for i in 0..n {
        for j in 0..n {
            unscaled[(i, j)] /= information.scale[i] * information.scale[j];
        }
    }
    let rc = rs * unscaled;
    for i in 0..n {
        for j in 0..n {
            trace += rc[(i, j)] * rs[(i, j)];
        }
    }
    trace
}

fn describe_parameters(
    model: &Model,
    values: &Values,
    information: &Information,
) -> Vec<ParameterEstimate> {
    model
        .problem
        .parameters
        .iter()
        .enumerate()
        .map(|(p, parameter)| {
            let value = values.0[p];
            let (sigma, data_share, class) = match model.column_of[p] {
                None => (None, 0.0, ParameterClass::NotObservable),
                Some(c) => {
                    let sigma = information.sigma(c);
                    let share =
                        sigma.map_or(0.0, |s| (1.0 - (s / parameter.scale()).powi(2)).max(0.0));
                    let class = if sigma.is_none() || information.null_share(c) > INDETERMINATE {
                        ParameterClass::NotObservable
                    } else if share < 0.5 {
                        ParameterClass::Prior
                    } else if share < 0.9 {
                        ParameterClass::Weak
                    } else {
                        ParameterClass::Solid
                    };
                    (sigma, share, class)
                }
            };
            let at_bound = parameter
                .bounds
                .is_some_and(|(l, u)| !parameter.fixed && (value <= l || value >= u));
            ParameterEstimate {
                name: parameter.name.clone(),
                joint: parameter.joint.clone(),
                kind: parameter.kind,
                unit: parameter.unit,
                nominal: parameter.nominal,
                value,
                sigma,
                data_share,
                class,
                at_bound,
            }
        })
        .collect()
}
