//! Prediction errors: each sample left out in turn without refitting, and samples held out.
//!
//! ```text
//! left out:   e₋ = L (I − Q)⁻¹ w,      Cov(e₋) = L (I − Q)⁻¹ Lᵀ,    Q = A C Aᵀ               (1)
//! held out:   e = predicted ⊟ observed, Cov(e) = V + J C Jᵀ                                 (2)
//! z² = eᵀ Cov⁻¹ e  ~  χ²(rows)                                                             (3)
//! all held out:   Σ_s wᵀw − gᵀ(C⁻¹ + H)⁻¹g  ~  χ²,   g = Σ_s Aᵀw,   H = Σ_s AᵀA             (4)
//! ```
//!
//! Equation (1) is exact for a linear model and equals refits to second order in the residuals otherwise.

use std::collections::BTreeSet;
use std::ops::Range;

use calib_geometry::decompose::{cholesky_in_place, lower_inverse, solve_in_place};
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

use crate::analysis::solution::Solution;
use crate::graph::ids::MeasurementId;
use crate::graph::problem::NoiseKind;
use crate::model::layout::{Model, Observation};
use crate::model::values::Values;
use crate::solve::chunks::chunked;
use crate::solve::equations::{NormalEquations, Objective, Workspace};
use crate::solve::normal::accumulate;
use crate::solve::rows::add_block;
use crate::solve::whitened::{Whitened, covariance_of, whitened};

/// Prediction of one sample from the others.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct SamplePrediction {
    /// Sample.
    pub sample: usize,
    /// Every predicted vector.
    pub vectors: Vec<VectorError>,
    /// z² of equation (3) over the whole sample.
    pub z2: f64,
    /// Its degrees of freedom.
    pub rows: usize,
    /// Logarithm of the predictive density of the sample.
    pub log_density: f64,
}

/// One predicted vector.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct VectorError {
    /// Measurement.
    pub measurement: MeasurementId,
    /// Index within the measurement.
    pub item: usize,
    /// Norm of the position part, m (`None` for measurements without one).
    pub position: Option<f64>,
    /// Norm of the rotation part, rad.
    pub rotation: Option<f64>,
    /// Predicted ⊟ observed, in the order of the measurement's rows.
    pub error: Vec<f64>,
    /// √(eᵀ Cov⁻¹ e) of this vector alone.
    pub z: f64,
    /// What is expected of `position`, m: the root of the trace of its covariance.
    pub expected: Option<f64>,
    /// The same if the sample took part in the fit, as it does in the result, and were measured once more.
    pub expected_with_all: Option<f64>,
}

/// Mean, rms, 95 % and largest of a set of error norms.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[non_exhaustive]
pub struct ErrorSummary {
    /// How many.
    pub n: usize,
    /// Mean.
    pub mean: f64,
    /// Root mean square.
    pub rms: f64,
    /// 95 % of the errors are at most this.
    pub p95: f64,
    /// Largest.
    pub max: f64,
}

impl ErrorSummary {
    /// Summary of norms; all zero when there are none.
    #[must_use]
    pub fn of(norms: &[f64]) -> Self {
        if norms.is_empty() {
            return Self::default();
        }
        let mut sorted = norms.to_vec();
        sorted.sort_unstable_by(f64::total_cmp);
        let n = sorted.len();
        let rank = (0.95 * n as f64).ceil() as usize;
        Self {
            n,
            mean: sorted.iter().sum::<f64>() / n as f64,
            rms: (sorted.iter().map(|x| x * x).sum::<f64>() / n as f64).sqrt(),
            p95: sorted[rank.clamp(1, n) - 1],
            max: sorted[n - 1],
        }
    }

    /// Summary of the position errors of predictions.
    #[must_use]
    pub fn positions(predictions: &[SamplePrediction]) -> Self {
        let norms: Vec<f64> = predictions
            .iter()
            .flat_map(|p| &p.vectors)
            .filter_map(|v| v.position)
            .collect();
        Self::of(&norms)
    }
}

