//! Which of two statements of the noise makes left-out poses likelier, for one and the same observations.

use rayon::join;

use crate::analysis::refit::{Start, refitted};
use crate::analysis::scores::{Scores, paired};
use crate::analysis::settings::Settings;
use crate::analysis::solution::Solution;
use crate::analysis::validate::{CrossValidation, predictions};

/// Poses that are left out in turn at most, evenly over all.
const POSES: usize = 200;
/// Fewer left-out poses do not tell the two apart.
const FEWEST: usize = 10;

impl Solution {
    /// By how many standard errors (paired over the left-out poses) this fit makes poses likelier than `other`, which has the same observations with
    /// other covariances; below 0 where the other does. Both are fitted again to what both kept. `None` where poses are too few to tell.
    #[must_use]
    pub fn likelier_by(&self, other: &Self, settings: &Settings) -> Option<f64> {
        if self.weights.len() != other.weights.len() {
            return None;
        }
        let kept = self.weights.iter().zip(&other.weights);
        let kept: Vec<f64> = kept.map(|(a, b)| a.min(*b)).collect();
        let left_out = |of: &Self| -> Option<CrossValidation> {
            let start = Start {
                values: of.values.clone(),
                weights: kept.clone(),
                theta: of.theta.clone(),
                iterations: of.iterations,
            };
            let found = refitted(of.model.problem(), start, settings).ok()?;
            let step = of.model.problem().samples().div_ceil(POSES).max(1);
            let wanted = |sample: usize| sample.is_multiple_of(step);
            let objective = found.objective();
            predictions(objective, found.values(), objective.weights, true, &wanted)
        };
        let (own, others) = join(|| left_out(self), || left_out(other));
        let scores = Scores::of(&[&own?, &others?]);
        let (less, error) = paired(&scores.surprises[1], &scores.surprises[0]);
        (scores.surprises[0].len() >= FEWEST && error > 0.0).then(|| less / error)
    }
}
