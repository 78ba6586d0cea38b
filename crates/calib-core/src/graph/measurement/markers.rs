//! Marker points: `e = R p + t − y`, three rows in axes of `from`, m.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Matrix3, Point3};

use super::{At, Input, Kind, Rows, Sight, isotropic};
use crate::graph::error::Error;
use crate::graph::ids::{GroupId, PointId};

/// Marker points, one vector each.
#[derive(Debug, Clone, PartialEq)]
pub struct Markers {
    /// σ per coordinate.
    pub noise: GroupId,
    /// σ per coordinate of markers that have one of their own.
    pub own: BTreeMap<PointId, GroupId>,
    /// How the noise of what has no shape differs along the line of sight; `None` where it does not.
    pub sight: Option<Sight>,
    /// What was seen.
    pub observations: Vec<MarkerObservation>,
}

/// Marker seen at `position` in the measurement's `from` frame.
#[derive(Debug, Clone, PartialEq)]
pub struct MarkerObservation {
    /// Sample index.
    pub sample: usize,
    /// The marker, a point of the measurement's `to` frame.
    pub point: PointId,
    /// Where it was seen, m.
    pub position: Point3<f64>,
    /// Shape of its covariance in `from`, in units of σ²; `None` isotropic.
    pub shape: Option<Box<Matrix3<f64>>>,
}

impl Markers {
    /// The noise of a marker: its own, or that of all.
    #[must_use]
    pub fn noise_of(&self, point: PointId) -> GroupId {
        self.own.get(&point).copied().unwrap_or(self.noise)
    }
}

impl Kind for Markers {
    fn samples(&self) -> Vec<usize> {
        self.observations.iter().map(|o| o.sample).collect()
    }

    fn rows(&self) -> usize {
        3
    }

    fn points(&self) -> BTreeSet<PointId> {
        self.observations.iter().map(|o| o.point).collect()
    }

    fn check(&self, input: &Input<'_>) -> Result<(), Error> {
        for o in &self.observations {
            (input.at_frame)(o.point)?;
            input.finite(o.sample, o.position.coords.as_slice())?;
            if let Some(shape) = &o.shape {
                input.definite(**shape, shape.determinant())?;
            }
        }
        Ok(())
    }

    fn residual(&self, item: usize, at: &At<'_>) -> Rows {
        let o = &self.observations[item];
        let p = (at.point)(o.point);
        // e = R p + t − y
        let e = at.place(&p) - o.position.coords;
        let rows = Rows::place(o.point, &p, at.r, &e);
        match self.axes(item) {
            Some(axes) => rows.in_axes(0, &axes),
            None => rows,
        }
    }

    fn axes(&self, item: usize) -> Option<Matrix3<f64>> {
        let o = &self.observations[item];
        let seen = self.sight.filter(|_| o.shape.is_none());
        seen.map(|_| Sight::axes(&o.position.coords))
    }

    fn covariance(&self, item: usize, add: &mut dyn FnMut(usize, usize, GroupId, f64)) {
        let o = &self.observations[item];
        let noise = self.noise_of(o.point);
        let Some(shape) = &o.shape else {
            return match &self.sight {
                Some(sight) => sight.positions((0, noise), &o.position.coords, add),
                None => isotropic(0..3, noise, add),
            };
        };
        for i in 0..3 {
            for j in 0..=i {
                add(i, j, noise, shape[(i, j)]);
            }
        }
    }
}
