//! Noise with a memory: its strength from the residuals of successive samples, and what it does to the uncertainty.
//!
//! With x = e/σ of each row, the model says Cov(x_s) = X_s = V_s/(σσᵀ) and nothing between samples. A tracker with a
//! memory (filters, warming, air) adds, for the same row l samples apart, c ρ^l:
//!
//! ```text
//! W = X⁻¹,   k_s = W_s J_s/σ,   N_s = Σ_{u≠s} c ρ^|u−s| k_u,   h_s = k_s + W_s N_s           (1)
//! G = H + Σ_s N_sᵀ k_s,   C' = C G C                                                      (2)
//! E[ŷ_s·ŷ_t] = c ρ^l tr(W_s W_t) − tr(k_s C h_tᵀ) − tr(k_t C h_sᵀ) + tr(k_s C' k_tᵀ),   ŷ = W x̂    (3)
//! ```
//!
//! C' is the covariance of the same estimate under that noise: nothing is fitted again. (3) is what residuals show
//! after the fit has taken its share of the slow part; c and ρ follow from it by repeated substitution, and a common
//! factor κ for the level of the noise, which the fit makes look smaller. Residuals of missing physics that follow the order of the samples
//! look the same, and are treated the same.
//!
//! What a frame measures from may move as one, t in its axes: B t in all rows x of a sample. (1) to (3) then hold for Bᵀy, Bᵀk and BᵀWB in
//! place of y, k and W, and c ρ^l is the covariance of t, in units of a level of the noise.
//!
//! The rows of a measured pose are turned into the axes of the frame that it was measured from: a tracker's memory stands still
//! there, and turns with the body in the body's own axes.
//!
//! What this does not see: frames of one pose as separate samples, whose errors are shared but do not fade. Their
//! joint values are equal; merge them before.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use crate::analysis::solution::{Solution, describe_parameters};
use crate::graph::measurement::MeasurementKind;
use crate::solve::equations::Workspace;
use crate::solve::whitened::{Whitened, covariance_of, root_of};

mod found;
mod posterior;
mod scaled;

pub use found::{Dependence, MemoryOf};
use posterior::posterior;
use scaled::{Keys, Scaled, Unnumbered, scaled_sample};

/// Changes the whitened residuals of a sample.
pub(crate) type BesideRows<'a> = dyn Fn(usize, &mut Whitened, &Workspace) + Sync + 'a;

/// Samples that the memory is estimated from at most.
const SAMPLES: usize = 1500;
/// Samples that are looked at one after the other, and those that are held at once.
const TOGETHER: usize = 16;
const AT_ONCE: usize = 8 * TOGETHER;
/// Lags that it is estimated from.
const LAGS: usize = 3;
/// Strongest memory that is distinguishable from a constant error.
const LARGEST_DECAY: f64 = 0.98;
/// Rounds of substitution in (3): each leaves about a third of the error.
const ROUNDS: usize = 8;

impl Solution {
    /// Estimates the memory of the noise from successive samples; `borders` are the first samples of recordings, across which nothing is
    /// remembered. Where the residuals do not show one, decay and share are zero, and correlation and z may be bounds that are too large. `None` where fewer than eight samples or no pairs of rows exist.
    #[must_use]
    pub fn dependence(&self, borders: &[usize]) -> Option<Dependence> {
        self.dependence_beside(borders, &|_, _, _| {})
    }

    /// The same where the residuals of a sample are first changed: what they are beside something that the model does not have.
    pub(crate) fn dependence_beside(
        &self,
        borders: &[usize],
        beside: &BesideRows,
    ) -> Option<Dependence> {
        const CLEARER: f64 = 1.1;
        let apart = self.dependence_apart(borders, beside)?;
        let together = self.dependence_of(MemoryOf::Together, borders, beside);
        // Rows that each have a memory have one together, too; it is less clear, or as clear where there is one marker or one pose.
        let clearer = together.filter(|t| t.is_significant() && t.z > CLEARER * apart.z);
        Some(clearer.unwrap_or(apart))
    }

