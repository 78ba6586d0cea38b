//! What the gate of the robust fit left out, by evidence: gross errors, or the hardest poses of a model that physics is
//! missing from.
//!
//! The fit is repeated with a wider gate and with none, and every pose is left out in turn; all its measurements are
//! predicted, those that took no part included:
//!
//! ```text
//! δ₋ₛ = C Aᵀ (I − Q)⁻¹ w,   e₋ₛ = e + J δ₋ₛ      (A, w: what took part of the pose; J, e: all of it)      (1)
//! ```
//!
//! A gross error cannot be predicted, and takes the predictions of others with it: with it they are worse. A pose that the
//! model merely describes badly is predicted better where others like it take part.
//!
//! Gross errors that are alike predict each other: a body that was knocked before a recording gains by readmission there, far more
//! than all other poses lose. What makes the poses worse that had lost nothing is therefore not readmitted, whatever the sum says, where these
//! are the most.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};
use statrs::distribution::{Binomial, DiscreteCDF};

use crate::analysis::refit::{Start, refit};
use crate::analysis::settings::Settings;
use crate::analysis::solution::Solution;
use crate::model::cache::State;
use crate::model::layout::Model;
use crate::model::path::Derivatives;
use crate::model::values::Values;
use crate::solve::equations::{NormalEquations, Objective, Workspace};
use crate::solve::normal::accumulate;
use crate::solve::predicted::uncontradicted;
use crate::solve::robust::{RejectReason, Rejection, RobustSettings, gate_of};
use crate::solve::whitened::{covariance_of, whitened};

/// What became of the rejected vectors.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Admission {
    /// Vectors that the gate had rejected.
    pub rejected: usize,
    /// Vectors that take part after all.
    pub readmitted: usize,
    /// Left-out error of all poses (rms) with them, over that without them.
    pub ratio: f64,
    /// Standard errors by which the mean square is less with them (paired over the poses).
    pub better_by_errors: f64,
}

/// Weights of the observations with a wider gate.
pub(crate) struct Wider {
    pub weights: Vec<f64>,
    pub readmitted: usize,
}

/// A distance beyond the gate by this factor belongs to no tail.
const WIDE: f64 = 2.5;

/// Poses that had lost nothing are not predicted worse than by this factor (rms) for the sake of others…
const HARM: f64 = 1.5;
/// …where those are no more than this share of all. Where they are more, as behind a step in the middle of the recordings, nothing tells
/// which side is right, and what looks for changes has to see both.
const FEW: f64 = 0.2;

impl Solution {
    /// Whether a fit that knows the uncertainty of its predictions keeps something that this one rejected.
    #[must_use]
    pub fn would_keep_more(&self, settings: &Settings) -> bool {
        if self.rejected.is_empty() || !settings.robust.enabled || !settings.robust.uncontradicted {
            return false;
        }
        let mask = eligible(&self.model, &[]);
        let mut work = Workspace::new(&self.model);
        let parts = (&mask[..], &self.weights[..]);
        let robust = &settings.robust;
        uncontradicted(self.objective(), &self.values, parts, robust, &mut work).is_some()
    }

    /// Whether the gate rejected single observations only, and so many or more of good ones are rejected in more than one fit of ten: there is nothing
    /// to explain.
    #[must_use]
    pub fn rejects_by_chance(&self, settings: &Settings) -> bool {
        /// Chance of so many or more.
        const USUAL: f64 = 0.1;
        let reasons = self.rejected.iter().map(|r| r.reason);
        let reasons: Vec<RejectReason> =
            reasons.filter(|r| *r != RejectReason::Occlusion).collect();
        if reasons.iter().any(|r| *r != RejectReason::Outlier) {
            return false;
        }
        let rejected = reasons.len() as u64;
        let mask = eligible(&self.model, &[]);
        let all = mask.iter().filter(|w| **w > 0.0).count() as u64;
        let of = Binomial::new(1.0 - settings.robust.gate, all.max(rejected));
        // P(X ≥ k) = 1 − P(X ≤ k − 1)
        rejected == 0 || of.is_ok_and(|of| of.sf(rejected - 1) > USUAL)
    }
}

impl Solution {
    /// This fit with what another kept of the same observations, of which each rejects its own: what a model with more effects explains is no
    /// gross error of this one. `None` where that is nothing more, and where the other has other observations.
    #[must_use]
    pub fn with_kept_of(&self, other: &Solution, settings: &Settings) -> Option<Solution> {
        let places = |of: &Solution| -> Vec<(usize, usize, usize)> {
            let observations = of.model.observations.iter();
            let place = observations.map(|o| (o.sample, o.measurement, o.item));
            place.collect()
        };
        if places(self) != places(other) {
            return None;
        }
        let pairs = self.weights.iter().zip(&other.weights);
        let weights: Vec<f64> = pairs.map(|(own, theirs)| own.max(*theirs)).collect();
        if weights == self.weights {
            return None;
        }
        let start = Start {
            values: self.values.clone(),
            weights,
            theta: self.theta.clone(),
            iterations: self.iterations,
        };
        refit(self.model.problem(), start, settings).ok()
    }
}

