//! Closed paths: the residual of a pose with T the closed path and T_z = identity, six rows, rad and m.

use nalgebra::{Matrix3, Vector3};

use super::poses::{PoseNoise, deviation};
use super::{At, Deviation, Input, Kind, Rows};
use crate::graph::error::Error;
use crate::graph::ids::GroupId;

/// A closed path: `from` and `to` are the same frame and the path (given edge by edge, see
/// [`Problem::add_loop`](crate::Problem::add_loop)) returns to where it began.
#[derive(Debug, Clone, PartialEq)]
pub struct Loop {
    /// How its noise is described.
    pub noise: PoseNoise,
    /// Samples where it closes.
    pub samples: Vec<usize>,
}

impl Kind for Loop {
    fn samples(&self) -> Vec<usize> {
        self.samples.clone()
    }

    fn rows(&self) -> usize {
        6
    }

    fn check(&self, input: &Input<'_>) -> Result<(), Error> {
        self.noise.check(input)
    }

    fn residual(&self, _item: usize, at: &At<'_>) -> Rows {
        Rows::pose(&Matrix3::identity(), &Vector3::zeros(), at)
    }

    fn covariance(&self, _item: usize, add: &mut dyn FnMut(usize, usize, GroupId, f64)) {
        self.noise.covariance(add);
    }

    fn deviation(&self, e: &[f64]) -> Deviation {
        deviation(e)
    }
}
