//! Which parts a model should have: forward selection by prediction.
//!
//! ```text
//! l_s = e₋ₛᵀ D⁻¹ e₋ₛ / rows,   e₋ₛ: sample s predicted from the others                               (1)
//! gain = mean_s (l_s without − l_s with),  ± its standard error over samples (paired)                (2)
//! p m / (k + 1) ≤ α:   the score test asks for a part, of m that were tested, after k were found      (3)
//! ```
//!
//! D is the covariance of the measurements alone, at the levels that the first model finds: all models are compared by the same measure, and
//! what a model calls noise of the joints does not make its errors smaller.
//!
//! At each step every part that the model lacks is scored and its prediction errors computed in one linearization. Of those that (3) lets
//! pass the one with the smallest mean of (1) is taken, or another one that explains the same and predicts alike, with more evidence or simpler. The model with it is fitted in full,
//! outliers and noise levels included, and stays if (2) exceeds its standard error. A group (an effect of all joints) is a way to see what no member
//! shows alone: of its members, those stay that save half a standard error. In the end, parts are exchanged for others that
//! explain more now that the rest is known, and those that later ones made needless are removed.
//!
//! A robust fit takes for gross errors what a missing part does to the rows that show it, and where it rejected them nothing asks for the part. Where
//! no part makes the model better and more was rejected than chance explains, (3) is therefore asked once more with all rows; whether a part
//! stays is decided by the fits in full and their predictions as before.
//!
//! The error to be stated for a model that was so chosen comes from folds: the whole choice is made again without each fold, which it then predicts.

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};

use crate::analysis::settings::Settings;
use crate::graph::error::Error;
use crate::graph::ids::ParameterId;
use crate::graph::problem::Problem;

mod exact;
mod less;
mod linear;
mod nested;
mod path;
mod sample;
mod stack;
mod step;
mod sums;
mod task;
mod widen;

/// Something that a model can have: parameters that are free together.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Part {
    /// Its parameters. Parts may share some: a group and its members.
    pub parameters: Vec<ParameterId>,
    /// Of two parts that explain the same with as many parameters, the one with the smaller number is taken: the more common in robots.
    pub place: u8,
}

/// How parts are chosen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SelectionRule {
    /// α of equation (3).
    pub significance: f64,
    /// Samples that are left out in turn at most, evenly over all of them.
    pub samples: usize,
    /// Folds that the whole choice is repeated without.
    pub folds: usize,
    /// Parts that are added at most.
    pub steps: usize,
    /// What is random from pose to pose is chosen by evidence, first and whenever parts were added; otherwise it is as the
    /// problem states it.
    pub noise_by_evidence: bool,
}

impl Default for SelectionRule {
    fn default() -> Self {
        Self {
            // Chance adds a part in less than three of a hundred robots that lack none.
            significance: 0.03,
            samples: 500,
            folds: 5,
            steps: 40,
            noise_by_evidence: true,
        }
    }
}

/// Why a step ended as it did.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum StepOutcome {
    /// The part is in the model.
    Added,
    /// It predicts no better by one standard error, fitted in full.
    NoBetter,
    /// It was added, and later parts made it needless.
    Removed,
    /// The score test does not ask for it.
    NotSignificant,
}

/// One part that was looked at.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct SelectionStep {
    /// Place among the parts.
    pub part: usize,
    /// Parameters that it adds.
    pub parameters: usize,
    /// Degrees of freedom of the score test.
    pub rank: usize,
    /// Statistic of the score test, ~ χ²(rank) where the robot lacks the part.
    pub z2: f64,
    /// p of equation (3), corrected.
    pub p_corrected: f64,
    /// Left-out position error, root mean square over all vectors, m: before and after.
    pub rms: (f64, f64),
    /// Equation (2), relative to the mean loss without it, and its standard error.
    pub gain: (f64, f64),
    /// Parts that explain the same and predict alike.
    pub alike: Vec<usize>,
    /// Of a group: its members that stay.
    pub members: Vec<usize>,
    /// Parts that were exchanged for others once all was known: (out, in).
    pub exchanged: Vec<(usize, usize)>,
    /// How it ended.
    pub outcome: StepOutcome,
}

/// Errors of models that were chosen without what they predict.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct NestedError {
    /// Folds.
    pub folds: usize,
    /// Position error of the models that the folds chose, root mean square over all vectors, m.
    pub rms: f64,
    /// The same of the first model, nothing chosen.
    pub rms_first: f64,
    /// The same of the model that all samples chose, fitted without each fold.
    pub rms_chosen: f64,
    /// Standard error of `rms² − rms_chosen²` over the folds, m².
    pub lost_error: f64,
    /// In how many folds each part was added.
    pub added: Vec<usize>,
}

/// What was chosen, and how.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Selection {
    /// Parts of the model: those of the first model and those that were added.
    pub parts: BTreeSet<usize>,
    /// Parts that were looked at, in this order.
    pub steps: Vec<SelectionStep>,
    /// Parts of the first model that its predictions do not need.
    pub unsupported: Vec<usize>,
    /// Parts of the first model and of the others that could be tested.
    pub tested: usize,
    /// Left-out position error of the first and of the last model, root mean square, m.
    pub rms: (f64, f64),
    /// Parameters that the data determine, in the first and in the last model.
    pub ranks: (usize, usize),
    /// Errors in folds; `None` where there are too few samples.
    pub nested: Option<NestedError>,
    /// Values of all parameters in the last model.
    pub values: Vec<f64>,
    /// σ² per noise group in the last model; empty where its noise from pose to pose is not as the problem states it.
    pub levels: Vec<f64>,
}

/// Chooses among `parts`, from a model that has those of `first`. `problem` has all parts free; `progress` is told what was
/// done: fits in full.
///
/// # Errors
/// [`Error`] when the problem cannot be stated or evaluated.
pub fn select(
    problem: &Problem,
    parts: &[Part],
    first: &BTreeSet<usize>,
    settings: &Settings,
    rule: &SelectionRule,
    progress: &mut dyn FnMut(usize),
) -> Result<Selection, Error> {
    path::select(
        &task::Task {
            problem,
            parts,
            first,
            settings,
            rule,
        },
        progress,
    )
}
