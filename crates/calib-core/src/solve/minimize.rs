//! Levenberg–Marquardt with scaled columns and a cost-checked step.
//!
//! ```text
//! (H + λ S⁻²) δ = −g,   x ⊞ δ accepted when F falls;   stop when −gᵀδ (in σ²) vanishes          (1)
//! ```
//!
//! S holds the parameters' natural scales (prior σ, or 1°, 1 cm): what makes a linearization wrong is the size
//! of a step in degrees, not in units of the data's precision, so weakly seen directions are held back first.
//!
//! Directions that neither data nor prior see have zero gradient and stay where they start. A prior that is very wide says
//! nearly as little: along a gauge it would draw the values to its center in hundreds of short steps that change no
//! prediction. Such a slide is ended where it is, near the start: the data part of the step, `δᵀ(H − Λ)δ`, has vanished,
//! and what the priors could gain is far below a σ.
//!
//! Where residuals are large (missing physics) and a direction is held by a weak prior only, the curvature
//! `Σ e·∂²e` that Gauss–Newton leaves out decides along it, and Gauss–Newton creeps or overshoots. Once
//! progress is slow, K collects that curvature from the gradients met on the way (symmetric rank-one secant
//! update) and the step solves `(H + K + λ S⁻²) δ = −g`:
//!
//! ```text
//! v = (g₊ − g) − H₊ δ − K δ,   K ← K + v vᵀ/(vᵀδ)                                              (2)
//! ```
//!
//! The floor of such a valley is curved, and a long step along it leaves it. Where a step raises the cost, a second one from where it
//! led returns to the floor; both together are taken where they lower the cost:
//!
//! ```text
//! (H₊ + λ S⁻²) c = −g₊,   x ⊞ δ ⊞ c accepted when F falls                                        (3)
//! ```

use calib_geometry::decompose::dot;
use serde::{Deserialize, Serialize};

use crate::model::layout::Model;
use crate::model::values::Values;
use crate::solve::bounded::{Damped, bounded_step};
use crate::solve::contraction::{Contraction, both};
use crate::solve::curvature::Curvature;
use crate::solve::equations::{NormalEquations, Objective, Workspace};
use crate::solve::normal::{accumulate, cost};
use crate::solve::step::{damped_step, retract};

/// How the minimization ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SolveStatus {
    /// The gradient vanishes: a further step would change the fit by less than 1e-6 σ. Or what is left is to creep along a direction that hardly any
    /// data see, by less than 0.1 σ in all.
    Converged,
    /// No step lowers the cost although the gradient has not vanished: rounding, or a kink.
    Stalled,
    /// The allowed iterations did not suffice.
    MaxIterations,
    /// The model could not be evaluated at the start values.
    NotEvaluable,
}

impl SolveStatus {
    /// Whether the values can be used.
    #[must_use]
    pub fn is_converged(self) -> bool {
        self == Self::Converged
    }
}

/// Limits of the minimization.
///
/// Non-exhaustive: start from [`MinimizeSettings::default`] and change what differs.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct MinimizeSettings {
    /// Linearizations allowed; a coarse start takes 5–15.
    pub max_iterations: usize,
    /// Stop when the decrement −gᵀδ falls below this (units of σ²).
    pub decrement: f64,
    /// First damping λ: 1e-3 is a prior of 30 natural scales (30°, 30 cm) on the step.
    pub damping: f64,
    /// How steps contract, as minimizations that ended nearby showed: the linearization that would only confirm convergence is skipped.
    pub(crate) contraction: Option<Contraction>,
}

impl Default for MinimizeSettings {
    fn default() -> Self {
        Self {
            max_iterations: 100,
            decrement: 1e-12,
            damping: 1e-3,
            contraction: None,
        }
    }
}

/// Gauss–Newton is slow when the decrement falls by less than this factor per step…
const SLOW: f64 = 0.1;
/// …once the fit is within this squared distance (in σ²) of the minimum: farther away the curvature changes
/// from step to step and a secant of it misleads.
const NEAR: f64 = 1.0;

