//! What may be planned, and what the tracker sees.
//!
//! ```text
//! Σ ∝ (Σ_c (1 − d_c d_cᵀ)/ρ_c²)⁻¹     of a marker, from the directions d and distances ρ of the cameras that see it  (1)
//! ```
//!
//! (1) is a triangulation with equal angular noise.

use calib_urdf::JointId;
use nalgebra::{Isometry3, Matrix3, Point3, Unit, Vector3};
use std::collections::BTreeMap;

/// What `calib plan` may ask of the robot, and what the tracker sees. Lengths m, angles rad.
#[derive(Debug, Clone, PartialEq)]
pub struct PlanSpec {
    /// Range of joints in planned postures, lower first.
    pub joints: BTreeMap<JointId, (f64, f64)>,
    /// Joints that stand still.
    pub hold: BTreeMap<JointId, f64>,
    /// Least distance between links, and from links to keep-outs and ground.
    pub clearance: f64,
    /// Height of the ground in the root's frame.
    pub ground: Option<f64>,
    /// Boxes that links stay out of, by name.
    pub keep_outs: BTreeMap<String, KeepOut>,
    /// Cameras by name; none: everything is seen.
    pub cameras: BTreeMap<String, Camera>,
    /// Cameras that a marker must be seen by.
    pub min_cameras: usize,
    /// From which side bodies and markers can be seen, by name.
    pub facing: BTreeMap<String, Facing>,
    /// Where the robot is to be accurate: lower and upper corner in the root's frame.
    pub task_box: Option<[Point3<f64>; 2]>,
}

/// A box that links stay out of.
#[derive(Debug, Clone, PartialEq)]
pub struct KeepOut {
    /// Edge lengths.
    pub size: Vector3<f64>,
    /// `root_from_box`.
    pub root_from_box: Isometry3<f64>,
}

/// A camera of the tracker.
#[derive(Debug, Clone, PartialEq)]
pub struct Camera {
    /// In the tracker's frame.
    pub at: Point3<f64>,
    /// Optical axis in the tracker's frame.
    pub axis: Unit<Vector3<f64>>,
    /// Half angle of its field of view.
    pub half_field: f64,
    /// Farthest distance.
    pub range: f64,
}

/// From which side a body or marker can be seen.
#[derive(Debug, Clone, PartialEq)]
pub struct Facing {
    /// In the frame of the body, or of its link.
    pub normal: Unit<Vector3<f64>>,
    /// Greatest angle to the line of sight.
    pub within: f64,
}

impl Camera {
    /// Whether a point (tracker's frame, m) is in the camera's field and range.
    #[must_use]
    pub fn covers(&self, point: &Point3<f64>) -> bool {
        let sight = point - self.at;
        sight.norm() <= self.range && self.axis.angle(&sight) <= self.half_field
    }

    /// One camera's term of equation (1), with 1e-3 along the sight, so that one camera gives a covariance, if a long one.
    #[must_use]
    pub fn information(&self, point: &Point3<f64>) -> Matrix3<f64> {
        /// Information along the line of sight relative to that across it.
        const ALONG: f64 = 1e-3;
        let sight = point - self.at;
        let Some(d) = Unit::try_new(sight, 1e-9) else {
            return Matrix3::identity();
        };
        let dd = d.into_inner() * d.transpose();
        (Matrix3::identity() - dd * (1.0 - ALONG)) / sight.norm_squared()
    }
}

impl PlanSpec {
    /// Equation (1) of a marker that was seen at a point (tracker's frame, m), up to a factor that all share: by the cameras that cover it, or by
    /// all where too few do, since it was seen. `None` without cameras.
    #[must_use]
    pub fn covariance(&self, point: &Point3<f64>) -> Option<Matrix3<f64>> {
        let covering = || self.cameras.values().filter(|c| c.covers(point));
        let enough = covering().count() >= self.min_cameras.max(2);
        let information = |sum: Matrix3<f64>, c: &Camera| sum + c.information(point);
        let sum = if enough {
            covering().fold(Matrix3::zeros(), information)
        } else {
            self.cameras.values().fold(Matrix3::zeros(), information)
        };
        sum.try_inverse()
    }
}
