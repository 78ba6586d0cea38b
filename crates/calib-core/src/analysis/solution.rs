//! The result of a solve: values, their uncertainty, and what is not identifiable.

use serde::{Deserialize, Serialize};

use crate::analysis::information::{INDETERMINATE, Information};
use crate::analysis::observability::{Direction, Observability, directions, weak};
use crate::graph::ids::{GroupId, ParameterId};
use crate::graph::parameter::ParameterKind;
use crate::graph::problem::NoiseKind;
use crate::graph::unit::Unit;
use crate::model::layout::Model;
use crate::model::values::Values;
use crate::solve::equations::{Objective, Workspace};
use crate::solve::kept_rows::KeptRows;
use crate::solve::minimize::SolveStatus;
use crate::solve::normal::{data_cost, prior_cost};
use crate::solve::robust::Rejection;

/// How well a parameter is identifiable.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ParameterClass {
    /// The data determine it: at most a tenth of its prior variance is left.
    Solid,
    /// The data say more than the prior, but not much.
    Weak,
    /// The data say less than the prior.
    Prior,
    /// No measurement determines it on its own: it belongs to a gauge, or its joint did not move.
    NotObservable,
}

/// One parameter after the fit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct ParameterEstimate {
    /// Which parameter of the problem.
    pub id: ParameterId,
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
    /// Posterior σ; `None` where nothing determines it or it was fixed.
    pub sigma: Option<f64>,
    /// 1 − posterior variance / prior variance (the prior being the scale of the parameter where it has
    /// none); 0 where the data add nothing.
    pub data_share: f64,
    /// How well it is identifiable.
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
#[non_exhaustive]
pub struct NoiseEstimate {
    /// Which group of the problem.
    pub id: GroupId,
    /// Its name.
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
    /// What it was found from: observations of the group that the fit kept, or readings of its joints that
    /// they depend on.
    pub samples: usize,
}

/// Everything that a solve found. Its analyses keep what they have in common: to change a solution, change a copy that was not looked at.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Solution {
    /// The problem as it was solved.
    pub model: Model,
    /// Values of all parameters, in the order of the problem.
    pub values: Values,
    /// How the minimization ended.
    pub status: SolveStatus,
    /// Linearizations over all rounds.
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
    /// Null space.
    pub observability: Observability,
    /// Robust weight per observation: 0 rejected or held out, 1 kept.
    pub weights: Vec<f64>,
    /// Observations that were rejected, with reasons.
    pub rejected: Vec<Rejection>,
    /// σ² per noise group, as used.
    pub theta: Vec<f64>,
    pub(crate) kept_rows: KeptRows,
}

impl Solution {
    /// What was minimized in the end, for passes over its rows.
    pub(crate) fn objective(&self) -> Objective<'_> {
        Objective {
            model: &self.model,
            weights: &self.weights,
            theta: &self.theta,
        }
    }

    /// Weakly identifiable directions, with a data-only σ larger than the prior's: the last of [`Information::directions`] that the data see.
    #[must_use]
    pub fn weak(&self) -> Vec<Direction> {
        let of = weak(&self.information);
        directions(&self.model, &self.values, &self.information, of)
    }

    /// Row and column of a parameter in [`Information::covariance`], by its index; `None` where it is held.
    #[must_use]
    pub fn column_of(&self, parameter: usize) -> Option<usize> {
        self.model.column_of.get(parameter).copied().flatten()
    }

    /// eᵀV⁻¹e of the kept observations with these noise levels instead (σ per group, in the order of the problem).
    /// `None` when there are not as many levels as groups or the model cannot be evaluated with them.
    #[must_use]
    pub fn chi2_with(&self, sigma: &[f64]) -> Option<f64> {
        if sigma.len() != self.theta.len() {
            return None;
        }
        let theta: Vec<f64> = sigma.iter().map(|s| s * s).collect();
        let objective = Objective {
            theta: &theta,
            ..self.objective()
        };
        let mut work = Workspace::new(&self.model);
        let chi2 = data_cost(objective, &self.values, &mut work);
        chi2.is_finite().then_some(chi2)
    }

    /// The same with the priors: solutions of the same observations are compared by it.
    #[must_use]
    pub fn cost_with(&self, sigma: &[f64]) -> Option<f64> {
        let chi2 = self.chi2_with(sigma)?;
        Some(prior_cost(&self.model, &self.values, chi2))
    }
}

/// Every parameter of the problem after the fit.
pub(crate) fn describe_parameters(
    model: &Model,
    values: &Values,
    information: &Information,
) -> Vec<ParameterEstimate> {
    let parameters = model.problem.parameters.iter().enumerate();
    parameters
        .map(|(p, parameter)| {
            let value = values.0[p];
            let column = model.column_of[p];
            let sigma = column.and_then(|c| information.sigma(c));
            // share = 1 − σ²/s², s the prior σ or the parameter's scale
            let share = |s: f64| (1.0 - (s / parameter.scale()).powi(2)).max(0.0);
            let data_share = sigma.map_or(0.0, share);
            let open = column.is_none_or(|c| information.null_share(c) > INDETERMINATE);
            let at_bound = |(lower, upper): (f64, f64)| value <= lower || value >= upper;
            ParameterEstimate {
                id: ParameterId::of(p),
                name: parameter.name.clone(),
                joint: parameter.joint.clone(),
                kind: parameter.kind,
                unit: parameter.unit,
                nominal: parameter.nominal,
                value,
                sigma,
                data_share,
                class: ParameterClass::of(sigma.is_some() && !open, data_share),
                at_bound: !parameter.fixed && parameter.bounds.is_some_and(at_bound),
            }
        })
        .collect()
}

impl ParameterClass {
    /// From the fraction of the prior variance that the data removed.
    fn of(observable: bool, data_share: f64) -> Self {
        match data_share {
            _ if !observable => Self::NotObservable,
            share if share < 0.5 => Self::Prior,
            share if share < 0.9 => Self::Weak,
            _ => Self::Solid,
        }
    }
}
