//! One scene with the methods that are tried on it.

use crate::{cell::Scene, noise::Noise, tally::Row, tally::Tally};

/// A scene whose trials can be run in any order.
pub(crate) trait Experiment: Send + Sync {
    /// The scene.
    fn scene(&self) -> &Scene;

    /// Its methods and quantities, in the order of the tallies.
    fn rows(&self) -> &[Row];

    /// Trials for a study of `base` trials in each cell.
    fn trials(&self, base: u64) -> u64 {
        base
    }

    /// One trial: data from `noise`, every method, errors into the tallies.
    fn trial(&self, number: u64, noise: &mut Noise, tallies: &mut [Tally]);
}
