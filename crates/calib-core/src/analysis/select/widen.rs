//! What a choice costs in certainty: the covariance of a chosen model is that of a given one, and more.
//!
//! ```text
//! Δ = max(0, E²(nested) − E²(chosen) + its standard error)                                 (1)
//! p = mean over the fitted vectors of tr(J C Jᵀ)                                            (2)
//! C ← κ C,   κ = 1 + Δ/p · (k − 1)/k                                                        (3)
//! ```
//!
//! E² are the mean squared position errors of k folds, predicted by the model that was chosen without the fold, and by the one that was
//! chosen with it: what they differ by is the choice alone, with its standard error over the folds on the safe side. A fold is predicted
//! from (k − 1)/k of the poses, and what is uncertain goes with one over their number.

use crate::analysis::select::NestedError;
use crate::analysis::solution::{Solution, describe_parameters};
use crate::solve::equations::Workspace;

impl Solution {
    /// The same solution with the covariance of equation (3), and √κ; `None` where the choice cost nothing.
    #[must_use]
    pub fn widened_by_choice(&self, nested: &NestedError) -> Option<(Self, f64)> {
        let lost = nested.rms.powi(2) - nested.rms_chosen.powi(2) + nested.lost_error;
        let of_parameters = self.square_of_parameters().filter(|p| *p > 0.0)?;
        let folds = nested.folds.max(2) as f64;
        let kappa = 1.0 + lost / of_parameters * (folds - 1.0) / folds;
        if !(kappa.is_finite() && kappa > 1.0) {
            return None;
        }
        let mut out = self.clone();
        out.information.covariance *= kappa;
        let described = describe_parameters(&out.model, &out.values, &out.information);
        for (parameter, described) in out.parameters.iter_mut().zip(described) {
            parameter.sigma = described.sigma;
        }
        Some((out, kappa.sqrt()))
    }

    /// Equation (2), m².
    fn square_of_parameters(&self) -> Option<f64> {
        let model = &self.model;
        let mut work = Workspace::new(model);
        work.cache.update(&model.problem, &self.values);
        let (mut sum, mut count) = (0.0, 0);
        for sample in 0..model.problem.samples {
            let Some(s) = self.rows_of(sample, &mut work) else {
                continue;
            };
            let j = &s.l * s.a.dense();
            let of_rows = (&j * &self.information.covariance).component_mul(&j);
            let squares = of_rows.column_sum();
            for &(observation, first, rows) in &s.blocks {
                let kind =
                    &model.problem.measurements[model.observations[observation].measurement].kind;
                let sigma: Vec<f64> = squares
                    .rows(first, rows)
                    .iter()
                    .map(|s| s.max(0.0).sqrt())
                    .collect();
                if let Some(expected) = kind.of().deviation(&sigma).position {
                    sum += expected * expected;
                    count += 1;
                }
            }
        }
        (count > 0).then(|| sum / f64::from(count))
    }
}
