//! The whole estimate, step by step.
//!
//! ```text
//! start ─► minimize ─► Huber ─► GNC ─► gate ─► minimize ⇄ REML ─► gate again until it stays ─► analyze
//! ```

use crate::analysis::beginning::{first_levels, mask_of, stated_levels};
use crate::analysis::finish::{Outcome, finish};
use crate::analysis::looked_at::fewer;
use crate::analysis::precision::{FULL, Precision, ROUGH};
use crate::analysis::settings::Settings;
use crate::analysis::solution::Solution;
use crate::graph::error::Error;
use crate::graph::problem::Problem;
use crate::model::layout::{Model, Observation};
use crate::model::values::Values;
use crate::solve::contraction::{Contraction, both};
use crate::solve::equations::{Objective, Workspace};
use crate::solve::minimize::{MinimizeSettings, Minimum, SolveStatus, minimize_in};
use crate::solve::noise::{Scoring, score};
use crate::solve::normal::data_cost;
use crate::solve::predicted::gate_beside;
use crate::solve::robust::{Rejection, RobustSettings, clean, clean_near, explain, gate};

/// Gate and refit alternate; the set settles in two or three rounds unless an observation lies at the border, or is kept though the gate rejects it.
const GATE_ROUNDS: usize = 16;

/// Solves a problem.
///
/// # Errors
/// [`Error`] when the problem cannot be stated; a fit that does not converge or cannot determine something
/// is a [`Solution`] that says so.
pub fn solve(problem: &Problem, settings: &Settings) -> Result<Solution, Error> {
    solve_of(Model::new(problem)?, None, None, settings)
}

/// As [`solve`], with these noise levels to begin with in place of the stated ones: σ² per noise group, those of a fit that ended near. Levels of
/// another number of groups, and of groups that are not estimated, are not taken.
///
/// # Errors
/// As [`solve`].
pub fn solve_from(
    problem: &Problem,
    levels: &[f64],
    settings: &Settings,
) -> Result<Solution, Error> {
    solve_of(Model::new(problem)?, None, Some(levels), settings)
}

/// As [`solve`], from the observations only that `kept` kept: the solution of a problem with the same measurements.
///
/// # Errors
/// As [`solve`], and [`Error::OtherMeasurements`] where the measurements are not the same.
pub fn solve_kept(
    problem: &Problem,
    kept: &Solution,
    settings: &Settings,
) -> Result<Solution, Error> {
    let model = Model::new(problem)?;
    let place = |o: &Observation| (o.sample, o.measurement, o.item);
    let own = model.observations.iter().map(place);
    if !own.eq(kept.model.observations.iter().map(place)) {
        return Err(Error::OtherMeasurements);
    }
    solve_of(model, Some(&kept.weights), None, settings)
}

/// As [`solve`], from where the fit of `near` ended, values and noise levels: for other observations of the same robot without gross errors. The gate
/// rejects as in any fit; the search for gross errors before it is left out.
///
/// # Errors
/// As [`solve`], and [`Error::OtherParameters`] where the problem has not the parameters and noise groups of `near`.
pub fn solve_near(
    problem: &Problem,
    near: &Solution,
    settings: &Settings,
) -> Result<Solution, Error> {
    let model = Model::new(problem)?;
    let names = |of: &Model| -> Vec<String> {
        let parameters = of.problem.parameters.iter().map(|p| p.name.clone());
        let groups = of.problem.groups.iter().map(|g| g.name.clone());
        parameters.chain(groups).collect()
    };
    if names(&model) != names(&near.model) {
        return Err(Error::OtherParameters);
    }
    let mask = mask_of(&model, None)?;
    let mut work = Workspace::new(&model);
    let mut fit = Fit::new(&model, settings, FULL, 0);
    let mut start = model.start();
    for (k, value) in start.0.iter_mut().enumerate() {
        // What is held stays as it is stated.
        if model.column_of[k].is_some() {
            *value = near.values.0[k];
        }
    }
    let mut theta = near.theta.clone();
    let (minimum, weights) = fit.settled(start, mask.clone(), &mask, &mut theta, &mut work);
    let found = Found {
        minimum,
        weights,
        theta,
    };
    let outcome = fit.outcome(&found, &mask, &mut work);
    finish(model, found.minimum, outcome)
}

