//! Directions: `e = E(d)ᵀ R a` with E(d) across the observed direction d, two rows, rad.

use nalgebra::{Unit, Vector3};

use calib_geometry::so3;

use super::rows::tangent_basis;
use super::{At, Deviation, Input, Kind, Rows, isotropic, norm};
use crate::graph::error::Error;
use crate::graph::ids::GroupId;

/// A direction that is fixed in `to` (an axis, a beam).
#[derive(Debug, Clone, PartialEq)]
pub struct Directions {
    /// The direction in `to`.
    pub direction: Unit<Vector3<f64>>,
    /// σ, rad.
    pub noise: GroupId,
    /// Observed directions in `from`.
    pub observations: Vec<DirectionObservation>,
    /// The observation has no sign.
    pub sign_free: bool,
}

/// Direction seen in `from`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DirectionObservation {
    /// Sample index.
    pub sample: usize,
    /// Unit direction.
    pub direction: Unit<Vector3<f64>>,
}

impl Kind for Directions {
    fn samples(&self) -> Vec<usize> {
        self.observations.iter().map(|o| o.sample).collect()
    }

    fn rows(&self) -> usize {
        2
    }

    fn check(&self, input: &Input<'_>) -> Result<(), Error> {
        input.direction(0, &self.direction)?;
        self.observations
            .iter()
            .try_for_each(|o| input.direction(o.sample, &o.direction))
    }

    fn residual(&self, item: usize, at: &At<'_>) -> Rows {
        let mut out = Rows::zeros();
        let d = self.observations[item].direction.into_inner();
        let predicted = at.r * self.direction.into_inner();
        let d = if self.sign_free && d.dot(&predicted) < 0.0 {
            -d
        } else {
            d
        };
        // d(R a) = −R [a]ₓ ω
        let by_omega = -(at.r * so3::skew(&self.direction));
        for (i, b) in tangent_basis(&d).iter().enumerate() {
            out.e[i] = b.dot(&predicted);
            let row = by_omega.tr_mul(b);
            out.m[i][..3].copy_from_slice(row.as_slice());
        }
        out
    }

    fn covariance(&self, _item: usize, add: &mut dyn FnMut(usize, usize, GroupId, f64)) {
        isotropic(0..2, self.noise, add);
    }

    fn deviation(&self, e: &[f64]) -> Deviation {
        Deviation {
            rotation: Some(norm(e)),
            position: None,
        }
    }
}
