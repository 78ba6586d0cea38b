//! The residuals of what was fitted, one observation after the other.

use crate::analysis::solution::Solution;
use crate::model::cache::State;
use crate::model::layout::Observation;
use crate::model::path::Derivatives;
use crate::solve::equations::Workspace;

impl Solution {
    /// Calls `see` with each observation that the fit kept and did not hold out, and its residual from its first row on. Of long recordings for
    /// some thousand samples only.
    pub(crate) fn for_each_fitted(&self, mut see: impl FnMut(&Observation, &[f64])) {
        let fitted = |(o, weight): (usize, &f64)| {
            let held_out = self.model.is_held_out(self.model.observations[o].sample);
            f64::from(u8::from(*weight > 0.0 && !held_out))
        };
        let mask: Vec<f64> = self.weights.iter().enumerate().map(fitted).collect();
        let problem = &self.model.problem;
        let mut work = Workspace::new(&self.model);
        work.cache.update(problem, &self.values);
        let state = State::new(problem, &work.cache, &self.values);
        for sample in self.looked_at().samples {
            let rows = &mut work.rows;
            rows.fill(&self.model, state, &mask, sample, Derivatives::None);
            for &(o, first, _) in &rows.blocks {
                see(&self.model.observations[o], &rows.r[first..]);
            }
        }
    }
}