/// Every observation that may take part: not held out, and not where another marker should be.
pub(crate) fn eligible(model: &Model, rejected: &[Rejection]) -> Vec<f64> {
    let swapped: BTreeSet<(usize, usize)> = rejected
        .iter()
        .filter(|r| r.reason == RejectReason::Swap)
        .map(|r| (r.measurement.index(), r.item))
        .collect();
    let observations = model.observations.iter();
    observations
        .map(|o| {
            let out = model.is_held_out(o.sample) || swapped.contains(&(o.measurement, o.item));
            f64::from(u8::from(!out))
        })
        .collect()
}

/// More was rejected than chance explains, three times over.
pub(crate) fn many_rejected(weights: &[f64], eligible: &[f64]) -> Option<usize> {
    let pairs = || weights.iter().zip(eligible).filter(|(_, e)| **e > 0.0);
    let rejected = pairs().filter(|(w, _)| **w == 0.0).count();
    let chance = (1.0 - RobustSettings::default().gate) * pairs().count() as f64;
    (rejected as f64 > 2.0 + 3.0 * chance).then_some(rejected)
}

/// Samples with an eligible observation that takes no part.
pub(crate) fn touched(model: &Model, weights: &[f64], eligible: &[f64]) -> BTreeSet<usize> {
    let lost = weights.iter().zip(eligible).map(|(w, e)| w < e);
    let observations = model.observations.iter().zip(lost);
    observations
        .filter(|(_, lost)| *lost)
        .map(|(o, _)| o.sample)
        .collect()
}

/// Whether the poses that had lost nothing are predicted worse by [`HARM`] for the sake of [`FEW`]; `both` has (1) squared by sample,
/// with and without what was rejected.
pub(crate) fn is_harmed(both: &BTreeMap<usize, (f64, f64)>, touched: &BTreeSet<usize>) -> bool {
    let whole = both.iter().filter(|(sample, _)| !touched.contains(sample));
    let sums = whole.fold((0, 0.0, 0.0), |sum, (_, square)| {
        (sum.0 + 1, sum.1 + square.0, sum.2 + square.1)
    });
    let few = sums.0 as f64 >= (1.0 - FEW) * both.len() as f64;
    few && sums.1 > HARM * HARM * sums.2
}

/// The wider gate, and none.
pub(crate) fn wider(
    objective: Objective,
    values: &Values,
    eligible: &[f64],
    work: &mut Workspace,
) -> Vec<Wider> {
    let Objective {
        model,
        weights,
        theta,
    } = objective;
    let passed = gate_of(model, values, theta, eligible, WIDE, work);
    let mut out: Vec<Wider> = Vec::new();
    for set in passed.into_iter().chain([eligible.to_vec()]) {
        let union: Vec<f64> = set.iter().zip(weights).map(|(a, b)| a.max(*b)).collect();
        let more = union.iter().zip(weights).filter(|(a, b)| **a > **b);
        let readmitted = more.count();
        if readmitted > 0 && out.iter().all(|w| w.readmitted != readmitted) {
            out.push(Wider {
                weights: union,
                readmitted,
            });
        }
    }
    out
}

/// Mean square of (1) over the vectors of each pose; those of `everything` are predicted, those of the objective take part.
pub(crate) fn left_out_squares(
    objective: Objective,
    values: &Values,
    everything: &[f64],
) -> Option<BTreeMap<usize, f64>> {
    /// An eigenvalue of I − Q below this: the pose alone determines something.
    const LEVERAGE_LEFT: f64 = 1e-9;
    let model = objective.model;
    let n = model.free();
    let mut work = Workspace::new(model);
    let mut system = NormalEquations::new(n);
    if !accumulate(objective, values, &mut work, &mut system) {
        return None;
    }
    let c = covariance_of(&system)?;
    let mut out = BTreeMap::new();
    for sample in 0..model.problem.samples {
        let mut step = DVector::zeros(n);
        if let Some(s) = whitened(objective, values, sample, &mut work) {
            let (ac, taken) = s.a.between(&c);
            let left = DMatrix::identity(s.w.len(), s.w.len()) - taken;
            let eigen = calib_geometry::decompose::symmetric_eigen(&left);
            if eigen.values[0] < LEVERAGE_LEFT {
                continue;
            }
            let along = eigen.vectors.tr_mul(&s.w).component_div(&eigen.values);
            step = ac.tr_mul(&(&eigen.vectors * along));
        }
        if let Some(square) = mean_square(model, values, everything, sample, &step, &mut work) {
            out.insert(sample, square);
        }
    }
    Some(out)
}

/// Mean square of e + J δ over the vectors of a pose.
fn mean_square(
    model: &Model,
    values: &Values,
    everything: &[f64],
    sample: usize,
    step: &DVector<f64>,
    work: &mut Workspace,
) -> Option<f64> {
    let Workspace { cache, rows, .. } = work;
    let at = State::new(&model.problem, cache, values);
    rows.fill(model, at, everything, sample, Derivatives::All);
    let n = rows.n;
    let (mut sum, mut count) = (0.0, 0);
    for &(o, first, length) in &rows.blocks {
        let e: Vec<f64> = (first..first + length)
            .map(|i| {
                let j = &rows.j[i * n..(i + 1) * n];
                rows.r[i] + j.iter().zip(step.iter()).map(|(a, b)| a * b).sum::<f64>()
            })
            .collect();
        let kind = &model.problem.measurements[model.observations[o].measurement].kind;
        let deviation = kind.of().deviation(&e);
        sum += deviation
            .position
            .or(deviation.rotation)
            .unwrap_or(0.0)
            .powi(2);
        count += 1;
    }
    (count > 0).then(|| sum / f64::from(count))
}
