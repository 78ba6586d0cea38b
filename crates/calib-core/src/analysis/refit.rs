//! Given observations fitted again under another statement of the same problem.

use crate::analysis::estimate::{Fit, Found};
use crate::analysis::finish::{Outcome, finish};
use crate::analysis::precision::FULL;
use crate::analysis::settings::Settings;
use crate::analysis::solution::Solution;
use crate::graph::error::Error;
use crate::graph::problem::Problem;
use crate::model::layout::Model;
use crate::model::values::Values;
use crate::solve::equations::{Objective, Workspace};
use crate::solve::minimize::Minimum;

/// Where a fit begins that keeps the observations it is given.
pub(crate) struct Start {
    pub values: Values,
    /// Robust weight per observation.
    pub weights: Vec<f64>,
    /// σ² per group.
    pub theta: Vec<f64>,
    /// Linearizations until here.
    pub iterations: usize,
}

/// A fit of which nothing is said yet but where it ended.
pub(crate) struct Refitted {
    model: Model,
    minimum: Minimum,
    outcome: Outcome,
}

impl Refitted {
    pub(crate) fn objective(&self) -> Objective<'_> {
        Objective {
            model: &self.model,
            weights: &self.outcome.weights,
            theta: &self.outcome.theta,
        }
    }

    pub(crate) fn values(&self) -> &Values {
        &self.minimum.values
    }

    /// With spectrum, covariance and observability.
    pub(crate) fn finished(self) -> Result<Solution, Error> {
        finish(self.model, self.minimum, self.outcome)
    }
}

/// Given observations fitted again: the same measurements and parameters, other noise or other priors.
pub(crate) fn refitted(
    problem: &Problem,
    start: Start,
    settings: &Settings,
) -> Result<Refitted, Error> {
    let Start {
        values,
        weights,
        mut theta,
        iterations,
    } = start;
    let model = Model::new(problem)?;
    let mask: Vec<f64> = model
        .observations
        .iter()
        .map(|o| f64::from(u8::from(!model.is_held_out(o.sample))))
        .collect();
    let mut work = Workspace::new(&model);
    let mut fit = Fit::new(&model, settings, FULL, iterations);
    let minimum = fit.with_noise(&values, &weights, &mut theta, &mut work);
    let found = Found {
        minimum,
        weights,
        theta,
    };
    let outcome = fit.outcome(&found, &mask, &mut work);
    Ok(Refitted {
        minimum: found.minimum,
        outcome,
        model,
    })
}

/// [`refitted`], to the end.
pub(crate) fn refit(
    problem: &Problem,
    start: Start,
    settings: &Settings,
) -> Result<Solution, Error> {
    refitted(problem, start, settings)?.finished()
}