/// Priors that cost no more than this (in σ²) say nothing: it is all that sliding to their centers can gain…
const NOTHING: f64 = 1e-4;
/// …a slide gains less than this per step…
const SLIDE: f64 = 1e-6;
/// …and moves the predictions by less than this, squared: 1e-4 σ.
const UNSEEN: f64 = 1e-8;
/// A direction that a wide prior alone holds, far below the data's rounding (the height of a planar robot against its
/// tracker): the ridge lets Gauss–Newton creep along it, with a decrement that falls by no more than this factor per step.
const CREEPING: f64 = 0.8;
/// All that creeping on could gain (in σ²): a tenth of a σ of that prior…
const LITTLE: f64 = 1e-2;
/// …while no prediction moves by more than this, squared: 1e-3 σ.
const UNSEEN_IN_ALL: f64 = 1e-6;
/// Where the allowed steps are used up, it is enough that predictions would move by no more than this in all, squared: a tenth of what chance does
/// along any direction.
const UNSEEN_AT_LAST: f64 = 1e-2;
/// In a curved valley long steps alternate with short ones: a step is compared with the last one of the same damping, so many steps ago at most.
const PERIOD: usize = 4;
/// A prior wider than this many typical deviations does not say how far a linearization holds.
const WIDEST_SCALE: f64 = 30.0;
/// One wider than this many (300°, 3 m) says nothing: steps are as without it, and values stay where they start along gauges.
const SAYS_NOTHING: f64 = 300.0;

/// What became of a proposed step.
enum Step {
    /// Taken, and the minimum is reached with it.
    Last,
    Taken,
    /// However short, it does not lower the cost.
    None,
}

/// Least damping.
const MIN_DAMPING: f64 = 1e-12;
/// Damping beyond which a step is shorter than rounding.
const MAX_DAMPING: f64 = 1e16;
/// A rise of the cost by this fraction is rounding of its sum.
const COST_ROUNDING: f64 = 1e-13;

/// Where a minimization ended.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Minimum {
    /// Values of all parameters.
    pub values: Values,
    /// Why it ended.
    pub status: SolveStatus,
    /// Linearizations used.
    pub iterations: usize,
    /// eᵀV⁻¹e over the data.
    pub data_cost: f64,
    /// Squared prior deviations over their variances.
    pub prior_cost: f64,
    /// −gᵀδ of the last step: the squared distance to the minimum in units of σ.
    pub decrement: f64,
    /// How its steps contracted; `None`: none near the minimum was followed by another.
    pub(crate) contraction: Option<Contraction>,
}

/// Minimizes `eᵀV⁻¹e + prior` from `start` with given weights (one per observation) and variances
/// `theta` (σ² per noise group).
#[must_use]
pub fn minimize(
    model: &Model,
    start: &Values,
    weights: &[f64],
    theta: &[f64],
    settings: &MinimizeSettings,
) -> Minimum {
    let objective = Objective {
        model,
        weights,
        theta,
    };
    minimize_in(objective, start, settings, &mut Workspace::new(model))
}

pub(crate) fn minimize_in(
    objective: Objective,
    start: &Values,
    settings: &MinimizeSettings,
    work: &mut Workspace,
) -> Minimum {
    Descent::new(objective, start, settings).run(work)
}

/// The state of a minimization.
struct Descent<'a> {
    objective: Objective<'a>,
    settings: &'a MinimizeSettings,
    /// Diagonal of S⁻².
    natural: Vec<f64>,
    /// Diagonal of Λ.
    prior: Vec<f64>,
    bounded: bool,
    /// Without random effects V is constant: the next linearization delivers the cost to check.
    constant_noise: bool,
    values: Values,
    trial: Values,
    system: NormalEquations,
    next: NormalEquations,
    curvature: Curvature,
    factor: Vec<f64>,
    step: Vec<f64>,
    damping: f64,
    decrement: f64,
    /// The last accepted steps, the newest last.
    taken: Vec<Taken>,
    iterations: usize,
    evaluable: bool,
    contraction: Option<Contraction>,
    /// The damping was raised for the step that is proposed: it is shorter for that.
    raised: bool,
}

/// An accepted step.
#[derive(Clone, Copy)]
struct Taken {
    damping: f64,
    decrement: f64,
    /// δᵀ(H − Λ)δ.
    seen: f64,
}

