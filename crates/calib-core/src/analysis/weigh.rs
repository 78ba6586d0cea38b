//! What is random from pose to pose, by evidence: nothing, the joints, the pose of each body.
//!
//! A random effect of each pose and physics that is not modeled look alike to a likelihood, but not to a prediction. Each
//! statement of the noise is fitted to the same kept observations with its own levels (REML), then every pose is left
//! out in turn with the weights held (C23):
//!
//! ```text
//! square_s(k)  = mean over vectors of |e₋ₛ|²                                                   (1)
//! surprise_s(k) = −log p(y_s | y₋ₛ)                                                            (2)
//! d̄ = mean_s [square_s(k) − square_s(white)],   its standard error over the poses (paired)     (3)
//! ```
//!
//! (1) decides which weights may be used. Equal weights trust no model of the robot, and neither does the pose of each body;
//! the joints' noise trusts the robot's Jacobian. Where it predicts worse than the better of the other two, or is larger than
//! joints scatter, it has swallowed physics, however likely it is. Among those that may be used and lie within two
//! standard errors of the least (2), one level for all joints is taken (one more for those that slide), else the smallest: equal weights where the poses do not show
//! how the joints scatter stated intervals that held in 92.8 % instead of 95 %. Where equal weights, or those of each body, are taken
//! all the same, the covariance is that of their estimate under the joints' noise that was found ([`sandwich`](crate::analysis::sandwich)).
//!
//! The gate of the robust fit is tried in the same way ([`admit`](crate::analysis::admit)): a model that physics is missing
//! from finds its hardest poses unlikely.

use std::collections::BTreeMap;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::analysis::admit::{
    Admission, eligible, is_harmed, left_out_squares, many_rejected, touched, wider,
};
use crate::analysis::looked_at::thinned;
use crate::analysis::refit::{Start, refit};
use crate::analysis::scores::{Scores, mean, paired};
use crate::analysis::settings::Settings;
use crate::analysis::solution::Solution;
use crate::analysis::validate::{CrossValidation, predictions};
use crate::graph::problem::{NoiseKind, NoiseModel, Problem};
use crate::model::layout::Model;
use crate::model::values::Values;
use crate::solve::equations::{Objective, Workspace};
use crate::solve::minimize::{MinimizeSettings, SolveStatus, minimize_in};
use crate::solve::noise::score;

/// A noise level of a candidate.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct NoiseLevel {
    /// Group.
    pub name: String,
    /// What it is.
    pub kind: NoiseKind,
    /// σ, m or rad.
    pub sigma: f64,
}

/// One statement of the noise, fitted and tried on left-out poses.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct NoiseCandidate {
    /// The statement.
    pub model: NoiseModel,
    /// Its levels.
    pub levels: Vec<NoiseLevel>,
    /// Root of the mean of (1): left-out error of a vector, m (rad where no positions are measured).
    pub left_out_rms: f64,
    /// `left_out_rms` over that of equal weights.
    pub against_white: f64,
    /// d̄ of (3) in units of its standard error: below −2 its weights predict better.
    pub worse_by_errors: f64,
    /// Mean of (2) minus the least among the candidates, nats per pose.
    pub surprise: f64,
    /// Standard error of `surprise` over the poses (paired with the least).
    pub surprise_error: f64,
    /// Its weights predict no worse than those that trust no model of the robot.
    pub admitted: bool,
}

/// Which statement of the noise was taken, and against which.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct NoiseChoice {
    /// In order of growth, equal weights first.
    pub candidates: Vec<NoiseCandidate>,
    /// The one that was taken.
    pub chosen: NoiseModel,
    /// The likeliest of all, where it was not admitted and is likelier than all that were: residuals of a pose belong
    /// together, by more than joints scatter or with weights that predict worse.
    pub swallowed: Option<NoiseModel>,
    /// Left-out poses.
    pub poses: usize,
    /// What became of the vectors that the gate had rejected; `None` where they were no more than chance rejects.
    pub admission: Option<Admission>,
}