/// Predictions of all samples that could be predicted, and those that could not.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[non_exhaustive]
pub struct CrossValidation {
    /// One per sample.
    pub samples: Vec<SamplePrediction>,
    /// Samples without which some parameter would be undetermined.
    pub indispensable: Vec<usize>,
}

/// σ² of a level of noise in a sample, from its kind and the σ² that was found, m² or rad²; at least that.
pub type Level<'a> = &'a dyn Fn(usize, NoiseKind, f64) -> f64;

/// An eigenvalue of I − Q below this means the sample alone determines something.
const LEVERAGE_LEFT: f64 = 1e-9;

impl Solution {
    /// Leave-one-sample-out by equation (1). `None` when the model cannot be evaluated.
    #[must_use]
    pub fn leave_one_out(&self) -> Option<CrossValidation> {
        self.leave_out(|_| true)
    }

    /// The same for the wanted samples only: what each costs grows with the square of the parameters.
    #[must_use]
    pub fn leave_out(&self, wanted: impl Fn(usize) -> bool) -> Option<CrossValidation> {
        predictions(self.objective(), &self.values, &self.weights, true, &wanted)
    }

    /// Predictions of the held-out samples by equation (2), whatever their weight in the fit was.
    #[must_use]
    pub fn held_out(&self) -> Option<CrossValidation> {
        self.held_out_at(&|_, _, found| found)
    }

    /// The same where held-out samples have other levels of noise than those of the fit, as rows have that are not averaged beside a fit of
    /// means.
    #[must_use]
    pub fn held_out_at(&self, level: Level<'_>) -> Option<CrossValidation> {
        let held = self.held_out_weights(level);
        predictions(self.objective(), &self.values, &held, false, &|_| true)
    }

    /// w of the held-out observations, so that V/w is their covariance; 0 of all others. Where one kind of noise grows more than another,
    /// the whole observation counts as that.
    pub(crate) fn held_out_weights(&self, level: Level<'_>) -> Vec<f64> {
        let model = &self.model;
        let weight = |(o, observation): (usize, &Observation)| {
            if !model.is_held_out(observation.sample) {
                return 0.0;
            }
            let mut weight = 1.0_f64;
            add_block(model, o, |_, _, group, _| {
                let found = self.theta[group];
                let kind = model.problem.groups[group].kind;
                let there = level(observation.sample, kind, found);
                if there > found {
                    weight = weight.min(found / there);
                }
            });
            weight
        };
        model.observations.iter().enumerate().map(weight).collect()
    }

    /// χ² of all held-out samples together but those of `without`, against what is stated of their prediction, with its degrees of
    /// freedom: equation (4), levels as of [`Self::held_out_at`]. `None` where nothing is held out, or the model cannot be
    /// evaluated.
    #[must_use]
    pub fn held_out_chi2(
        &self,
        without: &BTreeSet<usize>,
        level: Level<'_>,
    ) -> Option<(f64, usize)> {
        let model = &self.model;
        let n = model.free();
        let mut work = Workspace::new(model);
        work.cache.update(&model.problem, &self.values);
        let held = self.held_out_weights(level);
        let objective = Objective {
            weights: &held,
            ..self.objective()
        };
        let (mut rows, mut squares) = (0, 0.0);
        let mut h = DMatrix::zeros(n, n);
        let mut g = DVector::zeros(n);
        let kept = |sample: &&usize| !without.contains(*sample);
        for &sample in model.problem.held_out.iter().filter(kept) {
            let Some(s) = whitened(objective, &self.values, sample, &mut work) else {
                continue;
            };
            rows += s.w.len();
            squares += s.w.norm_squared();
            s.a.add_gram(1.0, &mut h);
            s.a.add_transposed_vector(&s.w, &mut g);
        }
        if rows == 0 {
            return None;
        }
        // C = L Lᵀ;   gᵀ (C⁻¹ + H)⁻¹ g = (Lᵀg)ᵀ (1 + Lᵀ H L)⁻¹ (Lᵀg)
        let l = self.half_covariance();
        let known = l.ncols();
        let inner = DMatrix::identity(known, known) + l.transpose() * h * &l;
        let along = l.tr_mul(&g);
        let explained = along.dot(&inner.cholesky()?.solve(&along));
        Some((squares - explained, rows))
    }

