//! Measurements: what the tracker says about the frames at the two ends of a path. One file per kind.
//!
//! With `T = from_from_to(s; x) = [R, t]` along the path, residual = predicted ⊟ observed:
//!
//! ```text
//! marker      e = R p + t − y                                          3, from axes, m      (1)
//! pose        e = [ Log(R_zᵀ R); R_zᵀ (t − t_z) ]                      6, body axes, rad, m (2)
//!   inverse   e = [ Log(R_zᵀ R); −Rᵀt + R_zᵀt_z ]                      6, body axes, rad, m (2')
//! direction   e = E(d)ᵀ R a,  E(d) spans the plane across d            2, rad               (3)
//! plane       e = nᵀ (R p + t) − h                                     1, m                 (4)
//! line        e = E(d)ᵀ (R p + t − o)                                  2, m                 (5)
//! distance    e = |R p + t − y| − ℓ                                    1, m                 (6)
//! loop        (2) with T the closed path and T_z = identity            6                    (7)
//! cylinder    e = |E(d)ᵀ (R p + t − o)| − r                            1, m                 (8)
//! ```
//!
//! An unknown plane or line is a frame with an unknown edge: give the measurement that frame as `from`. A touched
//! point is a marker of known place.
//!
//! To add a kind: write its file (the fields, `Kind` for them, and the test of its derivatives), name it in
//! [`MeasurementKind`] and in the one `match` below. Layout, solver, robust weights, validation and input check follow.

use std::collections::BTreeSet;

use nalgebra::{Matrix3, Vector3};

use crate::graph::error::Error;
use crate::graph::ids::{EdgeId, FrameId, GroupId, PointId};

mod closed;
mod cylinder;
mod directions;
mod distance;
mod input;
mod line;
mod markers;
mod plane;
mod poses;
mod rows;
mod sight;

pub use closed::Loop;
pub use cylinder::Cylinder;
pub use directions::{DirectionObservation, Directions};
pub use distance::Distance;
pub(crate) use input::Input;
pub use line::Line;
pub use markers::{MarkerObservation, Markers};
pub use plane::Plane;
pub use poses::{PoseNoise, PoseObservation, Poses};
pub(crate) use rows::{At, Rows};
pub use sight::{Growth, Sight, error_of_sight, growth};

/// One kind of measurement along one path.
#[derive(Debug, Clone, PartialEq)]
pub struct Measurement {
    /// Name, for findings (`hand`, `table contact`).
    pub name: String,
    /// Frame in which the measurement is stated.
    pub from: FrameId,
    /// Frame that is measured.
    pub to: FrameId,
    /// The edges from `from` to `to`, each with `true` where it is walked from child to parent;
    /// `None`: the shortest way through the graph.
    pub path: Option<Vec<(EdgeId, bool)>>,
    /// What is measured.
    pub kind: MeasurementKind,
}

/// Equations (1) to (8).
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum MeasurementKind {
    /// Marker points, one vector each.
    Markers(Markers),
    /// Body poses.
    Poses(Poses),
    /// A direction that is fixed in `to` (an axis, a beam).
    Directions(Directions),
    /// A point of `to` lies at height h over a plane of `from`.
    Plane(Plane),
    /// A point of `to` lies on a line of `from`.
    Line(Line),
    /// The distance of a point of `to` from a point of `from`.
    Distance(Distance),
    /// A closed path.
    Loop(Loop),
    /// A point of `to` lies on a cylinder of `from`.
    Cylinder(Cylinder),
}

/// What the rest of the crate asks of a kind of measurement.
pub(crate) trait Kind {
    /// Samples of the observations, in their order.
    fn samples(&self) -> Vec<usize>;

    /// Rows per observation, at most 6.
    fn rows(&self) -> usize;

    /// The points that it measures.
    fn points(&self) -> BTreeSet<PointId> {
        BTreeSet::new()
    }