impl<'a> Descent<'a> {
    fn new(objective: Objective<'a>, start: &Values, settings: &'a MinimizeSettings) -> Self {
        let model = objective.model;
        let n = model.free();
        let parameters = &model.problem.parameters;
        let columns = model.columns.iter();
        Self {
            objective,
            settings,
            natural: columns
                .clone()
                .map(|&p| {
                    let typical = parameters[p].unit.typical_deviation();
                    let scale = parameters[p].scale();
                    if scale > SAYS_NOTHING * typical {
                        typical.powi(-2)
                    } else {
                        scale.min(WIDEST_SCALE * typical).powi(-2)
                    }
                })
                .collect(),
            prior: columns
                .clone()
                .map(|&p| {
                    parameters[p]
                        .prior_sigma
                        .map_or(0.0, |sigma| sigma.powi(-2))
                })
                .collect(),
            bounded: columns.clone().any(|&p| parameters[p].bounds.is_some()),
            constant_noise: model.slots.is_empty(),
            values: start.clone(),
            trial: start.clone(),
            system: NormalEquations::new(n),
            next: NormalEquations::new(n),
            curvature: Curvature::new(n),
            factor: vec![0.0; n * n],
            step: vec![0.0; n],
            damping: settings.damping,
            decrement: f64::INFINITY,
            taken: Vec::new(),
            iterations: 1,
            evaluable: true,
            contraction: None,
            raised: false,
        }
    }

    fn run(mut self, work: &mut Workspace) -> Minimum {
        let objective = self.objective;
        self.evaluable = accumulate(objective, &self.values, work, &mut self.system);
        let status = loop {
            if !self.evaluable {
                break SolveStatus::NotEvaluable;
            }
            let current = self.system.cost();
            let before = self.decrement;
            match self.descend(work) {
                Step::Last => {
                    std::mem::swap(&mut self.values, &mut self.trial);
                    break SolveStatus::Converged;
                }
                Step::Taken => {
                    let step = self.as_taken();
                    self.taken.push(step);
                    self.damping = (self.damping * 0.1).max(MIN_DAMPING);
                    self.curvature.slow |= self.decrement < NEAR && self.decrement > SLOW * before;
                    self.curvature.learn(&self.system, &self.next, &self.step);
                    std::mem::swap(&mut self.values, &mut self.trial);
                    std::mem::swap(&mut self.system, &mut self.next);
                }
                // At the minimum of a cost that is only rounding (exact data) nothing can fall further.
                Step::None if self.decrement <= 1e-6 + current * 1e-9 => {
                    break SolveStatus::Converged;
                }
                Step::None => break SolveStatus::Stalled,
            }
            if self.iterations > self.settings.max_iterations {
                let last = self.taken.split_last();
                let creeps = last
                    .is_some_and(|(now, before)| creeps_for_little(*now, before, UNSEEN_AT_LAST));
                if creeps {
                    break SolveStatus::Converged;
                }
                break SolveStatus::MaxIterations;
            }
        };
        Minimum {
            values: self.values,
            status,
            iterations: self.iterations,
            data_cost: self.system.data,
            prior_cost: self.system.prior,
            decrement: self.decrement,
            contraction: self.contraction,
        }
    }

    /// One accepted step, with as much damping as it takes.
    fn descend(&mut self, work: &mut Workspace) -> Step {
        let before = self.decrement;
        self.raised = false;
        loop {
            if self.propose()
                && let Some(outcome) = self.judge(before, work)
            {
                return outcome;
            }
            if self.curvature.slow && self.decrement < NEAR && self.returns(work) {
                return Step::Taken;
            }
            self.curvature.slow |= self.decrement < NEAR;
            self.damping = (self.damping * 10.0).max(1e-3);
            self.raised = true;
            if self.damping > MAX_DAMPING {
                return Step::None;
            }
        }
    }

    /// Equation (3) after a step that raised the cost; `true` where both are taken.
    fn returns(&mut self, work: &mut Workspace) -> bool {
        if self.bounded || self.constant_noise {
            return false;
        }
        let objective = self.objective;
        self.iterations += 1;
        let mut both = self.step.clone();
        let mut taken = accumulate(objective, &self.trial, work, &mut self.next) && {
            let (next, natural) = (&self.next, &self.natural);
            let mut none = Curvature::new(next.n);
            let (factor, step) = (&mut self.factor, &mut self.step);
            damped_step(next, &mut none, natural, self.damping, factor, step)
        };
        if taken {
            let from = self.trial.clone();
            retract(objective.model, &from, &self.step, &mut self.trial);
            // With one V for both.
            let before = cost(objective, &self.values, work);
            taken = cost(objective, &self.trial, work) <= before;
        }
        for (both, back) in both.iter_mut().zip(&self.step) {
            *both += back;
        }
        self.step = both;
        let at = if taken { &self.trial } else { &self.values };
        self.evaluable = accumulate(objective, at, work, &mut self.next);
        taken
    }