    /// Residuals `predicted ⊟ observed` of every observation at the solution, used, rejected and held out
    /// alike, as (sample, vector); `z` counts measurement noise only. `None` when the model cannot be
    /// evaluated.
    #[must_use]
    pub fn residuals(&self) -> Option<Vec<(usize, VectorError)>> {
        let model = &self.model;
        let mut work = Workspace::new(model);
        work.cache.update(&model.problem, &self.values);
        let everything = vec![1.0; model.observations.len()];
        let mut out = Vec::new();
        for sample in 0..model.problem.samples {
            let Some(s) = self.rows_with(&everything, sample, &mut work) else {
                continue;
            };
            let e = &s.l * &s.w;
            for &(o, first, rows) in &s.blocks {
                let l = s.l.rows(first, rows);
                let own = l * l.transpose();
                let variances = own.diagonal().iter().copied().collect();
                let error = e.rows(first, rows).into_owned();
                let of = vector_error(model, o, error, own, variances);
                out.push((sample, of));
            }
        }
        Some(out)
    }
}

/// Predictions of the observations that `include` weighs, from what `objective` was fitted to: equation (1) where they
/// took part, (2) where not. `None` when the model cannot be evaluated.
pub(crate) fn predictions(
    objective: Objective,
    values: &Values,
    include: &[f64],
    left_out: bool,
    wanted: &dyn Fn(usize) -> bool,
) -> Option<CrossValidation> {
    let model = objective.model;
    let mut work = Workspace::new(model);
    let mut system = NormalEquations::new(model.free());
    if !accumulate(objective, values, &mut work, &mut system) {
        return None;
    }
    let c = covariance_of(&system)?;
    let included = Objective {
        weights: include,
        ..objective
    };
    let samples = 0..model.problem.samples;
    let samples: Vec<usize> = samples.filter(|sample| wanted(*sample)).collect();
    let of = |some: Range<usize>| {
        let mut work = Workspace::with(model, work.cache.clone());
        let some = samples[some].iter();
        let seen = some.filter_map(|&s| Some((s, whitened(included, values, s, &mut work)?)));
        let each = seen.map(|(sample, s)| prediction(model, sample, &s, &c, left_out));
        Some(each.collect::<Vec<_>>())
    };
    let mut out = CrossValidation::default();
    chunked(samples.len(), of, |some| {
        for predicted in some {
            match predicted {
                Ok(predicted) => out.samples.push(predicted),
                Err(Indispensable(sample)) => out.indispensable.push(sample),
            }
        }
    })?;
    Some(out)
}

/// A sample without which something would be undetermined.
struct Indispensable(usize);