/// The noise that was chosen, and the solution under it.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Weighed {
    /// The candidates.
    pub choice: NoiseChoice,
    /// The solution under the choice; `None` where it is the one that was given.
    pub solution: Option<Solution>,
}

/// Fewer left-out poses do not tell noise models apart.
const FEWEST: usize = 10;
/// Below this ratio of rms errors nobody can tell weights apart.
const SAME: f64 = 1.005;
/// A larger statement must be likelier by this many standard errors. With one, every second robot whose joints are alike is
/// given a level for each of them; with two, one in thirty.
const SHOWN: f64 = 2.0;
/// Chance that clean poses are said to hide physics in their noise.
const CHANCE: f64 = 1e-3;
/// Levels of a candidate have settled when a further step would make the observations likelier by less, nats.
const SETTLED: f64 = 0.05;
/// Statements that trust no model of the robot.
const SAFE: [NoiseModel; 2] = [NoiseModel::White, NoiseModel::BodyPose];
/// Statements that trust the model of the robot: one level for all joints that turn, one more for all that slide.
const JOINTS: [NoiseModel; 2] = [NoiseModel::Joint, NoiseModel::JointAndSlide];
/// No joint that is measured at rest scatters by more than this, rad or m: 1 mm at a meter. Backlash and compliance do, but not at
/// random, and weights that take them for noise predict other postures worse than left-out poses show.
const JOINT_NOISE: f64 = 1e-3;
/// Steps of scoring of a candidate at most.
const ROUNDS: usize = 12;

impl Solution {
    /// The noise from pose to pose that the observations speak for, among `models`, and what of the rejected takes part
    /// under it. This solution must be one of [`NoiseModel::Joint`]. `None` where there are too few poses or no two
    /// candidates.
    #[must_use]
    pub fn weighed(&self, models: &[NoiseModel], settings: &Settings) -> Option<Weighed> {
        let mut weights = self.weights.clone();
        let stated = self.model.problem();
        let (mut trials, mut choice) = self.fitted().tried(stated, models, &weights)?;
        let eligible = eligible(&self.model, &self.rejected);
        let rejected = settings
            .robust
            .enabled
            .then(|| many_rejected(&weights, &eligible))
            .flatten();
        if let Some(rejected) = rejected {
            let bodies = trials.iter().find(|t| t.noise == NoiseModel::BodyPose);
            let safe = bodies.or(trials.iter().find(|t| t.noise == NoiseModel::White))?;
            let (admission, more) = self.admitted(safe, &eligible, rejected)?;
            if let Some(more) = more {
                weights = more;
                (trials, choice) = self.fitted().tried(stated, models, &weights)?;
            }
            choice.admission = Some(admission);
        }
        if choice.chosen == NoiseModel::Joint && weights == self.weights {
            let solution = None;
            return Some(Weighed { choice, solution });
        }
        let chosen = trials.iter().find(|t| t.noise == choice.chosen)?;
        let start = Start {
            values: self.values.clone(),
            weights,
            theta: chosen.theta.clone(),
            iterations: self.iterations,
        };
        let solution = refit(chosen.model.problem(), start, settings).ok()?;
        // Weights that trust no model of the robot do not make its joints stand still.
        let joints = trials
            .iter()
            .find(|t| t.noise == NoiseModel::Joint && t.is_of_joints())
            .filter(|_| SAFE.contains(&choice.chosen));
        let wider = joints.and_then(|t| solution.with_noise_of(&t.model, &t.theta));
        let solution = Some(wider.unwrap_or(solution));
        Some(Weighed { choice, solution })
    }

