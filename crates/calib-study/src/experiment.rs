//! One scene with the methods that are tried on it.

use crate::{cell::Scene, noise::Noise, tally::Row, tally::Tally};

/// Efficiencies that a scene does not let anybody have; `None` where nothing less than 1 is known.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Limits {
    /// Of every unbiased estimator.
    pub unbiased: Option<f64>,
    /// Of the best to second order in the noise.
    pub second_order: Option<f64>,
}

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

    /// Efficiencies that nobody has here.
    fn limits(&self) -> Limits {
        Limits::default()
    }

    /// One trial: data from `noise`, every method, errors into the tallies.
    fn trial(&self, number: u64, noise: &mut Noise, tallies: &mut [Tally]);
}
