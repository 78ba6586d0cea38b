//! Marker points: `e = R p + t − y`, three rows in axes of `from`, m.

use nalgebra::{Matrix3, Point3};

use super::{At, Input, Kind, Rows, isotropic};
use crate::graph::error::Error;
use crate::graph::ids::{GroupId, PointId};

/// Marker points, one vector each.
#[derive(Debug, Clone, PartialEq)]
pub struct Markers {
    /// σ per coordinate.
    pub noise: GroupId,
    /// What was seen.
    pub observations: Vec<MarkerObservation>,
}

/// Marker seen at `position` in the measurement's `from` frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MarkerObservation {
    /// Sample index.
    pub sample: usize,
    /// The marker, a point of the measurement's `to` frame.
    pub point: PointId,
    /// Where it was seen, m.
    pub position: Point3<f64>,
    /// Shape of its covariance in `from`, in units of σ²; `None` isotropic.
    pub shape: Option<Matrix3<f64>>,
}

impl Kind for Markers {
    fn samples(&self) -> Vec<usize> {
        self.observations.iter().map(|o| o.sample).collect()
    }

    fn rows(&self) -> usize {
        3
    }

    fn check(&self, input: &Input<'_>) -> Result<(), Error> {
        for o in &self.observations {
            (input.at_frame)(o.point)?;
            input.finite(o.sample, o.position.coords.as_slice())?;
            if let Some(shape) = o.shape {
                input.definite(shape, shape.determinant())?;
            }
        }
        Ok(())
    }

    fn residual(&self, item: usize, at: &At<'_>) -> Rows {
        let o = &self.observations[item];
        let p = (at.point)(o.point);
        // e = R p + t − y
        let e = at.place(&p) - o.position.coords;
        Rows::place(o.point, &p, at.r, &e)
    }

    fn covariance(&self, item: usize, add: &mut dyn FnMut(usize, usize, GroupId, f64)) {
        let Some(shape) = self.observations[item].shape else {
            return isotropic(0..3, self.noise, add);
        };
        for i in 0..3 {
            for j in 0..=i {
                add(i, j, self.noise, shape[(i, j)]);
            }
        }
    }
}
