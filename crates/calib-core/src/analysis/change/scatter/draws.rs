//! The information about the draws of a joint that scatters, factored where it is smaller: over the draws, or over the unknowns of the fit.
//!
//! ```text
//! K + τ⁻² = Δ − FᵀF,   Δ = τ⁻² + Σ G̃ᵀG̃,   F = Rᵀ E,   C = R Rᵀ                                       (1)
//! (Δ − FᵀF)⁻¹ = Δ⁻¹ + WᵀM⁻¹W,   W = F Δ⁻¹,   M = 1 − F Δ⁻¹ Fᵀ,   |Δ − FᵀF| = |Δ| |M|                 (2)
//! ```

use calib_geometry::decompose::{cholesky_in_place, solve_in_place};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// What draws are seen with: the diagonal Σ G̃ᵀG̃, and F, unknowns × draws.
pub(super) struct Draws {
    diagonal: DVector<f64>,
    f: DMatrix<f64>,
    /// FᵀF, where there are no more draws than unknowns.
    gram: Option<DMatrix<f64>>,
}

/// Δ − FᵀF for one τ.
pub(super) struct Factored<'a> {
    draws: &'a Draws,
    way: Way,
    /// ln|Δ − FᵀF|.
    pub log_det: f64,
}

enum Way {
    /// L of L Lᵀ = Δ − FᵀF, row by row.
    Draws(Vec<f64>),
    /// Δ⁻¹ and the factor of M.
    Unknowns(DVector<f64>, Cholesky<f64, Dyn>),
}

impl Draws {
    pub(super) fn new(diagonal: DVector<f64>, f: DMatrix<f64>) -> Self {
        // The product of a transpose has no fast kernel.
        let gram = (f.ncols() <= f.nrows()).then(|| f.transpose() * &f);
        Self { diagonal, f, gram }
    }

    /// With draws of this variance; `None` where what is left is not positive.
    pub(super) fn with(&self, variance: f64) -> Option<Factored<'_>> {
        let delta = self.diagonal.add_scalar(1.0 / variance);
        let (way, log_det) = match &self.gram {
            Some(gram) => {
                let m = delta.len();
                let mut l: Vec<f64> = gram.iter().map(|x| -x).collect();
                (0..m).for_each(|i| l[i * m + i] += delta[i]);
                if !cholesky_in_place(&mut l, m) {
                    return None;
                }
                let log_det = (0..m).map(|i| 2.0 * l[i * m + i].ln()).sum();
                (Way::Draws(l), log_det)
            }
            None => {
                let inverse = delta.map(|d| 1.0 / d);
                let n = self.f.nrows();
                let mut scaled = self.f.clone();
                for (mut column, inverse) in scaled.column_iter_mut().zip(inverse.iter()) {
                    column *= inverse.sqrt();
                }
                let m = DMatrix::identity(n, n) - &scaled * scaled.transpose();
                let factor = Cholesky::new(m)?;
                let own = factor.l_dirty().diagonal();
                let log_det = own.iter().map(|x| 2.0 * x.ln()).sum::<f64>();
                let log_det = log_det + delta.iter().map(|x| x.ln()).sum::<f64>();
                (Way::Unknowns(inverse, factor), log_det)
            }
        };
        Some(Factored {
            draws: self,
            way,
            log_det,
        })
    }
}

impl Factored<'_> {
    /// (Δ − FᵀF)⁻¹ B.
    pub(super) fn solve(&self, b: &DMatrix<f64>) -> DMatrix<f64> {
        match &self.way {
            Way::Draws(l) => {
                let mut out = b.clone();
                for mut column in out.column_iter_mut() {
                    solve_in_place(l, b.nrows(), column.as_mut_slice());
                }
                out
            }
            Way::Unknowns(inverse, factor) => {
                let scaled = |mut b: DMatrix<f64>| {
                    for mut column in b.column_iter_mut() {
                        column.component_mul_assign(inverse);
                    }
                    b
                };
                let own = scaled(b.clone());
                let along = factor.solve(&(&self.draws.f * &own));
                own + scaled(self.draws.f.tr_mul(&along))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// More draws than unknowns, fewer, and as many: the matrix itself, inverted.
    #[test]
    fn both_ways_are_the_inverse() {
        for (n, m) in [(3, 9), (9, 3), (5, 5), (4, 5)] {
            let of = |i: usize, k: usize, a: f64| (a * (1 + i * 7 + k * 3) as f64).sin();
            let f = DMatrix::from_fn(n, m, |i, k| 0.2 * of(i, k, 1.3));
            let diagonal = DVector::from_fn(m, |i, _| 2.0 + of(i, 0, 0.3));
            let b = DMatrix::from_fn(m, 2, |i, k| of(i, k, 0.7));
            let draws = Draws::new(diagonal.clone(), f.clone());
            let factored = draws.with(0.5).expect("positive");
            let matrix = DMatrix::from_diagonal(&diagonal.add_scalar(2.0)) - f.transpose() * &f;
            assert!((factored.log_det - matrix.determinant().ln()).abs() < 1e-12);
            let expected = matrix.try_inverse().expect("regular") * &b;
            assert!((factored.solve(&b) - expected).amax() < 1e-12);
            // What the unknowns take away is more than there is.
            assert!(Draws::new(diagonal, f * 50.0).with(0.5).is_none());
        }
    }
}