fn prediction(
    model: &Model,
    sample: usize,
    s: &Whitened,
    c: &DMatrix<f64>,
    left_out: bool,
) -> Result<SamplePrediction, Indispensable> {
    let m = s.w.len();
    let q = s.a.gram_with(c);
    let with_all = DMatrix::identity(m, m) + &q;
    let predicted = Predicted::new(q, &s.w, left_out).ok_or(Indispensable(sample))?;
    let log_det = s.log_det + predicted.log_det;
    let z2 = predicted.z2;
    let e = &s.l * &predicted.error;
    let vector = |&(observation, first, rows): &(usize, usize, usize)| {
        // Of the rows of L those of one limb need few columns.
        let end = first + rows;
        let is_empty = |c: &usize| (first..end).all(|r| s.l[(r, *c)] == 0.0);
        let start = (0..first).take_while(is_empty).count();
        let l = s.l.view((first, start), (rows, end - start)).into_owned();
        let with = |p: &DMatrix<f64>| -> DMatrix<f64> {
            let own = p.view((start, start), (end - start, end - start));
            &l * (own.into_owned() * l.transpose())
        };
        let covariance = with(&predicted.covariance);
        let variances = with(&with_all).diagonal().iter().copied().collect();
        let error = e.rows(first, rows).into_owned();
        vector_error(model, observation, error, covariance, variances)
    };
    Ok(SamplePrediction {
        sample,
        vectors: s.blocks.iter().map(vector).collect(),
        z2,
        rows: m,
        log_density: -0.5 * (z2 + log_det + m as f64 * (2.0 * std::f64::consts::PI).ln()),
    })
}

/// The whitened prediction error of a sample: e, its covariance P, eᵀP⁻¹e and log det P.
struct Predicted {
    error: DVector<f64>,
    covariance: DMatrix<f64>,
    z2: f64,
    log_det: f64,
}

impl Predicted {
    /// Left out, e = (I − Q)⁻¹ w and P = (I − Q)⁻¹, so that eᵀP⁻¹e = wᵀe; held out, e = w and P = I + Q. `None` where the sample alone
    /// determines something.
    fn new(q: DMatrix<f64>, w: &DVector<f64>, left_out: bool) -> Option<Self> {
        let m = w.len();
        let p = match left_out {
            true => DMatrix::identity(m, m) - q,
            false => DMatrix::identity(m, m) + q,
        };
        let mut l = p.as_slice().to_vec();
        if !cholesky_in_place(&mut l, m) {
            return None;
        }
        let log_det = (0..m).map(|i| 2.0 * l[i * m + i].ln()).sum::<f64>();
        if !left_out {
            let mut solved = w.clone();
            solve_in_place(&l, m, solved.as_mut_slice());
            return Some(Self {
                z2: w.dot(&solved),
                error: w.clone(),
                covariance: p,
                log_det,
            });
        }
        // Row after row of L⁻¹ is column after column of its transpose.
        let transposed = DMatrix::from_vec(m, m, lower_inverse(&l, m));
        let covariance = &transposed * transposed.transpose();
        // The least eigenvalue of I − Q is at least 1/tr P, and at most m times that.
        let left = 1.0 / covariance.trace();
        let error = &covariance * w;
        (left >= LEVERAGE_LEFT).then_some(Self {
            z2: w.dot(&error),
            error,
            covariance,
            log_det: -log_det,
        })
    }
}

/// One vector of a sample: its observation and its error with the covariance of that, and the variances of an error with all samples.
fn vector_error(
    model: &Model,
    observation: usize,
    error: DVector<f64>,
    covariance: DMatrix<f64>,
    with_all: Vec<f64>,
) -> VectorError {
    let o = model.observations[observation];
    let measurement = &model.problem.measurements[o.measurement];
    let variances: Vec<f64> = covariance.diagonal().iter().copied().collect();
    let z = nalgebra::Cholesky::new(covariance)
        .and_then(|c| c.l().solve_lower_triangular(&error))
        .map_or(f64::INFINITY, |y| y.norm());
    let deviation = measurement.kind.of().deviation(error.as_slice());
    let expected = |variances: &[f64]| {
        let sigma: Vec<f64> = variances.iter().map(|v| v.max(0.0).sqrt()).collect();
        measurement.kind.of().deviation(&sigma).position
    };
    VectorError {
        expected: expected(&variances),
        expected_with_all: expected(&with_all),
        measurement: MeasurementId::of(o.measurement),
        item: o.item,
        position: deviation.position,
        rotation: deviation.rotation,
        error: error.as_slice().to_vec(),
        z,
    }
}