    fn fitted(&self) -> Fitted<'_> {
        Fitted {
            objective: self.objective(),
            values: &self.values,
        }
    }

    /// Whether the predictions of all poses gain by what the gate rejected, under noise that trusts no model of the robot, and
    /// those that had lost nothing are not the price; the weights with it where so.
    fn admitted(
        &self,
        safe: &Trial,
        eligible: &[f64],
        rejected: usize,
    ) -> Option<(Admission, Option<Vec<f64>>)> {
        let everything = thinned(&self.model, eligible);
        let among = |weights: &[f64]| -> Vec<f64> {
            let pairs = weights.iter().zip(&everything);
            pairs.map(|(w, e)| w.min(*e)).collect()
        };
        let squares = |weights: &[f64]| {
            let weights = among(weights);
            let (mut theta, mut work) = (safe.theta.clone(), Workspace::new(&safe.model));
            let values = settle(&safe.model, &self.values, &weights, &mut theta, &mut work)?;
            let objective = Objective {
                model: &safe.model,
                weights: &weights,
                theta: &theta,
            };
            left_out_squares(objective, &values, &everything)
        };
        let before = squares(&self.weights)?;
        let touched = touched(&safe.model, &self.weights, eligible);
        let objective = Objective {
            model: &safe.model,
            weights: &self.weights,
            theta: &safe.theta,
        };
        let mut work = Workspace::new(&safe.model);
        let mut out = Admission {
            rejected,
            readmitted: 0,
            ratio: 1.0,
            better_by_errors: 0.0,
        };
        let mut taken = None;
        for wider in wider(objective, &self.values, eligible, &mut work) {
            let Some(after) = squares(&wider.weights) else {
                continue;
            };
            let both: BTreeMap<usize, (f64, f64)> = before
                .iter()
                .filter_map(|(sample, b)| Some((*sample, (*after.get(sample)?, *b))))
                .collect();
            if is_harmed(&both, &touched) {
                continue;
            }
            let (with, without): (Vec<f64>, Vec<f64>) = both.into_values().unzip();
            let (more, error) = paired(&with, &without);
            let ratio = (mean(&with) / mean(&without).max(f64::MIN_POSITIVE)).sqrt();
            if ratio < out.ratio / SAME && -more > error {
                out.readmitted = wider.readmitted;
                out.ratio = ratio;
                out.better_by_errors = -more / error;
                taken = Some(wider.weights);
            }
        }
        Some((out, taken))
    }
}

/// Where a fit ended, as far as what is random from pose to pose needs it.
#[derive(Clone, Copy)]
pub(crate) struct Fitted<'a> {
    /// With the weights of what it kept and the levels that it found.
    pub objective: Objective<'a>,
    pub values: &'a Values,
}

impl Fitted<'_> {
    /// The noise from pose to pose whose weights may be used on the observations that this fit kept: that of the joints where
    /// it predicts no worse than equal weights, else the chosen one. `stated` is the problem with [`NoiseModel::Joint`]. `None` as in
    /// [`weighed`](Solution::weighed).
    pub(crate) fn noise_of(&self, stated: &Problem) -> Option<NoiseModel> {
        let (_, choice) = self.tried(stated, &NoiseModel::ALL, self.objective.weights)?;
        let mut candidates = choice.candidates.iter();
        let of_joints = candidates.any(|c| c.model == NoiseModel::Joint && c.admitted);
        Some(if of_joints {
            NoiseModel::Joint
        } else {
            choice.chosen
        })
    }

    /// Every candidate, fitted to the kept observations of some poses, and the choice among them.
    fn tried(
        &self,
        problem: &Problem,
        models: &[NoiseModel],
        weights: &[f64],
    ) -> Option<(Vec<Trial>, NoiseChoice)> {
        // One statement alone is no choice.
        let can_be = |model: &&NoiseModel| problem.with_noise_model(**model).is_some();
        models.iter().filter(can_be).nth(1)?;
        let thinned = thinned(self.objective.model, weights);
        let mut trials: Vec<Trial> = models
            .par_iter()
            .filter_map(|&model| Trial::new(problem, model, *self, &thinned))
            .collect();
        trials.sort_by_key(|t| t.noise);
        let choice = choose(&trials)?;
        Some((trials, choice))
    }
}

