//! Rao's score test of columns that a fit does not have.
//!
//! ```text
//! U = Σ_s aᵀV⁻¹e,   I = Σ_s aᵀV⁻¹a − bᵀCb,   K = m Σ_s u_s u_sᵀ                            (1)
//! z² = min( UᵀI⁺U / f,  UᵀK⁺U (n − r + 1)/n )  ~  χ²(r),   r = rank I                       (2)
//! ```
//!
//! u_s is a sample's own share of U once parameters and columns are fitted, m how much more sums of successive samples scatter
//! ([`successive`](super::successive)), f the excess of χ²/dof over 1, n the number of
//! samples: K rests on n shares, and the factor is what r directions take of them (Hotelling).

use calib_geometry::decompose::symmetric_eigen;
use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// A direction with less than this share of its own information is one that the parameters imitate: it cannot be tested.
pub(crate) const IMITATED: f64 = 1e-6;

/// What a test is made of.
pub(crate) struct Scored<'a> {
    /// U.
    pub u: &'a DVector<f64>,
    /// I.
    pub information: &'a DMatrix<f64>,
    /// Diagonal of Σ aᵀV⁻¹a.
    pub raw: &'a [f64],
    /// K; `None`: not looked at.
    pub clusters: Option<&'a DMatrix<f64>>,
    /// f, at least 1.
    pub excess: f64,
    /// n.
    pub samples: usize,
}

/// Equation (2).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Tested {
    /// r.
    pub rank: usize,
    pub z2: f64,
    /// UᵀI⁺U / f: what χ² loses.
    pub chi2: f64,
    /// Probability of so large a z² where the columns are absent.
    pub p_value: f64,
}

impl Scored<'_> {
    /// `None` where the parameters imitate all of the columns.
    pub(crate) fn test(&self) -> Option<Tested> {
        let k = self.u.len();
        let scale = |i: usize| match self.raw[i] {
            raw if raw > 0.0 => 1.0 / raw.sqrt(),
            _ => 0.0,
        };
        let scaled =
            |m: &DMatrix<f64>| DMatrix::from_fn(k, k, |i, j| m[(i, j)] * scale(i) * scale(j));
        let information = scaled(self.information);
        if information.iter().any(|x| !x.is_finite()) {
            return None;
        }
        let eigen = symmetric_eigen(&information);
        let kept: Vec<usize> = (0..k).filter(|&i| eigen.values[i] > IMITATED).collect();
        let rank = kept.len();
        if rank == 0 {
            return None;
        }
        // W = E Λ^(-½):   WᵀIW = 1,   y = WᵀU
        let w = DMatrix::from_fn(k, rank, |i, j| {
            eigen.vectors[(i, kept[j])] / eigen.values[kept[j]].sqrt()
        });
        let u = DVector::from_fn(k, |i, _| self.u[i] * scale(i));
        let y = w.tr_mul(&u);
        let by_model = y.norm_squared() / self.excess;
        let by_clusters = self.clusters.and_then(|clusters| {
            let shares = w.tr_mul(&scaled(clusters)) * &w;
            shares.cholesky().map(|c| y.dot(&c.solve(&y)))
        });
        let n = self.samples as f64;
        let taken = ((n + 1.0 - rank as f64) / n).max(0.0);
        let z2 = by_clusters.map_or(by_model, |z2| by_model.min(z2 * taken));
        Some(Tested {
            rank,
            z2,
            chi2: by_model,
            p_value: ChiSquared::new(rank as f64).ok()?.sf(z2),
        })
    }
}
