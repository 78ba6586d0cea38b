//! Cramér–Rao bounds: the covariance below which no unbiased estimator of the axis can be.
//!
//! All at the truth, for isotropic position noise σ. The 6 × 6 results are over `[direction; point]` (rad,
//! unit of length) and have rank four: nothing moves along the axis.

use calib_estimator::measured::Cloud;
use calib_geometry::Line;
use nalgebra::{Matrix6, Point3, Vector3};

pub use crate::frame_ml::bound as frame;
use crate::{
    axis_frame::AxisFrame,
    circles::{Axis, linearize, spread_out},
    hinge_bundle,
};

/// Bound for markers that share an axis but not a rigid body: true positions, marker by marker.
///
/// `None` where they do not determine the axis (too few samples, or arcs without sagitta).
#[must_use]
pub fn common_line(markers: &[Vec<Point3<f64>>], axis: &Line, sigma: f64) -> Option<Matrix6<f64>> {
    let tracks: Vec<Vec<Option<Point3<f64>>>> = markers
        .iter()
        .map(|m| m.iter().copied().map(Some).collect())
        .collect();
    let cloud = Cloud::gather(&tracks, &[]).ok()?;
    if cloud.points.len() < cloud.markers() + 2 {
        return None;
    }
    let frame = AxisFrame::of(axis.direction.into_inner());
    let at = Axis {
        frame,
        point: axis.point.coords - cloud.origin,
    };
    let unit = linearize(&cloud, &at).hessian.cholesky()?.inverse();
    Some(spread_out(&unit, &frame) * (sigma * sigma))
}

/// Bound for markers of one rigid body on a hinge: places of the markers at angle zero (tracker's frame) and
/// the joint angle of every frame, all markers seen. `angles_known`: the encoder tells them exactly.
#[must_use]
pub fn hinge(
    places: &[Point3<f64>],
    axis: &Line,
    angles: &[f64],
    angles_known: bool,
    sigma: f64,
) -> Option<Matrix6<f64>> {
    let frame = AxisFrame::of(axis.direction.into_inner());
    let at = Axis {
        frame,
        point: axis.point.coords,
    };
    let local: Vec<Vector3<f64>> = places
        .iter()
        .map(|p| frame.coordinates(&(p.coords - at.point)))
        .collect();
    let unit = hinge_bundle::unit_bound(&at, &local, angles, angles_known)?;
    Some(spread_out(&unit, &frame) * (sigma * sigma))
}
