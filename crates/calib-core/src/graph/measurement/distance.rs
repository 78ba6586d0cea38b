//! A point at a distance: `e = |R p + t − y| − ℓ`, one row, m.

use std::collections::BTreeSet;

use nalgebra::{Point3, Vector3};

use super::{At, Input, Kind, Rows, isotropic};
use crate::graph::error::Error;
use crate::graph::ids::{GroupId, PointId};

/// The distance of a point of `to` from a point of `from`.
#[derive(Debug, Clone, PartialEq)]
pub struct Distance {
    /// The point of `to`.
    pub point: PointId,
    /// The point of `from`.
    pub anchor: Point3<f64>,
    /// σ, m.
    pub noise: GroupId,
    /// (sample, distance in m).
    pub observations: Vec<(usize, f64)>,
}

impl Kind for Distance {
    fn samples(&self) -> Vec<usize> {
        self.observations.iter().map(|o| o.0).collect()
    }

    fn rows(&self) -> usize {
        1
    }

    fn points(&self) -> BTreeSet<PointId> {
        BTreeSet::from([self.point])
    }

    fn check(&self, input: &Input<'_>) -> Result<(), Error> {
        (input.at_frame)(self.point)?;
        input.finite(0, self.anchor.coords.as_slice())?;
        self.observations
            .iter()
            .try_for_each(|&(sample, length)| input.finite(sample, &[length]))
    }

    fn residual(&self, item: usize, at: &At<'_>) -> Rows {
        let mut out = Rows::zeros();
        let p = (at.point)(self.point);
        let off = at.place(&p) - self.anchor.coords;
        // e = |R p + t − y| − ℓ, ∂e/∂(R p + t) = off / |off|
        let length = off.norm();
        // At distance 0 the gradient has no direction; any unit vector is a subgradient.
        let unit = if length > 0.0 {
            off / length
        } else {
            Vector3::x()
        };
        let e = length - self.observations[item].1;
        out.project(0, e, &unit, (self.point, &p), at);
        out
    }

    fn covariance(&self, _item: usize, add: &mut dyn FnMut(usize, usize, GroupId, f64)) {
        isotropic(0..1, self.noise, add);
    }
}
