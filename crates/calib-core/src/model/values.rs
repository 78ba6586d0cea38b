//! Values of parameters, and what follows from an edge and them.

use nalgebra::{Matrix6, Vector6};

use crate::graph::edge::UnknownPose;

/// One scalar random effect per sample; its direction already carries any given scale.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Slot {
    pub edge: usize,
    pub direction: usize,
    /// `None`: unit variance (a measured edge's own covariance).
    pub group: Option<usize>,
}

/// Values of every parameter (free and fixed), in the order of the problem.
#[derive(Debug, Clone, PartialEq)]
pub struct Values(pub Vec<f64>);

/// Chart coordinates of an unknown pose.
pub(crate) fn coordinates(u: &UnknownPose, values: &Values) -> Vector6<f64> {
    let mut c = Vector6::zeros();
    for i in 0..6 {
        if let Some(p) = u.parameters[i] {
            c[i] = values.0[p.index()];
        }
    }
    c
}

/// Directions of a measured edge's noise: columns of the Cholesky factor of its covariance.
pub(crate) fn covariance_directions(covariance: &Matrix6<f64>) -> Option<Matrix6<f64>> {
    nalgebra::Cholesky::new(*covariance).map(|c| c.l())
}
