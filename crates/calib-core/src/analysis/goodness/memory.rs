//! Score tests under the memory of the noise that successive samples show beside the effects that seem to be missing.
//!
//! ```text
//! ĉ = −I⁺U,   r_s = w_s + Ã_s ĉ − A_s C B ĉ,   z² ← z² / (κ (1 + 2 c ρ / (1 − ρ)))                   (1)
//! ```
//!
//! U, I and B are those of the effects together, which are no memory. The memory c ρ^l is that of r
//! ([`Dependence`](crate::Dependence)); few samples show it where their sums do not (`successive`).

use calib_geometry::decompose::inverse_root;
use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::{Candidate, ScoreTest, tries};
use crate::analysis::dependence::Dependence;
use crate::analysis::solution::Solution;
use crate::solve::whitened::covariance_of;

/// Effects that are taken out at most, the most significant ones.
const MOST: usize = 8;

impl Solution {
    /// Lowers z² of all tests where residuals have a memory beside those that count as missing.
    pub(super) fn with_memory(
        &self,
        candidates: &[Candidate],
        tests: &mut [ScoreTest],
    ) -> Option<()> {
        let missing = tests.iter().filter(|test| test.is_missing()).take(MOST);
        let missing = missing.map(|test| candidates.iter().find(|c| c.is_called(&test.name)));
        let missing: Vec<Candidate> = missing.flatten().cloned().collect();
        let memory = self.memory_beside(&missing)?;
        let one = ChiSquared::new(1.0).ok()?;
        for test in tests {
            test.z2 /= memory;
            // Where samples are few p is that of another distribution, and larger.
            test.p_value = test.p_value.max(one.sf(test.z2));
            let corrected = (test.p_value * tries(candidates)).min(1.0);
            test.p_corrected = test.p_corrected.max(corrected);
        }
        Some(())
    }

    /// What equation (1) divides by; `None` where no memory shows.
    fn memory_beside(&self, effects: &[Candidate]) -> Option<f64> {
        if effects.is_empty() {
            return None;
        }
        let c = covariance_of(&self.held_curvature())?;
        let k = effects.len();
        let mut b = DMatrix::zeros(self.model.free(), k);
        let (mut own, mut u) = (DMatrix::zeros(k, k), DVector::zeros(k));
        let samples = self.looked_at();
        for (seen, (_, factor)) in self.seen(effects, &samples.samples).zip(samples.weighed()) {
            let columns = &seen.columns;
            seen.rows.a.add_transposed_times(factor, columns, &mut b);
            own.gemm(factor, &columns.transpose(), columns, 1.0);
            u.gemv_tr(factor, columns, &seen.rows.w, 1.0);
        }
        let taken = &c * &b;
        let mut information = &own - b.tr_mul(&taken);
        // Effects that imitate each other share what they explain.
        for i in 0..k {
            information[(i, i)] += 1e-6 * own[(i, i)];
        }
        let estimates = -(inverse_root(&information)?.inverse() * u);
        let step = -(taken * &estimates);
        let memory = self.dependence_beside(&self.model.problem.borders, &|sample, rows, work| {
            let own = self.effect_rows(effects, sample, &rows.blocks, rows.w.len(), work);
            rows.w += rows.a.times_vector(&step) + &rows.l_inverse * (own * &estimates);
        });
        let memory = memory.filter(Dependence::is_significant);
        memory.as_ref().map(Dependence::of_sums)
    }
}
