//! Residuals in units of their own standard deviations.
//!
//! ```text
//! A = L⁻¹J,   w = L⁻¹e,   V = LLᵀ,   r_i = w_i / √(1 − (A C Aᵀ)_ii)                         (1)
//! ```
//!
//! Where the model and its noise are right, every r_i is standard normal: L⁻¹ takes out what measurements of one sample have in
//! common, and the root the share of each that the parameters follow (internally studentized). A row that took no part in the fit has 1 + …
//! under the root.

use nalgebra::DMatrix;

use crate::analysis::solution::Solution;
use crate::analysis::tails::ResidualVector;
use crate::solve::equations::Workspace;
use crate::solve::whitened::{Whitened, covariance_of};

/// A row that the parameters follow by more than this carries no residual.
const LEVERAGE: f64 = 1.0 - 1e-6;

/// Residuals in units of their own standard deviations.
#[derive(Debug, Clone, Default)]
#[non_exhaustive]
pub struct StandardizedResiduals {
    /// Every row that took part in the fit.
    pub rows: Vec<f64>,
    /// Every vector, whether it took part or was rejected, but those that were held out.
    pub vectors: Vec<ResidualVector>,
}

impl Solution {
    /// Equation (1); of long recordings for some thousand samples only. `None` when the model cannot be evaluated.
    #[must_use]
    pub fn standardized_residuals(&self) -> Option<StandardizedResiduals> {
        let model = &self.model;
        let c = covariance_of(&self.information.curvature(model))?;
        let mut work = Workspace::new(model);
        work.cache.update(&model.problem, &self.values);
        let everything = vec![1.0; model.observations.len()];
        let mut out = StandardizedResiduals::default();
        for sample in self.looked_at().samples {
            if model.is_held_out(sample) {
                continue;
            }
            let kept = self.rows_of(sample, &mut work);
            if let Some(s) = &kept {
                let leverages = leverages(s, &c);
                let rows = s.w.iter().zip(&leverages).filter(|(_, h)| **h < LEVERAGE);
                out.rows.extend(rows.map(|(w, h)| w / (1.0 - h).sqrt()));
            }
            let whole = |s: &Whitened| s.blocks.len() == model.of_sample[sample].len();
            let s = match kept {
                Some(s) if whole(&s) => Some(s),
                _ => self.rows_with(&everything, sample, &mut work),
            };
            out.vectors
                .extend(s.iter().flat_map(|s| self.vectors(sample, s, &c)));
        }
        Some(out)
    }

    /// The vectors of a sample.
    fn vectors(&self, sample: usize, s: &Whitened, c: &DMatrix<f64>) -> Vec<ResidualVector> {
        let leverages = leverages(s, c);
        let blocks = s.blocks.iter();
        let of = |&(o, first, rows): &(usize, usize, usize)| {
            let kept = self.weights[o] > 0.0;
            let variance = |h: f64| if kept { 1.0 - h } else { 1.0 + h };
            let rest: Vec<f64> = (first..first + rows)
                .map(|i| variance(leverages[i]))
                .collect();
            let seen = rest.iter().all(|rest| *rest > 1.0 - LEVERAGE);
            let squares = (0..rows).map(|i| s.w[first + i].powi(2) / rest[i]);
            seen.then(|| ResidualVector {
                sample,
                rows,
                square: squares.sum(),
            })
        };
        blocks.filter_map(of).collect()
    }
}

/// (A C Aᵀ)_ii.
fn leverages(s: &Whitened, c: &DMatrix<f64>) -> Vec<f64> {
    s.a.squares_with(c)
}