    fn dependence_apart(&self, borders: &[usize], beside: &BesideRows) -> Option<Dependence> {
        let all = self.dependence_of(MemoryOf::All, borders, beside)?;
        let mut measurements = self.model.problem.measurements.iter();
        let poses = measurements.any(|m| matches!(m.kind, MeasurementKind::Poses(_)));
        if !poses {
            return Some(all);
        }
        // Position and orientation of a body come from different parts of a tracker: one without memory hides the other's, and
        // both together understate it.
        let parts = [MemoryOf::Positions, MemoryOf::Orientations];
        let parts = parts
            .into_iter()
            .filter_map(|of| self.dependence_of(of, borders, beside));
        let found = parts.chain([all]).filter(Dependence::is_significant);
        let clearest = found.max_by(|a, b| a.z.total_cmp(&b.z));
        Some(clearest.unwrap_or(all))
    }

    fn dependence_of(
        &self,
        of: MemoryOf,
        borders: &[usize],
        beside: &BesideRows,
    ) -> Option<Dependence> {
        /// Fewer pairs say nothing.
        const LEAST: usize = 8;
        let samples = self.scaled_samples(of, borders, SAMPLES, beside);
        if samples.len() < LEAST {
            return None;
        }
        let h = self.information.curvature(&self.model);
        let c = covariance_of(&h)?;
        let seen = lag_sums(&samples, |a, i, b, j| a.y[i] * b.y[j]);
        let expected = lag_traces(&samples);
        if expected[1] <= 0.0 {
            return None;
        }
        let mut found = Dependence {
            of,
            lag_one: 0.0,
            z: 0.0,
            decay: 0.0,
            share: 0.0,
            correlated: 1.0,
            level: 1.0,
        };
        let pairs = samples.iter().skip(1).filter(|s| !s.starts).count();
        if of == MemoryOf::Together {
            let each = |sum: f64, count: usize| sum / count.max(1) as f64;
            found.correlated = each(expected[1], pairs) / each(expected[0], samples.len());
        }
        let most = most_bias(&samples, c.nrows());
        found.lag_one = (seen[1].max(0.0) + most) / expected[1];
        found.z = found.lag_one * expected[1].sqrt();
        if !found.is_significant() {
            return Some(found);
        }
        // A part of a row's noise; what moves as one may be any number of times as large.
        let most = if of == MemoryOf::Together {
            f64::INFINITY
        } else {
            1.0
        };
        for round in 0..ROUNDS {
            let bias = bias(&samples, &c, found.share, found.decay);
            // κ from lag 0, then γ_l = (seen / κ − bias) / T
            found.level = (seen[0] / (expected[0] + bias[0])).max(1.0);
            let gamma: Vec<f64> = (1..=LAGS)
                .map(|l| {
                    if expected[l] > 0.0 {
                        (seen[l] / found.level - bias[l]) / expected[l]
                    } else {
                        0.0
                    }
                })
                .collect();
            if round == 0 {
                found.lag_one = gamma[0];
                // Var(ŷ_s·ŷ_t) = tr(W_s W_t) without memory
                found.z = gamma[0] * expected[1].sqrt();
                found.lag_one *= found.correlated;
                if !found.is_significant() {
                    return Some(found);
                }
            }
            let decay =
                (gamma[0] * gamma[1] + gamma[1] * gamma[2]) / (gamma[0].powi(2) + gamma[1].powi(2));
            found.decay = if gamma[1] > 0.0 && decay > 0.0 {
                decay.min(LARGEST_DECAY)
            } else {
                gamma[0].clamp(0.0, LARGEST_DECAY)
            };
            found.share = if found.decay > 0.0 {
                (gamma[0] / found.decay).clamp(0.0, most)
            } else {
                0.0
            };
        }
        Some(found)
    }