/// One candidate, fitted to the thinned poses.
struct Trial {
    noise: NoiseModel,
    model: Model,
    theta: Vec<f64>,
    loo: CrossValidation,
}

impl Trial {
    fn new(
        problem: &Problem,
        noise: NoiseModel,
        reference: Fitted,
        weights: &[f64],
    ) -> Option<Self> {
        let model = Model::new(&problem.with_noise_model(noise)?).ok()?;
        let mut theta = start_levels(&model, reference.objective);
        let mut work = Workspace::new(&model);
        // The fit itself is one of the candidates.
        let itself = noise == NoiseModel::Joint
            && std::ptr::eq(problem, reference.objective.model.problem())
            && weights == reference.objective.weights;
        let values = if itself {
            reference.values.clone()
        } else {
            settle(&model, reference.values, weights, &mut theta, &mut work)?
        };
        let objective = Objective {
            model: &model,
            weights,
            theta: &theta,
        };
        let loo = predictions(objective, &values, weights, true, &|_| true)?;
        Some(Self {
            noise,
            model,
            theta,
            loo,
        })
    }

    /// Its joint noise can be noise of joints.
    fn is_of_joints(&self) -> bool {
        let mut joints = self.levels().into_iter().filter(|l| l.kind.is_of_joints());
        joints.all(|l| l.sigma <= JOINT_NOISE)
    }

    fn levels(&self) -> Vec<NoiseLevel> {
        let groups = self.model.problem.groups.iter().zip(&self.theta);
        let used = groups.filter(|(group, _)| group.estimate || group.kind != NoiseKind::Joint);
        used.map(|(group, theta)| NoiseLevel {
            name: group.name.clone(),
            kind: group.kind,
            sigma: theta.sqrt(),
        })
        .collect()
    }
}

/// σ² of every group: as found where the reference has it, else the joints' for a joint, else as stated.
fn start_levels(model: &Model, reference: Objective) -> Vec<f64> {
    let groups = reference.model.problem.groups.iter();
    let mut known = groups.zip(reference.theta);
    let joint = known.find(|(group, _)| group.kind == NoiseKind::Joint);
    let joint = joint.map(|(_, theta)| *theta);
    let groups = model.problem.groups.iter().enumerate();
    groups
        .map(|(g, group)| {
            let found = reference.theta.get(g).copied();
            let of_joint = joint.filter(|_| group.kind == NoiseKind::Joint);
            found.or(of_joint).unwrap_or(group.sigma * group.sigma)
        })
        .collect()
}

/// Values and levels together, from where they are.
fn settle(
    model: &Model,
    start: &Values,
    weights: &[f64],
    theta: &mut Vec<f64>,
    work: &mut Workspace,
) -> Option<Values> {
    levels(model, start, weights, theta, work);
    let values = values_at(model, start, weights, theta, work)?;
    levels(model, &values, weights, theta, work);
    Some(values)
}

/// Levels at fixed values.
fn levels(
    model: &Model,
    values: &Values,
    weights: &[f64],
    theta: &mut Vec<f64>,
    work: &mut Workspace,
) {
    for _ in 0..ROUNDS {
        let objective = Objective {
            model,
            weights,
            theta,
        };
        let Some(next) = score(objective, values, work) else {
            return;
        };
        *theta = next.theta;
        if next.gain < SETTLED {
            return;
        }
    }
}

/// Values at fixed levels.
fn values_at(
    model: &Model,
    start: &Values,
    weights: &[f64],
    theta: &[f64],
    work: &mut Workspace,
) -> Option<Values> {
    /// Values need not be better than 1 % of σ to tell noise models apart.
    const NEAR: MinimizeSettings = MinimizeSettings {
        max_iterations: 20,
        decrement: 1e-4,
        damping: 1e-6,
        contraction: None,
    };
    let objective = Objective {
        model,
        weights,
        theta,
    };
    let minimum = minimize_in(objective, start, &NEAR, work);
    (minimum.status != SolveStatus::NotEvaluable).then_some(minimum.values)
}