    /// Everything that can be wrong with the numbers given.
    fn check(&self, input: &Input<'_>) -> Result<(), Error>;

    /// Residual of an observation and its derivatives at the path's pose.
    fn residual(&self, item: usize, at: &At<'_>) -> Rows;

    /// Calls `add(i, j ≤ i, group, shape_ij)` for every entry of an observation's own covariance `σ_group² shape`.
    fn covariance(&self, item: usize, add: &mut dyn FnMut(usize, usize, GroupId, f64));

    /// B of the rows `B e` of an observation, each three of them, from the axes in which equations (1) to (8) state them; `None` where they are in these.
    fn axes(&self, _item: usize) -> Option<Matrix3<f64>> {
        None
    }

    /// A residual split into what is an angle and what is a length.
    fn deviation(&self, e: &[f64]) -> Deviation {
        Deviation {
            rotation: None,
            position: Some(norm(e)),
        }
    }
}

/// Sizes of a residual, where it has such a part.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Deviation {
    /// rad.
    pub rotation: Option<f64>,
    /// m.
    pub position: Option<f64>,
}

impl MeasurementKind {
    /// The only place that tells the kinds apart.
    #[inline]
    pub(crate) fn of(&self) -> &dyn Kind {
        match self {
            Self::Markers(kind) => kind,
            Self::Poses(kind) => kind,
            Self::Directions(kind) => kind,
            Self::Plane(kind) => kind,
            Self::Line(kind) => kind,
            Self::Distance(kind) => kind,
            Self::Loop(kind) => kind,
            Self::Cylinder(kind) => kind,
        }
    }
}

impl MeasurementKind {
    /// How the noise differs along the line of sight; `None` where it does not.
    #[must_use]
    pub fn sight(&self) -> Option<Sight> {
        match self {
            Self::Markers(markers) => markers.sight,
            Self::Poses(poses) => poses.sight,
            _ => None,
        }
    }

    /// Three rows of an observation's residual in the axes in which equations (1) to (8) state them.
    pub(crate) fn stated(&self, item: usize, rows: &[f64]) -> Vector3<f64> {
        let three = Vector3::new(rows[0], rows[1], rows[2]);
        match self.of().axes(item) {
            Some(axes) => axes.tr_mul(&three),
            None => three,
        }
    }
}

/// Covariance `σ² I` of some rows.
fn isotropic(
    rows: std::ops::Range<usize>,
    group: GroupId,
    add: &mut dyn FnMut(usize, usize, GroupId, f64),
) {
    for i in rows {
        add(i, i, group, 1.0);
    }
}

fn norm(e: &[f64]) -> f64 {
    e.iter().map(|x| x * x).sum::<f64>().sqrt()
}

#[cfg(test)]
pub(crate) mod tests {
    use nalgebra::{Isometry3, Vector3, Vector6};

    use super::{At, Kind, Rows};
    use crate::graph::ids::PointId;

    /// Compares the derivatives of a kind with central differences, at a few poses and points.
    pub(crate) fn assert_jacobian(kind: &dyn Kind) {
        /// Step of the differences, rad and m: its cube is far below the tolerance, rounding over it too.
        const STEP: f64 = 1e-6;
        const TOLERANCE: f64 = 1e-8;
        let residual = |x: &Isometry3<f64>, p: &Vector3<f64>| -> Rows {
            let r = x.rotation.to_rotation_matrix();
            let at = At {
                r: r.matrix(),
                t: &x.translation.vector,
                point: &|_: PointId| *p,
            };
            kind.residual(0, &at)
        };
        for k in 0..5 {
            let k = f64::from(k);
            let x = Isometry3::new(
                Vector3::new(0.4 + 0.1 * k, -0.3, 0.2 * k),
                Vector3::new(0.3 * k, 0.7 - k, 0.2),
            );
            let p = Vector3::new(0.05 * k, 0.1, -0.07);
            let rows = residual(&x, &p);
            let slope =
                |f: &dyn Fn(f64) -> Rows, i: usize| (f(STEP).e[i] - f(-STEP).e[i]) / (2.0 * STEP);
            for c in 0..6 {
                let moved = |h: f64| {
                    let mut xi = Vector6::zeros();
                    xi[c] = h;
                    let (omega, v) = (xi.fixed_rows::<3>(0), xi.fixed_rows::<3>(3));
                    // x · exp(ξ) to first order in one coordinate
                    residual(&(x * Isometry3::new(v.into(), omega.into())), &p)
                };
                for i in 0..kind.rows() {
                    assert!(
                        (rows.m[i][c] - slope(&moved, i)).abs() < TOLERANCE,
                        "row {i}, twist {c}"
                    );
                }
            }
            let Some((_, by_point)) = rows.point else {
                continue;
            };
            for c in 0..3 {
                let moved = |h: f64| residual(&x, &(p + Vector3::ith(c, h)));
                for i in 0..kind.rows() {
                    assert!(
                        (by_point[i][c] - slope(&moved, i)).abs() < TOLERANCE,
                        "row {i}, point {c}"
                    );
                }
            }
        }
    }
}
