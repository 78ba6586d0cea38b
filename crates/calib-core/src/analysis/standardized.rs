//! Residuals in units of their own standard deviations.
//!
//! ```text
//! A = L⁻¹J,   w = L⁻¹e,   V = LLᵀ,   r_i = w_i / √(1 − (A C Aᵀ)_ii)                         (1)
//! ```
//!
//! Where the model and its noise are right, every r_i is standard normal: L⁻¹ takes out what measurements of one sample have in
//! common, and the root the share of each that the parameters follow (internally studentized).

use crate::analysis::solution::Solution;
use crate::solve::equations::Workspace;
use crate::solve::whitened::{covariance_of, whitened};

/// A row that the parameters follow by more than this carries no residual.
const LEVERAGE: f64 = 1.0 - 1e-6;

impl Solution {
    /// Equation (1) for every row that took part in the fit, by sample; of long recordings for those of some thousand
    /// samples. `None` when the model cannot be evaluated.
    #[must_use]
    pub fn standardized_residuals(&self) -> Option<Vec<f64>> {
        let c = covariance_of(&self.information.curvature(&self.model))?;
        let mut work = Workspace::new(&self.model);
        work.cache.update(&self.model.problem, &self.values);
        let mut out = Vec::new();
        for sample in self.looked_at().samples {
            let Some(s) = whitened(self.objective(), &self.values, sample, &mut work) else {
                continue;
            };
            let ac = &s.a * &c;
            for (i, w) in s.w.iter().enumerate() {
                let leverage = ac.row(i).dot(&s.a.row(i));
                if leverage < LEVERAGE {
                    out.push(w / (1.0 - leverage).sqrt());
                }
            }
        }
        Some(out)
    }
}
