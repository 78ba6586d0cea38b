//! Covariance of the parameters that does not trust the noise model.
//!
//! ```text
//! A = L⁻¹J,   w = L⁻¹e,   Q = A C Aᵀ   (V = LLᵀ)
//! C (Σ_s Aᵀ(I − Q)^(-½) w wᵀ (I − Q)^(-½) A + Λ) C                                         (1)
//! ```
//!
//! Bell & McCaffrey 2002 (CR2). Where the noise model is known to be wrong, the covariance in use is at least this one:
//!
//! ```text
//! C = HHᵀ,   Hᵀ(Σ … + Λ)H = U diag(λ) Uᵀ,   C ← H U diag(max(1, λ)) Uᵀ Hᵀ                    (2)
//! ```
//!
//! Weights may trust less than is known of the noise: equal ones, where the joints scatter but their Jacobian shall not decide. The
//! estimate stays, and its covariance is that under the noise V' that was found:
//!
//! ```text
//! C (Σ_s Aᵀ L⁻¹ V' L⁻ᵀ A + Λ) C                                                                (3)
//! ```

use std::ops::Range;
use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use crate::analysis::solution::{Solution, describe_parameters};
use crate::model::layout::Model;
use crate::model::values::Values;
use crate::solve::chunks::{chunked, is_one_chunk};
use crate::solve::equations::{NormalEquations, Objective, Workspace};
use crate::solve::normal::accumulate;
use crate::solve::whitened::{Whitened, covariance_of, whitened};

/// An eigenvalue of I − Q below this means a direction with leverage 1, which carries no residual.
const LEVERAGE_LEFT: f64 = 1e-10;

impl Solution {
    /// Standard deviation of every parameter by equation (1), in the order of the parameters; `None` for one that is
    /// held. It does not trust the noise model, and varies more by chance than the stated one: a cross-check. Of long recordings
    /// it looks at some thousand samples that stand for all.
    #[must_use]
    pub fn cluster_robust_sigmas(&self) -> Option<Vec<Option<f64>>> {
        let c = covariance_of(&self.information.curvature(&self.model))?;
        let samples: Vec<(usize, f64)> = self.looked_at().weighed().collect();
        let covariance = &c * self.middle(&c, &samples) * &c;
        let sigma = |column: usize| covariance[(column, column)].max(0.0).sqrt();
        let columns = self.model.column_of.iter();
        Some(columns.map(|column| column.map(sigma)).collect())
    }

    /// The same solution with the covariance of equation (2): that of equation (1) in every direction in which it is larger.
    /// With few poses for the number of parameters it is too large rather than too small. `None` when the model cannot be
    /// evaluated.
    #[must_use]
    pub fn with_cluster_covariance(&self) -> Option<Self> {
        let c = covariance_of(&self.information.curvature(&self.model))?;
        let middle = self.middle(&c, &every(&self.model));
        Some(self.at_least(middle))
    }

    /// What stands between the two C of equation (1).
    fn middle(&self, c: &DMatrix<f64>, samples: &[(usize, f64)]) -> DMatrix<f64> {
        let rows = |sample: usize, work: &mut Workspace| self.rows_of(sample, work);
        middle(&self.model, &self.values, &rows, c, samples)
    }

    /// The same solution with the covariance that this estimate has under another statement of the noise, in every direction in
    /// which it is larger: equation (3). Of long recordings it looks at some thousand samples that stand for all. `None` when the model
    /// cannot be evaluated.
    pub(crate) fn with_noise_of(&self, other: &Model, theta: &[f64]) -> Option<Self> {
        let other = Objective {
            model: other,
            weights: &self.weights,
            theta,
        };
        let n = self.model.free();
        let mut middle = DMatrix::zeros(n, n);
        add_priors(&self.model, &mut middle);
        let (mut work, mut of_other) = (Workspace::new(&self.model), Workspace::new(other.model));
        work.cache.update(&self.model.problem, &self.values);
        of_other.cache.update(&other.model.problem, &self.values);
        for (sample, factor) in self.looked_at().weighed() {
            let Some(rows) = self.rows_of(sample, &mut work) else {
                continue;
            };
            let noise = whitened(other, &self.values, sample, &mut of_other)?;
            let scores = rows.a.transposed_times(&(&rows.l_inverse * noise.l));
            middle.gemm(factor, &scores, &scores.transpose(), 1.0);
        }
        Some(self.at_least(middle))
    }

    /// Equation (2), from what stands between the two C of (1) or (3).
    fn at_least(&self, middle: DMatrix<f64>) -> Self {
        let half = self.half_covariance();
        let inside = half.tr_mul(&(middle * &half));
        let eigen = calib_geometry::decompose::semidefinite_eigen(&inside);
        let mut wider = half * eigen.vectors;
        for (k, value) in eigen.values.iter().enumerate() {
            wider.column_mut(k).scale_mut(value.max(1.0).sqrt());
        }
        let mut out = self.clone();
        out.information.covariance = &wider * wider.transpose();
        let described = describe_parameters(&out.model, &out.values, &out.information);
        for (parameter, described) in out.parameters.iter_mut().zip(described) {
            parameter.sigma = described.sigma;
        }
        out
    }
}