/// As [`solve`], from the samples only that the fit of a long recording begins with, at a tenth of the time. The gate judges all samples, and more
/// severely: the minimum of some differs a little from that of all. `None` where [`solve`] takes no longer.
///
/// # Errors
/// As [`solve`].
pub fn solve_some(problem: &Problem, settings: &Settings) -> Result<Option<Solution>, Error> {
    /// Factor of the share of good observations that are rejected.
    const SEVERE: f64 = 5.0;
    let model = Model::new(problem)?;
    let mask = mask_of(&model, None)?;
    let Some(fewer) = fewer(&model, &mask) else {
        return Ok(None);
    };
    let mut work = Workspace::new(&model);
    let mut fit = Fit::new(&model, settings, FULL, 0);
    let mut theta = first_levels(&model, None);
    let (minimum, weights) = fit.from(&model.start(), &fewer, &mut theta, &mut work);
    if minimum.status == SolveStatus::NotEvaluable {
        return Ok(None);
    }
    let robust = RobustSettings {
        gate: 1.0 - SEVERE * (1.0 - settings.robust.gate),
        ..settings.robust
    };
    let at = &minimum.values;
    let judged = gate(&model, at, &theta, &mask, &robust, &mut work).filter(|_| robust.enabled);
    let found = Found {
        minimum,
        weights,
        theta,
    };
    let mut outcome = fit.outcome(&found, &fewer, &mut work);
    if let Some(judged) = judged {
        let Found { minimum, theta, .. } = &found;
        outcome.rejected = explain(&model, &minimum.values, theta, &mask, &judged, &mut work);
    }
    finish(model, found.minimum, outcome).map(Some)
}

/// A fit of which nothing is said but where it ended.
pub(crate) struct Trial {
    pub model: Model,
    pub values: Values,
    /// Robust weight per observation.
    pub weights: Vec<f64>,
    /// σ² per group.
    pub theta: Vec<f64>,
    pub rejected: Vec<Rejection>,
}

impl Trial {
    pub(crate) fn objective(&self) -> Objective<'_> {
        Objective {
            model: &self.model,
            weights: &self.weights,
            theta: &self.theta,
        }
    }
}

/// As [`solve`]; where no outliers are told, only as near the minimum as predictions of left-out samples need. `levels`: σ² per group to begin with, in place of the stated
/// ones.
pub(crate) fn try_out(
    problem: &Problem,
    levels: Option<&[f64]>,
    settings: &Settings,
) -> Result<Trial, Error> {
    let model = Model::new(problem)?;
    let mask = mask_of(&model, None)?;
    let mut theta = first_levels(&model, levels);
    let mut work = Workspace::new(&model);
    // What the gate keeps hangs on the noise levels: a little less of them, and a trial of TIAGo lost two parts that its run supports.
    let precision = match settings.robust.enabled {
        true => FULL,
        false => ROUGH,
    };
    let mut fit = Fit::new(&model, settings, precision, 0);
    let (minimum, weights) = fit.robustly(&mask, &mut theta, &mut work);
    if minimum.status == SolveStatus::NotEvaluable {
        return Err(Error::NotEvaluable);
    }
    let rejected = explain(&model, &minimum.values, &theta, &mask, &weights, &mut work);
    Ok(Trial {
        values: minimum.values,
        rejected,
        weights,
        theta,
        model,
    })
}

fn solve_of(
    model: Model,
    kept: Option<&[f64]>,
    levels: Option<&[f64]>,
    settings: &Settings,
) -> Result<Solution, Error> {
    let mask = mask_of(&model, kept)?;
    let mut work = Workspace::new(&model);
    let mut fit = Fit::new(&model, settings, FULL, 0);
    let mut theta = first_levels(&model, levels);
    let (minimum, weights) = fit.robustly(&mask, &mut theta, &mut work);
    let found = Found {
        minimum,
        weights,
        theta,
    };
    let outcome = fit.outcome(&found, &mask, &mut work);
    finish(model, found.minimum, outcome)
}

/// Where a fit ended.
pub(super) struct Found {
    pub minimum: Minimum,
    pub weights: Vec<f64>,
    pub theta: Vec<f64>,
}

/// All rounds of a fit together take no more linearizations: ordinary fits take 20 to 80, and one that has not ended by
/// then has no minimum nearby.
const MOST_ITERATIONS: usize = 500;

pub(super) struct Fit<'a> {
    model: &'a Model,
    settings: &'a Settings,
    precision: Precision,
    iterations: usize,
    relative_sigma: Vec<Option<f64>>,
    /// How the steps of all minimizations so far contracted.
    contraction: Option<Contraction>,
}

impl<'a> Fit<'a> {
    pub(super) fn new(
        model: &'a Model,
        settings: &'a Settings,
        precision: Precision,
        iterations: usize,
    ) -> Self {
        Self {
            model,
            settings,
            precision,
            iterations,
            relative_sigma: vec![None; model.problem.groups.len()],
            contraction: None,
        }
    }

    /// Decrement of the last round.
    fn last(&self) -> f64 {
        self.settings.minimize.decrement.max(self.precision.last)
    }

    /// Linearizations that are left for all further rounds.
    fn left(&self) -> usize {
        // The last round counts its start and its last step.
        MOST_ITERATIONS.saturating_sub(self.iterations + 2)
    }

    /// What the result needs beside the minimum.
    pub(super) fn outcome(&self, found: &Found, mask: &[f64], work: &mut Workspace) -> Outcome {
        let Found {
            minimum,
            weights,
            theta,
        } = found;
        let stated = stated_levels(self.model);
        let objective = Objective {
            model: self.model,
            weights,
            theta: &stated,
        };
        Outcome {
            rejected: explain(self.model, &minimum.values, theta, mask, weights, work),
            iterations: self.iterations,
            relative_sigma: self.relative_sigma.clone(),
            chi2_stated: data_cost(objective, &minimum.values, work),
            weights: weights.clone(),
            theta: theta.clone(),
        }
    }

