//! The directions that can be known at all, in units in which the prior is 1.
//!
//! ```text
//! δ = S Q z,   S = diag(prior σ, or 1°, 1 cm, …),   Q: directions of Λ' + Σ Y'ᵀY' that anything determines   (1)
//! ```
//!
//! What no candidate and no prior determines (where a frame begins on its axis, and the like) is no part of z: M is then
//! regular as soon as enough postures are chosen.

use calib_geometry::decompose;
use nalgebra::{DMatrix, DVector};

/// With all candidates known no better than this many units: not at all (1000 units are 10 m or a thousand degrees).
const UNITS: f64 = 1e3;

/// Equation (1).
#[derive(Debug, Clone, PartialEq)]
pub struct Basis {
    /// S: one unit of each free parameter.
    pub scale: DVector<f64>,
    /// Q: parameters × directions that can be known.
    pub known: DMatrix<f64>,
    /// The directions that cannot, in units of `scale`.
    pub open: DMatrix<f64>,
}

impl Basis {
    /// Of all rows (σ per unit of each parameter) and the priors (Λ' is 1 where there is one, else 0).
    #[must_use]
    pub fn new(scale: DVector<f64>, has_prior: &[bool], rows: &[&[DMatrix<f64>]]) -> Self {
        let n = scale.len();
        let mut all = DMatrix::zeros(n, n);
        for y in rows.iter().flat_map(|part| part.iter()) {
            all.gemm_tr(1.0, y, y, 1.0);
        }
        for i in 0..n {
            for j in 0..n {
                all[(i, j)] *= scale[i] * scale[j];
            }
            all[(i, i)] += f64::from(u8::from(has_prior[i]));
        }
        let eigen = decompose::symmetric_eigen(&all);
        let is_known = |k: &usize| eigen.values[*k] > UNITS.powi(-2);
        let (known, open): (Vec<usize>, Vec<usize>) = (0..n).partition(is_known);
        Self {
            known: eigen.vectors.select_columns(&known),
            open: eigen.vectors.select_columns(&open),
            scale,
        }
    }

    /// Rows or derivatives by the parameters as those by z: `Y S Q`.
    #[must_use]
    pub fn of(&self, rows: &DMatrix<f64>) -> DMatrix<f64> {
        self.scaled(rows) * &self.known
    }

    /// How much of some derivatives lies in directions that cannot be known.
    #[must_use]
    pub fn leak(&self, rows: &DMatrix<f64>) -> f64 {
        (self.scaled(rows) * &self.open).norm()
    }

    /// Qᵀ Λ' Q.
    #[must_use]
    pub fn prior(&self, has_prior: &[bool]) -> DMatrix<f64> {
        let mut with = self.known.clone();
        for (i, has) in has_prior.iter().enumerate() {
            if !has {
                with.row_mut(i).fill(0.0);
            }
        }
        with.transpose() * &with
    }

    /// σ of each free parameter where M of z is known; `None` where nothing determines it.
    #[must_use]
    pub fn sigmas(&self, information: &DMatrix<f64>) -> Vec<Option<f64>> {
        let spectrum = decompose::symmetric_eigen(information);
        let n = self.scale.len();
        let of = |i: usize| {
            let row = self.known.row(i) * &spectrum.vectors;
            let mut variance = 0.0;
            for (part, value) in row.iter().zip(spectrum.values.iter()) {
                let determined = *value > UNITS.powi(-2);
                if !determined && part.abs() > 1e-5 {
                    return None;
                }
                if determined {
                    variance += part * part / value;
                }
            }
            let leaks = self.open.row(i).norm() > 1e-5;
            (!leaks).then(|| self.scale[i] * variance.sqrt())
        };
        (0..n).map(of).collect()
    }

    fn scaled(&self, rows: &DMatrix<f64>) -> DMatrix<f64> {
        let mut scaled = rows.clone();
        for (c, s) in self.scale.iter().enumerate() {
            scaled.column_mut(c).scale_mut(*s);
        }
        scaled
    }
}

/// √tr(B M⁻¹ Bᵀ): σ of what B derives by z; `None` where it depends on a direction that M does not determine.
#[must_use]
pub fn sigma(information: &DMatrix<f64>, b: &DMatrix<f64>) -> Option<f64> {
    /// A unit along an undetermined direction that changes the quantity by more than this (m) leaves it unknown.
    const OPEN: f64 = 1e-6;
    let spectrum = decompose::symmetric_eigen(information);
    let along = b * &spectrum.vectors;
    let mut variance = 0.0;
    for (column, value) in along.column_iter().zip(spectrum.values.iter()) {
        if *value > UNITS.powi(-2) {
            variance += column.norm_squared() / value;
        } else if column.norm() > OPEN {
            return None;
        }
    }
    Some(variance.sqrt())
}

/// Rows with the same YᵀY, at most as many as their rank: Q of a QR decomposition says nothing.
#[must_use]
pub fn compressed(rows: &DMatrix<f64>) -> DMatrix<f64> {
    /// Relative to the largest: rounding.
    const NOTHING: f64 = 1e-12;
    if rows.nrows() <= 6 {
        return rows.clone();
    }
    decompose::row_factor(rows, NOTHING)
}