/// Equation (1), samples being the clusters. The prior enters as if it were right. `None` when the model cannot be
/// evaluated.
#[must_use]
pub fn sandwich(
    model: &Model,
    values: &Values,
    weights: &[f64],
    theta: &[f64],
) -> Option<DMatrix<f64>> {
    let n = model.free();
    let mut work = Workspace::new(model);
    let mut system = NormalEquations::new(n);
    let objective = Objective {
        model,
        weights,
        theta,
    };
    if !accumulate(objective, values, &mut work, &mut system) {
        return None;
    }
    let c = covariance_of(&system)?;
    let rows = |sample: usize, work: &mut Workspace| {
        whitened(objective, values, sample, work).map(Arc::new)
    };
    Some(&c * middle(model, values, &rows, &c, &every(model)) * &c)
}

/// Every sample, standing for itself.
fn every(model: &Model) -> Vec<(usize, f64)> {
    (0..model.problem.samples).map(|s| (s, 1.0)).collect()
}

/// What stands between the two C of equation (1), from samples that stand for so many each.
fn middle(
    model: &Model,
    values: &Values,
    rows: &(dyn Fn(usize, &mut Workspace) -> Option<Arc<Whitened>> + Sync),
    c: &DMatrix<f64>,
    samples: &[(usize, f64)],
) -> DMatrix<f64> {
    let n = model.free();
    let mut work = Workspace::new(model);
    work.cache.update(&model.problem, values);
    let mut middle = DMatrix::zeros(n, n);
    add_priors(model, &mut middle);
    let cache = &work.cache;
    let add = |some: Range<usize>, sum: &mut DMatrix<f64>| {
        let mut work = Workspace::with(model, cache.clone());
        for &(sample, factor) in &samples[some] {
            if let Some(s) = rows(sample, &mut work) {
                let score = adjusted_score(&s, c);
                sum.ger(factor, &score, &score, 1.0);
            }
        }
    };
    if is_one_chunk(samples.len()) {
        add(0..samples.len(), &mut middle);
        return middle;
    }
    let of = |some: Range<usize>| {
        let mut sum = DMatrix::zeros(n, n);
        add(some, &mut sum);
        Some(sum)
    };
    chunked(samples.len(), of, |sum| middle += sum);
    middle
}

/// Λ = diag(1/σ²)
fn add_priors(model: &Model, middle: &mut DMatrix<f64>) {
    for (i, &p) in model.columns.iter().enumerate() {
        if let Some(sigma) = model.problem.parameters[p].prior_sigma {
            middle[(i, i)] += 1.0 / (sigma * sigma);
        }
    }
}

/// Aᵀ(I − Q)^(-½) w of a sample.
fn adjusted_score(s: &Whitened, c: &DMatrix<f64>) -> DVector<f64> {
    let taken = s.a.gram_with(c);
    let adjusted = by_series(&taken, &s.w).unwrap_or_else(|| by_eigenvectors(&taken, &s.w));
    let mut score = DVector::zeros(c.nrows());
    s.a.add_transposed_vector(&adjusted, &mut score);
    score
}

/// (I − Q)^(-½) w = Σ_k (2k choose k) (Q/4)ᵏ w; `None` where the norm of Q allows no quick end.
fn by_series(taken: &DMatrix<f64>, w: &DVector<f64>) -> Option<DVector<f64>> {
    /// Each term is at most this part of the one before: fifty terms are enough.
    const NORM: f64 = 0.5;
    const TERMS: u32 = 60;
    let norm = taken.norm();
    if norm.is_nan() || norm >= NORM {
        return None;
    }
    let enough = f64::EPSILON * w.norm();
    let (mut sum, mut term) = (w.clone(), w.clone());
    let mut next = w.clone();
    for k in 1..TERMS {
        let factor = f64::from(2 * k - 1) / f64::from(2 * k);
        next.gemv(factor, taken, &term, 0.0);
        std::mem::swap(&mut term, &mut next);
        sum += &term;
        if term.norm() <= enough {
            return Some(sum);
        }
    }
    None
}

/// The same by I − Q = U diag(λ) Uᵀ.
fn by_eigenvectors(taken: &DMatrix<f64>, w: &DVector<f64>) -> DVector<f64> {
    let m = w.len();
    let eigen = (DMatrix::identity(m, m) - taken).symmetric_eigen();
    let mut coefficients = eigen.eigenvectors.tr_mul(w);
    for k in 0..m {
        let left = eigen.eigenvalues[k];
        coefficients[k] = if left > LEVERAGE_LEFT {
            coefficients[k] / left.sqrt()
        } else {
            0.0
        };
    }
    &eigen.eigenvectors * coefficients
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Q of every size of leverage up to where the series ends.
    #[test]
    fn series_and_eigenvectors_agree() {
        for (m, norm) in [(3, 0.0), (3, 1e-3), (12, 0.1), (24, 0.3), (24, 0.49)] {
            let a = DMatrix::from_fn(m, 2 * m, |i, j| {
                (1.0 + 3.7 * i as f64 + 1.3 * j as f64).sin()
            });
            let mut q = &a * a.transpose();
            let scale = norm / q.norm();
            q *= scale;
            let w = DVector::from_fn(m, |i, _| (0.3 + 2.1 * i as f64).cos());
            let series = by_series(&q, &w).unwrap();
            let expected = by_eigenvectors(&q, &w);
            assert!((series - &expected).norm() < 1e-13 * expected.norm());
        }
        // A row that the parameters take up altogether carries nothing.
        let q = DMatrix::from_diagonal(&DVector::from_vec(vec![1.0, 0.25]));
        let w = DVector::from_vec(vec![3.0, 3.0]);
        assert!(by_series(&q, &w).is_none());
        let left = by_eigenvectors(&q, &w);
        assert!(left[0] == 0.0 && (left[1] - 3.0 / 0.75_f64.sqrt()).abs() < 1e-13);
    }
}
