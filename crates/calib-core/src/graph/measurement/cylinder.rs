//! A point on a cylinder: `e = |E(d)ᵀ (R p + t − o)| − r` with E(d) across its axis, one row, m.

use std::collections::BTreeSet;

use nalgebra::{Point3, Unit, Vector3};

use super::{At, Input, Kind, Rows, isotropic};
use crate::graph::error::Error;
use crate::graph::ids::{GroupId, PointId};

/// A point of `to` lies on a cylinder of `from`: a pin, a shaft, a bore.
#[derive(Debug, Clone, PartialEq)]
pub struct Cylinder {
    /// The point.
    pub point: PointId,
    /// A point of the axis.
    pub through: Point3<f64>,
    /// Direction of the axis.
    pub direction: Unit<Vector3<f64>>,
    /// Radius, m.
    pub radius: f64,
    /// σ, m.
    pub noise: GroupId,
    /// Samples where it does.
    pub samples: Vec<usize>,
}

impl Kind for Cylinder {
    fn samples(&self) -> Vec<usize> {
        self.samples.clone()
    }

    fn rows(&self) -> usize {
        1
    }

    fn points(&self) -> BTreeSet<PointId> {
        BTreeSet::from([self.point])
    }

    fn check(&self, input: &Input<'_>) -> Result<(), Error> {
        (input.at_frame)(self.point)?;
        input.finite(0, self.through.coords.as_slice())?;
        input.finite(0, &[self.radius])?;
        input.direction(0, &self.direction)
    }

    fn residual(&self, _item: usize, at: &At<'_>) -> Rows {
        let mut out = Rows::zeros();
        let p = (at.point)(self.point);
        let d = self.direction.into_inner();
        let off = at.place(&p) - self.through.coords;
        // a = (I − d dᵀ)(R p + t − o),   e = |a| − r,   ∂e/∂(R p + t) = a / |a|
        let across = off - d * d.dot(&off);
        let distance = across.norm();
        // On the axis every direction across is a subgradient.
        let unit = if distance > 0.0 {
            across / distance
        } else {
            super::rows::tangent_basis(&d)[0]
        };
        out.project(0, distance - self.radius, &unit, (self.point, &p), at);
        out
    }

    fn covariance(&self, _item: usize, add: &mut dyn FnMut(usize, usize, GroupId, f64)) {
        isotropic(0..1, self.noise, add);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::graph::measurement::tests::assert_jacobian;

    #[test]
    fn derivatives_are_those_of_the_residual() {
        assert_jacobian(&Cylinder {
            point: PointId::of(0),
            through: Point3::new(0.1, 0.2, 0.3),
            direction: Unit::new_normalize(Vector3::new(0.5, 0.2, 0.9)),
            radius: 0.03,
            noise: GroupId::of(0),
            samples: vec![0],
        });
    }
}
