//! The whitened rows of a solution, for all analyses that look at them.

use std::sync::Arc;

use crate::analysis::solution::Solution;
use crate::solve::equations::{Objective, Workspace};
use crate::solve::kept_rows::KeptRows;
use crate::solve::whitened::{Whitened, whitened};

impl Solution {
    /// Those of a sample, as in the fit; `work` holds the cache at the solution's values.
    pub(crate) fn rows_of(&self, sample: usize, work: &mut Workspace) -> Option<Arc<Whitened>> {
        self.kept_rows.of(&self.model, sample, || {
            whitened(self.objective(), &self.values, sample, work)
        })
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

#[cfg(test)]
mod tests;
