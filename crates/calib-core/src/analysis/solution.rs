//! The whole estimate: values, their uncertainty, and what is not known.
//!
//! ```text
//! start ─► minimise ─► Huber ─► GNC ─► gate ─► minimise ⇄ REML ─► gate again until it stays ─► analyse
//! ```

use serde::{Deserialize, Serialize};

use crate::analysis::information::{INDETERMINATE, Information};
use crate::analysis::observability::{Observability, observe};
use crate::graph::error::Error;
use crate::graph::parameter::{ParameterKind, Unit};
use crate::graph::problem::{NoiseKind, Problem};
use crate::model::layout::Model;
use crate::model::values::Values;
use crate::solve::minimize::{MinimizeSettings, Minimum, SolveStatus, minimize_in};
use crate::solve::noise::{Scoring, score};
use crate::solve::normal::Workspace;
use crate::solve::robust::{RejectReason, Rejection, RobustSettings, clean, explain, gate};

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

impl ParameterEstimate {
    /// Is nominal a statement about this parameter (not just where its chart begins)? World frames and
    /// mounts without prior have no nominal value to agree with.
    pub(crate) fn prior_or_feature(&self) -> bool {
        self.joint.is_some()
            || !matches!(
                self.kind,
                ParameterKind::Rotation | ParameterKind::Translation | ParameterKind::Point
            )
    }
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
    /// Standard error of `sigma` divided by `sigma`, where the residuals decided it.
    pub relative_error: Option<f64>,
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
    /// eᵀV⁻¹e of the kept observations, V with the noise levels as used.
    pub chi2: f64,
    /// The same with the noise levels as stated: against `degrees_of_freedom` it shows missing physics
    /// that estimated noise has swallowed.
    pub chi2_stated: f64,
    /// Rows minus the parameters that the data determined.
    pub degrees_of_freedom: f64,
    /// Parameters, in the order of the problem.
    pub parameters: Vec<ParameterEstimate>,
    /// Noise levels, in the order of the groups.
    pub noise: Vec<NoiseEstimate>,
    /// Spectrum and covariance.
    pub information: Information,
    /// Null space and weak directions, in words.
    pub observability: Observability,
    /// Robust weight per observation: 0 rejected or held out, 1 kept.
    pub weights: Vec<f64>,
    /// Observations that were left out, with reasons.
    pub rejected: Vec<Rejection>,
    /// σ² per noise group, as used.
    pub theta: Vec<f64>,
}

/// How to solve.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Limits of the minimisation.
    pub minimize: MinimizeSettings,
    /// Treatment of outliers; on by default.
    pub robust: RobustSettings,
    /// Rounds of minimising and re-estimating noise levels; they settle to 0.1 % in 5 to 15.
    pub noise_rounds: usize,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            minimize: MinimizeSettings::default(),
            robust: RobustSettings::default(),
            noise_rounds: 60,
        }
    }
}

impl Settings {
    /// Every observation counts fully, noise levels as stated: the plain least-squares fit.
    #[must_use]
    pub fn plain() -> Self {
        let mut settings = Self::default();
        settings.robust.enabled = false;
        settings.noise_rounds = 0;
        settings
    }
}

/// Noise levels have settled when log σ² changes by less than this: 0.05 % in σ.
const NOISE_SETTLED: f64 = 1e-3;
/// Values need not be better than 1e-3 σ while noise levels or outliers are still being decided.
const BETWEEN_ROUNDS: f64 = 1e-6;
/// Gate and refit alternate; the set stays in two or three rounds unless it flickers at the border.
const GATE_ROUNDS: usize = 6;

/// Solves a problem.
///
/// # Errors
/// [`Error`] when the problem cannot be stated; a fit that does not converge or cannot see something
/// is a [`Solution`] that says so.
pub fn solve(problem: &Problem, settings: &Settings) -> Result<Solution, Error> {
    let model = Model::new(problem)?;
    let stated: Vec<f64> = model
        .problem
        .groups
        .iter()
        .map(|g| g.sigma * g.sigma)
        .collect();
    let mask: Vec<f64> = model
        .observations
        .iter()
        .map(|o| {
            if model.is_held_out(o.sample) {
                0.0
            } else {
                1.0
            }
        })
        .collect();
    if mask.iter().all(|w| *w == 0.0) {
        return Err(Error::NoObservations);
    }
    let mut work = Workspace::new(&model);
    let mut fit = Fit {
        model: &model,
        settings,
        iterations: 0,
        relative_sigma: vec![None; stated.len()],
    };
    let mut theta = stated.clone();
    let mut weights = mask.clone();
    let mut minimum = fit.minimize(&model.start(), &weights, &theta, &mut work, BETWEEN_ROUNDS);
    if settings.robust.enabled
        && minimum.status != SolveStatus::NotEvaluable
        && let Some((values, kept, iterations)) =
            clean(&model, &minimum, &mask, &theta, &settings.robust, &mut work)
    {
        fit.iterations += iterations;
        minimum.values = values;
        weights = kept;
    }
    for _ in 0..GATE_ROUNDS {
        minimum = fit.with_noise(&minimum, &weights, &mut theta, &mut work);
        if !settings.robust.enabled || minimum.status == SolveStatus::NotEvaluable {
            break;
        }
        let Some(again) = gate(
            &model,
            &minimum.values,
            &theta,
            &mask,
            &settings.robust,
            &mut work,
        ) else {
            break;
        };
        if again == weights {
            break;
        }
        weights = again;
    }
    let rejected = explain(&model, &minimum.values, &theta, &mask, &weights, &mut work);
    let (iterations, relative_sigma) = (fit.iterations, fit.relative_sigma);
    let chi2_stated =
        crate::solve::normal::data_cost(&model, &minimum.values, &weights, &stated, &mut work);
    finish(
        model,
        minimum,
        Outcome {
            weights,
            theta,
            rejected,
            iterations,
            relative_sigma,
            chi2_stated,
        },
    )
}