    /// The same solution with the uncertainty that it has under noise with a memory: equation (2), where priors say less than the data, and (6) of `posterior`
    /// where they say more, for parameters and everything derived from them. `None` when the model cannot be evaluated.
    #[must_use]
    pub fn under(&self, dependence: &Dependence, borders: &[usize]) -> Option<Self> {
        // Σ_s N_sᵀ k_s, earlier and later samples alike
        let n = self.model.free();
        let mut memory = Memory::new(dependence.share, dependence.decay, n);
        let mut added = DMatrix::zeros(n, n);
        self.each_scaled(dependence.of, borders, &|_, _, _| {}, |sample| {
            added.gemm_tr(1.0, &memory.of(&sample), &sample.k, 1.0);
            true
        });
        let added = &added + added.transpose();
        let mut out = self.clone();
        let h = self.information.curvature(&self.model);
        let root = root_of(&h)?;
        // Memory of both signs could in rare directions cancel: it is never taken for information. Which directions those are is asked in units of
        // C: in those of the parameters, rounding would decide where it adds next to nothing.
        let more = positive(&(root.transpose() * added * &root));
        // Noise of another form than the weights have, and widths of priors, have made the covariance larger than C.
        let inverse = root.clone().try_inverse()?;
        let wider = &self.information.covariance - &root * root.transpose();
        let more = more + positive(&(&inverse * wider * inverse.transpose()));
        let priors = root.transpose() * DMatrix::from_diagonal(&self.prior_information()) * &root;
        let known = posterior(&priors, &more, dependence.level, &(inverse * self.off()))?;
        out.information.covariance = &root * known * root.transpose();
        let described = describe_parameters(&out.model, &out.values, &out.information);
        for (parameter, described) in out.parameters.iter_mut().zip(described) {
            parameter.sigma = described.sigma;
        }
        Some(out)
    }

    /// x̂ − x₀: deviations from the means of the priors; from where those without a prior are said to deviate does not matter.
    fn off(&self) -> DVector<f64> {
        let free = self.model.free_parameters();
        let parameters = self.model.problem().parameters();
        let off = free.iter().map(|p| match parameters[*p].prior_sigma {
            Some(_) => self.values.0[*p] - parameters[*p].nominal,
            None => 0.0,
        });
        DVector::from_iterator(free.len(), off)
    }

    /// The first samples, at most so many.
    fn scaled_samples(
        &self,
        of: MemoryOf,
        borders: &[usize],
        most: usize,
        beside: &BesideRows,
    ) -> Vec<Scaled> {
        let mut out = Vec::new();
        self.each_scaled(of, borders, beside, |sample| {
            out.push(sample);
            out.len() < most
        });
        out
    }

    /// Calls `see` with one sample after the other until it gives `false`.
    fn each_scaled(
        &self,
        of: MemoryOf,
        borders: &[usize],
        beside: &BesideRows,
        mut see: impl FnMut(Scaled) -> bool,
    ) {
        let mut work = Workspace::new(&self.model);
        work.cache.update(&self.model.problem, &self.values);
        let of_some = |some: &[usize]| -> Vec<(usize, Unnumbered)> {
            let mut work = work.clone();
            let rows = some.iter().filter_map(|&sample| {
                let mut rows = Arc::unwrap_or_clone(self.rows_of(sample, &mut work)?);
                beside(sample, &mut rows, &work);
                Some((sample, scaled_sample(self, &rows, of)))
            });
            rows.collect()
        };
        let mut keys = Keys::default();
        let mut recording = None;
        let samples: Vec<usize> = (0..self.model.problem.samples).collect();
        for some in samples.chunks(AT_ONCE) {
            let pieces: Vec<_> = some.par_chunks(TOGETHER).map(of_some).collect();
            for (sample, rows) in pieces.into_iter().flatten() {
                let own = borders.partition_point(|b| *b <= sample);
                let starts = recording != Some(own);
                recording = Some(own);
                if !see(rows.numbered(starts, &mut keys)) {
                    return;
                }
            }
        }
    }
}

