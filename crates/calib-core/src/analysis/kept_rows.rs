//! The rows of a solution in whitened form, formed once: whichever analysis asks for those of a sample first forms them, the others read them.

use std::sync::{Arc, OnceLock};

use crate::analysis::solution::Solution;
use crate::model::layout::Model;
use crate::solve::equations::{Objective, Workspace};
use crate::solve::whitened::{Whitened, whitened};

/// Numbers that are kept at most, 32 MB: reading more takes as long as forming them.
const MOST: usize = 1 << 22;

/// Those of every sample that was asked for; `None` within where a sample has no rows.
#[derive(Debug, Default)]
pub(crate) struct KeptRows(OnceLock<Vec<OnceLock<Option<Arc<Whitened>>>>>);

/// A copy forms its own: whoever copies a solution may change the copy.
impl Clone for KeptRows {
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl Solution {
    /// The whitened rows of a sample, as in the fit; `work` holds the cache at the solution's values.
    pub(crate) fn rows_of(&self, sample: usize, work: &mut Workspace) -> Option<Arc<Whitened>> {
        let form = |work| whitened(self.objective(), &self.values, sample, work).map(Arc::new);
        let kept = self.kept_rows.0.get_or_init(|| {
            let samples = self.model.problem.samples;
            let fits = numbers(&self.model) <= MOST;
            (0..if fits { samples } else { 0 })
                .map(|_| OnceLock::new())
                .collect()
        });
        match kept.get(sample) {
            Some(kept) => kept.get_or_init(|| form(work)).clone(),
            None => form(work),
        }
    }

    /// The same with these weights.
    pub(crate) fn rows_with(
        &self,
        weights: &[f64],
        sample: usize,
        work: &mut Workspace,
    ) -> Option<Arc<Whitened>> {
        let own = self.model.of_sample[sample].clone();
        if weights[own.clone()] == self.weights[own] {
            return self.rows_of(sample, work);
        }
        let objective = Objective {
            weights,
            ..self.objective()
        };
        whitened(objective, &self.values, sample, work).map(Arc::new)
    }

    /// To be called by whoever changes model, values, weights or noise of a solution that was looked at.
    pub(crate) fn forget_rows(&mut self) {
        self.kept_rows = KeptRows::default();
    }
}

/// What the rows of all samples need at most: A twice, L and L⁻¹.
fn numbers(model: &Model) -> usize {
    let of_sample = |own: &std::ops::Range<usize>| {
        let rows: usize = model.observations[own.clone()].iter().map(|o| o.rows).sum();
        2 * rows * (rows + model.free())
    };
    model.of_sample.iter().map(of_sample).sum()
}

#[cfg(test)]
mod tests;