/// What [`finish`] only passes on.
struct Outcome {
    weights: Vec<f64>,
    theta: Vec<f64>,
    rejected: Vec<Rejection>,
    iterations: usize,
    relative_sigma: Vec<Option<f64>>,
    chi2_stated: f64,
}

struct Fit<'a> {
    model: &'a Model,
    settings: &'a Settings,
    iterations: usize,
    relative_sigma: Vec<Option<f64>>,
}

impl Fit<'_> {
    fn minimize(
        &mut self,
        start: &Values,
        weights: &[f64],
        theta: &[f64],
        work: &mut Workspace,
        decrement: f64,
    ) -> Minimum {
        let settings = MinimizeSettings {
            decrement,
            ..self.settings.minimize
        };
        let minimum = minimize_in(self.model, start, weights, theta, &settings, work);
        self.iterations += minimum.iterations;
        minimum
    }

    /// Values and noise levels in turn until both stay.
    fn with_noise(
        &mut self,
        start: &Minimum,
        weights: &[f64],
        theta: &mut Vec<f64>,
        work: &mut Workspace,
    ) -> Minimum {
        if self.settings.noise_rounds == 0 || !self.model.problem.groups.iter().any(|g| g.estimate)
        {
            return self.minimize(
                &start.values,
                weights,
                theta,
                work,
                self.settings.minimize.decrement,
            );
        }
        let mut minimum = self.minimize(&start.values, weights, theta, work, BETWEEN_ROUNDS);
        for _ in 0..self.settings.noise_rounds {
            if minimum.status == SolveStatus::NotEvaluable {
                break;
            }
            let Some(Scoring {
                theta: next,
                change,
                relative_sigma,
            }) = score(self.model, &minimum.values, weights, theta, work)
            else {
                break;
            };
            self.relative_sigma = relative_sigma;
            *theta = next;
            if change < NOISE_SETTLED {
                break;
            }
            minimum = self.minimize(&minimum.values, weights, theta, work, BETWEEN_ROUNDS);
        }
        self.minimize(
            &minimum.values,
            weights,
            theta,
            work,
            self.settings.minimize.decrement,
        )
    }
}

fn finish(model: Model, minimum: Minimum, outcome: Outcome) -> Result<Solution, Error> {
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
    let parameters = describe_parameters(&model, &minimum.values, &information);
    let noise = model
        .problem
        .groups
        .iter()
        .enumerate()
        .map(|(g, group)| NoiseEstimate {
            name: group.name.clone(),
            kind: group.kind,
            stated: group.sigma,
            sigma: theta[g].sqrt(),
            relative_error: relative_sigma[g],
            estimated: group.estimate,
        })
        .collect();
    let rows: usize = model
        .observations
        .iter()
        .zip(&weights)
        .filter(|(_, w)| **w > 0.0)
        .map(|(o, _)| o.rows)
        .sum();
    for (measurement, sample, item) in model.lost() {
        rejected.push(Rejection {
            sample,
            measurement,
            item,
            reason: RejectReason::Occlusion,
            distance: 0.0,
        });
    }
    let degrees_of_freedom = rows as f64 - effective_parameters(&information, &model);
    let observability = observe(&model, &minimum.values, &information);
    Ok(Solution {
        values: minimum.values,
        status: minimum.status,
        iterations,
        chi2: minimum.data_cost,
        chi2_stated,
        degrees_of_freedom,
        parameters,
        noise,
        information,
        observability,
        weights,
        rejected,
        theta,
        model,
    })
}

/// tr(C JᵀV⁻¹J): how many parameters the data paid for.
fn effective_parameters(information: &Information, model: &Model) -> f64 {
    let n = model.free();
    // R is scaled by S, C carries S on both sides.
    let mut unscaled = information.covariance.clone();
    for i in 0..n {
        for j in 0..n {
            unscaled[(i, j)] /= information.scale[i] * information.scale[j];
        }
    }
    let product = &information.r * unscaled;
    product.dot(&information.r)
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
