//! A point on a line: `e = E(d)ᵀ (R p + t − o)` with E(d) across the line, two rows, m.

use std::collections::BTreeSet;

use nalgebra::{Point3, Unit, Vector3};

use super::rows::tangent_basis;
use super::{At, Input, Kind, Rows, isotropic};
use crate::graph::error::Error;
use crate::graph::ids::{GroupId, PointId};

/// A point of `to` lies on a line of `from`.
#[derive(Debug, Clone, PartialEq)]
pub struct Line {
    /// The point.
    pub point: PointId,
    /// A point of the line.
    pub through: Point3<f64>,
    /// Its direction.
    pub direction: Unit<Vector3<f64>>,
    /// σ, m.
    pub noise: GroupId,
    /// Samples where it does.
    pub samples: Vec<usize>,
}

impl Kind for Line {
    fn samples(&self) -> Vec<usize> {
        self.samples.clone()
    }

    fn rows(&self) -> usize {
        2
    }

    fn points(&self) -> BTreeSet<PointId> {
        BTreeSet::from([self.point])
    }

    fn check(&self, input: &Input<'_>) -> Result<(), Error> {
        (input.at_frame)(self.point)?;
        input.finite(0, self.through.coords.as_slice())?;
        input.direction(0, &self.direction)
    }

    fn residual(&self, _item: usize, at: &At<'_>) -> Rows {
        let mut out = Rows::zeros();
        let p = (at.point)(self.point);
        // e_i = b_iᵀ (R p + t − o)
        let off = at.place(&p) - self.through.coords;
        for (i, b) in tangent_basis(&self.direction).iter().enumerate() {
            out.project(i, b.dot(&off), b, (self.point, &p), at);
        }
        out
    }

    fn covariance(&self, _item: usize, add: &mut dyn FnMut(usize, usize, GroupId, f64)) {
        isotropic(0..2, self.noise, add);
    }
}
