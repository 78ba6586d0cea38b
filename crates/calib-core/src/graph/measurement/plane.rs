//! A point at a height over a plane: `e = nᵀ (R p + t) − h`, one row, m.

use std::collections::BTreeSet;

use nalgebra::{Unit, Vector3};

use super::{At, Input, Kind, Rows, isotropic};
use crate::graph::error::Error;
use crate::graph::ids::{GroupId, PointId};

/// A point of `to` lies at height h over a plane of `from`.
#[derive(Debug, Clone, PartialEq)]
pub struct Plane {
    /// The point.
    pub point: PointId,
    /// Unit normal in `from`.
    pub normal: Unit<Vector3<f64>>,
    /// σ, m.
    pub noise: GroupId,
    /// (sample, h in m).
    pub observations: Vec<(usize, f64)>,
}

impl Kind for Plane {
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
        input.direction(0, &self.normal)?;
        self.observations
            .iter()
            .try_for_each(|&(sample, h)| input.finite(sample, &[h]))
    }

    fn residual(&self, item: usize, at: &At<'_>) -> Rows {
        let mut out = Rows::zeros();
        let p = (at.point)(self.point);
        // e = nᵀ (R p + t) − h
        let e = self.normal.dot(&at.place(&p)) - self.observations[item].1;
        out.project(0, e, &self.normal, (self.point, &p), at);
        out
    }

    fn covariance(&self, _item: usize, add: &mut dyn FnMut(usize, usize, GroupId, f64)) {
        isotropic(0..1, self.noise, add);
    }
}