/// Sums over the same rows of samples 0, 1, …, [`LAGS`] apart within a recording.
fn lag_sums(
    samples: &[Scaled],
    mut of: impl FnMut(&Scaled, usize, &Scaled, usize) -> f64,
) -> [f64; LAGS + 1] {
    let mut out = [0.0; LAGS + 1];
    each_pair(samples, |lag, a, b| {
        for (i, j) in shared(a, b) {
            out[lag] += of(a, i, b, j);
        }
    });
    out
}

/// tr(W_s W_t) over the same rows; at lag 0 tr W.
fn lag_traces(samples: &[Scaled]) -> [f64; LAGS + 1] {
    let mut out = [0.0; LAGS + 1];
    each_pair(samples, |lag, a, b| {
        if lag == 0 {
            let asked = |i: &usize| a.keys[*i].is_some();
            out[0] += (0..a.keys.len())
                .filter(asked)
                .map(|i| a.w[(i, i)])
                .sum::<f64>();
            return;
        }
        if a.keys == b.keys && a.keys.iter().all(Option::is_some) {
            out[lag] += a.w.dot(&b.w);
            return;
        }
        let pairs: Vec<(usize, usize)> = shared(a, b).collect();
        for &(i, p) in &pairs {
            for &(j, q) in &pairs {
                out[lag] += a.w[(i, j)] * b.w[(p, q)];
            }
        }
    });
    out
}

fn each_pair<'a>(samples: &'a [Scaled], mut see: impl FnMut(usize, &'a Scaled, &'a Scaled)) {
    for (s, a) in samples.iter().enumerate() {
        see(0, a, a);
        for lag in 1..=LAGS {
            match samples.get(s + lag) {
                Some(b) if samples[s + 1..=s + lag].iter().all(|x| !x.starts) => see(lag, a, b),
                _ => break,
            }
        }
    }
}

/// Places of the same row in two samples.
fn shared<'a>(a: &'a Scaled, b: &'a Scaled) -> impl Iterator<Item = (usize, usize)> + 'a {
    let place = |key: usize| b.keys.iter().position(|k| *k == Some(key));
    a.keys
        .iter()
        .enumerate()
        .filter_map(move |(i, key)| Some((i, place((*key)?)?)))
}

/// Σ_{u<s} c ρ^(s−u) k_u, from sample to sample.
struct Memory {
    share: f64,
    decay: f64,
    /// By key.
    held: DMatrix<f64>,
}

impl Memory {
    fn new(share: f64, decay: f64, n: usize) -> Self {
        Self {
            share,
            decay,
            held: DMatrix::zeros(0, n),
        }
    }

    /// N of the next sample.
    fn of(&mut self, sample: &Scaled) -> DMatrix<f64> {
        self.next(sample, sample.starts)
    }

    /// The same where it is said whether nothing is remembered.
    fn next(&mut self, sample: &Scaled, starts: bool) -> DMatrix<f64> {
        if starts {
            self.held.fill(0.0);
        } else {
            self.held *= self.decay;
        }
        let asked = || {
            let keys = sample.keys.iter().enumerate();
            keys.filter_map(|(i, key)| Some((i, (*key)?)))
        };
        let width = asked().map(|(_, key)| key + 1).max().unwrap_or(0);
        if width > self.held.nrows() {
            let held = std::mem::replace(&mut self.held, DMatrix::zeros(0, 0));
            self.held = held.resize_vertically(width, 0.0);
        }
        let mut own = DMatrix::zeros(sample.keys.len(), self.held.ncols());
        for (i, key) in asked() {
            own.row_mut(i).copy_from(&self.held.row(key));
        }
        for (i, key) in asked() {
            let mut row = self.held.row_mut(key);
            row += sample.k.row(i) * self.share;
        }
        own
    }
}