    /// The fit of what `mask` leaves. The way from the start, Huber's weights and most of the rounds take many linearizations: of
    /// long recordings some thousand samples go it, and all only the end.
    fn robustly(
        &mut self,
        mask: &[f64],
        theta: &mut Vec<f64>,
        work: &mut Workspace,
    ) -> (Minimum, Vec<f64>) {
        let (model, robust) = (self.model, &self.settings.robust);
        let start = model.start();
        let Some(fewer) = fewer(model, mask) else {
            return self.from(&start, mask, theta, work);
        };
        let stated = theta.clone();
        let (near, _) = self.from(&start, &fewer, theta, work);
        if near.status == SolveStatus::NotEvaluable {
            *theta = stated;
            return self.from(&start, mask, theta, work);
        }
        let robustly = || clean_near(model, &near.values, mask, theta, robust, work);
        match robust.enabled.then(robustly).flatten() {
            Some((values, kept, iterations)) => {
                self.iterations += iterations;
                self.settled(values, kept, mask, theta, work)
            }
            None => self.settled(near.values, mask.to_vec(), mask, theta, work),
        }
    }

    /// Start, Huber and GNC, then what follows.
    fn from(
        &mut self,
        start: &Values,
        mask: &[f64],
        theta: &mut Vec<f64>,
        work: &mut Workspace,
    ) -> (Minimum, Vec<f64>) {
        let model = self.model;
        let robust = &self.settings.robust;
        let mut weights = mask.to_vec();
        let mut minimum =
            self.minimize(start, &weights, theta, work, self.precision.between_rounds);
        if robust.enabled
            && minimum.status != SolveStatus::NotEvaluable
            && let Some((values, kept, iterations)) =
                clean(model, &minimum, mask, theta, robust, work)
        {
            self.iterations += iterations;
            minimum.values = values;
            weights = kept;
        }
        self.settled(minimum.values, weights, mask, theta, work)
    }

    /// Values, noise levels and gate in turn until the gate keeps the same set.
    fn settled(
        &mut self,
        start: Values,
        mut weights: Vec<f64>,
        mask: &[f64],
        theta: &mut Vec<f64>,
        work: &mut Workspace,
    ) -> (Minimum, Vec<f64>) {
        let (model, robust) = (self.model, &self.settings.robust);
        let mut minimum = self.with_noise(&start, &weights, theta, work);
        for round in 0..GATE_ROUNDS {
            if round > 0 {
                minimum = self.with_noise(&minimum.values, &weights, theta, work);
            }
            let ended = minimum.status == SolveStatus::NotEvaluable || self.left() == 0;
            if !robust.enabled || ended {
                break;
            }
            let objective = Objective {
                model,
                weights: &weights,
                theta,
            };
            match gate_beside(objective, &minimum.values, mask, robust, work) {
                Some(again) if again != weights => weights = again,
                _ => break,
            }
        }
        (minimum, weights)
    }

    fn minimize(
        &mut self,
        start: &Values,
        weights: &[f64],
        theta: &[f64],
        work: &mut Workspace,
        decrement: f64,
    ) -> Minimum {
        let own = self.settings.minimize;
        // What ends a fit is looked at once more.
        let ends = decrement <= self.last();
        let contraction = self.contraction.filter(|_| !ends);
        let settings = MinimizeSettings {
            decrement,
            contraction,
            max_iterations: own.max_iterations.min(self.left()),
            ..own
        };
        let objective = Objective {
            model: self.model,
            weights,
            theta,
        };
        let minimum = minimize_in(objective, start, &settings, work);
        self.iterations += minimum.iterations;
        self.contraction = both(self.contraction, minimum.contraction);
        minimum
    }

    /// Values and noise levels in turn until both stay.
    pub(super) fn with_noise(
        &mut self,
        start: &Values,
        weights: &[f64],
        theta: &mut Vec<f64>,
        work: &mut Workspace,
    ) -> Minimum {
        if self.settings.noise_rounds == 0 || !self.model.problem.groups.iter().any(|g| g.estimate)
        {
            return self.minimize(start, weights, theta, work, self.last());
        }
        let mut minimum = self.minimize(start, weights, theta, work, self.precision.between_rounds);
        for _ in 0..self.settings.noise_rounds {
            if minimum.status == SolveStatus::NotEvaluable || self.left() == 0 {
                break;
            }
            let objective = Objective {
                model: self.model,
                weights,
                theta,
            };
            let Some(Scoring {
                theta: next,
                change,
                relative_sigma,
                ..
            }) = score(objective, &minimum.values, work)
            else {
                break;
            };
            self.relative_sigma = relative_sigma;
            *theta = next;
            if change < self.precision.settled {
                break;
            }
            let decrement = self.precision.between_levels;
            minimum = self.minimize(&minimum.values, weights, theta, work, decrement);
        }
        self.minimize(&minimum.values, weights, theta, work, self.last())
    }
}