    /// The step of (1), inside the bounds; `false` when the system cannot be solved.
    fn propose(&mut self) -> bool {
        let solved = damped_step(
            &self.system,
            &mut self.curvature,
            &self.natural,
            self.damping,
            &mut self.factor,
            &mut self.step,
        );
        let curvature = &self.curvature;
        solved
            && (!self.bounded
                || bounded_step(
                    self.objective.model,
                    &self.values,
                    &self.system,
                    Damped {
                        curvature: curvature.known.then_some(curvature.s.as_slice()),
                        natural: &self.natural,
                        damping: self.damping,
                    },
                    &mut self.step,
                ))
    }

    /// δᵀ(H − Λ)δ of the proposed step: how far it moves the predictions, in σ².
    fn seen_by_data(&self) -> f64 {
        let (n, h, step) = (self.system.n, &self.system.h, &self.step);
        let mut sum = 0.0;
        for i in 0..n {
            sum += (h[i * n + i] - self.prior[i]) * step[i] * step[i];
            for j in i + 1..n {
                sum += 2.0 * h[i * n + j] * step[i] * step[j];
            }
        }
        sum
    }

    /// The proposed step, as it is remembered once it is accepted.
    fn as_taken(&self) -> Taken {
        Taken {
            damping: self.damping,
            decrement: self.decrement,
            seen: self.seen_by_data().max(0.0),
        }
    }

    /// What becomes of the proposed step; `None` when it does not lower the cost. `before`: decrement of the step
    /// before.
    fn judge(&mut self, before: f64, work: &mut Workspace) -> Option<Step> {
        let objective = self.objective;
        let limit = self.system.cost() * (1.0 + COST_ROUNDING);
        let enough = self.settings.decrement;
        // −gᵀδ
        self.decrement = -dot(&self.system.g, &self.step);
        retract(objective.model, &self.values, &self.step, &mut self.trial);
        // The decrement falls at least in proportion: is the next one already small enough?
        let rate = if before.is_finite() {
            (self.decrement / before).min(1.0)
        } else {
            1.0
        };
        let expected = self.decrement * rate;
        if let Some(last) = self.taken.last()
            && !self.raised
        {
            let seen = Contraction::of(before, self.decrement, last.damping);
            self.contraction = both(self.contraction, seen);
        }
        let known = self
            .settings
            .contraction
            .filter(|_| !self.raised && !self.bounded);
        let left = known.and_then(|known| known.left(self.decrement, self.damping));
        let contracts = left.is_some_and(|left| left <= enough);
        let slides = || {
            let little = self.system.prior <= NOTHING && self.decrement <= SLIDE;
            little && rate > SLOW && self.seen_by_data() <= UNSEEN
        };
        let creeps = || creeps_for_little(self.as_taken(), &self.taken, UNSEEN_IN_ALL);
        let soon = self.constant_noise && expected <= enough;
        if self.decrement <= enough || soon || contracts || slides() || creeps() {
            let fallen = self.decrement <= enough || cost(objective, &self.trial, work) <= limit;
            fallen.then_some(Step::Last)
        } else if self.constant_noise {
            self.iterations += 1;
            let linearized = accumulate(objective, &self.trial, work, &mut self.next);
            (linearized && self.next.cost() <= limit).then_some(Step::Taken)
        } else if cost(objective, &self.trial, work) <= limit {
            self.iterations += 1;
            self.evaluable = accumulate(objective, &self.trial, work, &mut self.next);
            Some(Step::Taken)
        } else {
            None
        }
    }
}

/// Whether steps that shrink slowly lead nowhere that matters: the decrement falls by `rate` from each to the next of the same damping, and
/// the steps between them by as much. The sum of all that follow is δ/(1 − √rate) with δ over one such period; what they gain is half the
/// decrement over the same. `unseen`: how far predictions may move in all, squared, in σ².
fn creeps_for_little(now: Taken, taken: &[Taken], unseen: f64) -> bool {
    let recent = taken.iter().rev().take(PERIOD);
    let alike = |t: &Taken| (t.damping / now.damping).ln().abs() < 0.1;
    let Some(period) = recent.clone().position(alike) else {
        return false;
    };
    let before = taken[taken.len() - 1 - period];
    let rate = (now.decrement / before.decrement).min(1.0);
    let between = recent.take(period);
    let (gain, moved) = between.fold((now.decrement, now.seen.sqrt()), |(gain, moved), t| {
        (gain + t.decrement, moved + t.seen.max(0.0).sqrt())
    });
    let shrinks = 1.0 - rate.sqrt();
    rate > CREEPING && gain <= LITTLE * 2.0 * shrinks && moved <= unseen.sqrt() * shrinks
}

#[cfg(test)]
mod tests;