/// What the last three terms of (3) are at most without memory, at any lag:
///
/// ```text
/// Σ |k_s C k_tᵀ| ≤ Σ_s tr(k_s C k_sᵀ) ≤ max|W| tr(C Σ JᵀV⁻¹J) ≤ max|W| n
/// ```
fn most_bias(samples: &[Scaled], unknowns: usize) -> f64 {
    // The largest sum of a row is no less than the largest eigenvalue.
    let of = |w: &DMatrix<f64>| w.column_iter().map(|c| c.lp_norm(1)).fold(0.0, f64::max);
    let largest = samples.iter().map(|s| of(&s.w)).fold(0.0, f64::max);
    largest * unknowns as f64
}

/// The last three terms of (3), by lag.
fn bias(samples: &[Scaled], c: &DMatrix<f64>, share: f64, decay: f64) -> [f64; LAGS + 1] {
    let n = c.nrows();
    let count = samples.len();
    if share == 0.0 {
        return bias_of_none(samples, c);
    }
    let mut memory = Memory::new(share, decay, n);
    let before: Vec<DMatrix<f64>> = samples.iter().map(|s| memory.of(s)).collect();
    // The same from the end: a recording then begins with its last sample.
    let ends = |s: usize| s == 0 || samples[count - s].starts;
    let mut memory = Memory::new(share, decay, n);
    let after: Vec<DMatrix<f64>> = (0..count)
        .map(|s| memory.next(&samples[count - 1 - s], ends(s)))
        .collect();
    let mut added = DMatrix::zeros(n, n);
    let around: Vec<DMatrix<f64>> = (0..count)
        .map(|s| &before[s] + &after[count - 1 - s])
        .collect();
    for (sample, n_s) in samples.iter().zip(&around) {
        added.gemm_tr(1.0, n_s, &sample.k, 1.0);
    }
    let covariance = c + c * added * c;
    // Rows are columns of the transposed matrices, which lie side by side in memory.
    let k: Vec<DMatrix<f64>> = samples.iter().map(|s| s.k.transpose()).collect();
    let h: Vec<DMatrix<f64>> = samples
        .par_iter()
        .zip(&around)
        .map(|(s, n_s)| (&s.k + &s.w * n_s).transpose())
        .collect();
    let times = |right: &DMatrix<f64>| -> Vec<DMatrix<f64>> {
        let product = |s: &Scaled| (&s.k * right).transpose();
        samples.par_iter().map(product).collect()
    };
    let (kc, kg) = (times(c), times(&covariance));
    let mut out = [0.0; LAGS + 1];
    for (s, a) in samples.iter().enumerate() {
        for lag in 0..=LAGS {
            let t = s + lag;
            if t >= count || (lag > 0 && samples[t].starts) {
                break;
            }
            for (i, j) in shared(a, &samples[t]) {
                out[lag] += kg[s].column(i).dot(&k[t].column(j))
                    - kc[s].column(i).dot(&h[t].column(j))
                    - kc[t].column(j).dot(&h[s].column(i));
            }
        }
    }
    out
}

/// The same without memory: −tr(k_s C k_tᵀ).
fn bias_of_none(samples: &[Scaled], c: &DMatrix<f64>) -> [f64; LAGS + 1] {
    let kc: Vec<DMatrix<f64>> = samples.par_iter().map(|s| &s.k * c).collect();
    let mut out = [0.0; LAGS + 1];
    for (s, a) in samples.iter().enumerate() {
        for lag in 0..=LAGS {
            let t = s + lag;
            if t >= samples.len() || (lag > 0 && samples[t].starts) {
                break;
            }
            for (i, j) in shared(a, &samples[t]) {
                out[lag] -= kc[s].row(i).dot(&samples[t].k.row(j));
            }
        }
    }
    out
}

/// The positive part of a symmetric matrix.
fn positive(m: &DMatrix<f64>) -> DMatrix<f64> {
    let eigen = calib_geometry::decompose::symmetric_eigen(&((m + m.transpose()) * 0.5));
    let mut half = eigen.vectors.clone();
    for (mut column, value) in half.column_iter_mut().zip(eigen.values.iter()) {
        column *= value.max(0.0).sqrt();
    }
    &half * half.transpose()
}