fn choose(trials: &[Trial]) -> Option<NoiseChoice> {
    let white = trials.iter().position(|t| t.noise == NoiseModel::White)?;
    if trials.len() < 2 {
        return None;
    }
    let scores = Scores::of(&trials.iter().map(|t| &t.loo).collect::<Vec<_>>());
    let poses = scores.squares[white].len();
    if poses < FEWEST {
        return None;
    }
    let least = |among: &dyn Fn(usize) -> bool| {
        let of = |i: &usize| mean(&scores.surprises[*i]);
        let allowed = (0..trials.len()).filter(|i| among(*i));
        allowed.min_by(|a, b| of(a).total_cmp(&of(b)))
    };
    let likeliest = least(&|_| true)?;
    let rms: Vec<f64> = scores.squares.iter().map(|s| mean(s).sqrt()).collect();
    let least_of = |among: &[NoiseModel]| {
        let of = (0..trials.len()).filter(|&i| among.contains(&trials[i].noise));
        of.map(|i| rms[i]).fold(f64::INFINITY, f64::min)
    };
    let candidates: Vec<NoiseCandidate> = (0..trials.len())
        .map(|i| {
            let (worse, error) = paired(&scores.squares[i], &scores.squares[white]);
            let (surprise, surprise_error) =
                paired(&scores.surprises[i], &scores.surprises[likeliest]);
            NoiseCandidate {
                model: trials[i].noise,
                levels: trials[i].levels(),
                left_out_rms: rms[i],
                against_white: rms[i] / rms[white].max(f64::MIN_POSITIVE),
                worse_by_errors: if error > 0.0 { worse / error } else { 0.0 },
                surprise,
                surprise_error,
                admitted: match trials[i].noise {
                    NoiseModel::White => true,
                    NoiseModel::BodyPose => rms[i] <= SAME * rms[white],
                    NoiseModel::Joint | NoiseModel::JointAndSlide => {
                        rms[i] <= SAME * least_of(&SAFE) && trials[i].is_of_joints()
                    }
                    NoiseModel::JointEach => {
                        rms[i] <= SAME * least_of(&[SAFE, JOINTS].concat())
                            && trials[i].is_of_joints()
                    }
                },
            }
        })
        .collect();
    let best = least(&|i| candidates[i].admitted)?;
    let within = |i: &usize| {
        let (more, error) = paired(&scores.surprises[*i], &scores.surprises[best]);
        candidates[*i].admitted && more <= SHOWN * error
    };
    // All joints scatter, however little, and a level that the poses cannot tell from none costs nothing but wider intervals.
    let mut joints = JOINTS
        .iter()
        .filter_map(|noise| trials.iter().position(|t| t.noise == *noise));
    let chosen = joints
        .find(within)
        .or_else(|| (0..trials.len()).find(within))?;
    let (less, error) = paired(&scores.surprises[best], &scores.surprises[likeliest]);
    // The levels themselves were found from all poses: as many more of them as chance makes likelier are no evidence.
    let more = candidates[likeliest].levels.len() as f64 - candidates[best].levels.len() as f64;
    let by_chance =
        ChiSquared::new(more.max(1.0)).map_or(f64::INFINITY, |c| c.inverse_cdf(1.0 - CHANCE));
    let shown = less > SHOWN * error && 2.0 * less * poses as f64 > by_chance;
    let swallowed = !candidates[likeliest].admitted && shown;
    Some(NoiseChoice {
        chosen: trials[chosen].noise,
        swallowed: swallowed.then_some(trials[likeliest].noise),
        candidates,
        poses,
        admission: None,
    })
}
