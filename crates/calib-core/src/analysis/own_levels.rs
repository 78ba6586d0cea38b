//! A noise level for each body instead of one for all, by evidence.
//!
//! Two bodies are seldom seen equally well: one is farther from the cameras, smaller, or at their border. Levels of their own, found by REML,
//! are used where left-out poses are likelier under them, by more than chance and what the choice allows, and where they predict no worse:
//! physics that is missing behind one of the bodies also makes it look noisy.

use crate::analysis::estimate::{Start, refit};
use crate::analysis::scores::{Scores, mean, paired};
use crate::analysis::settings::Settings;
use crate::analysis::solution::Solution;

/// Poses that are left out in turn at most, evenly over all.
const POSES: usize = 200;
/// Fewer left-out poses do not tell levels apart.
const FEWEST: usize = 10;
/// The levels must make left-out poses likelier by this many standard errors (paired over the poses).
const SHOWN: f64 = 2.0;
/// Below this ratio of rms errors nobody can tell weights apart.
const SAME: f64 = 1.005;

impl Solution {
    /// The same observations with a level for each body, where they speak for it; `None` where the common level stays.
    #[must_use]
    pub fn with_levels_by_body(&self, settings: &Settings) -> Option<Self> {
        let problem = self.model.problem().with_noise_by_body()?;
        let of_group = |(g, group): (usize, &crate::graph::problem::NoiseGroup)| {
            let known = self.theta.get(g).copied();
            let alike = || {
                let mut noise = self.noise.iter();
                let common = noise.find(|n| group.name.starts_with(&format!("{} ", n.name)));
                common.map(|n| n.sigma * n.sigma)
            };
            known.or_else(alike).unwrap_or(group.sigma * group.sigma)
        };
        let start = Start {
            values: self.values.clone(),
            weights: self.weights.clone(),
            theta: problem.groups().iter().enumerate().map(of_group).collect(),
            iterations: self.iterations,
        };
        let found = refit(&problem, start, settings).ok()?;
        let step = self.model.problem().samples().div_ceil(POSES).max(1);
        let left_out = |of: &Self| of.leave_out(|sample| sample.is_multiple_of(step));
        let (own, common) = (left_out(&found)?, left_out(self)?);
        let scores = Scores::of(&[&own, &common]);
        let (less, error) = paired(&scores.surprises[1], &scores.surprises[0]);
        let ratio = (mean(&scores.squares[0]) / mean(&scores.squares[1])).sqrt();
        let enough = scores.squares[0].len() >= FEWEST;
        (enough && less > SHOWN * error && ratio <= SAME).then_some(found)
    }
}
