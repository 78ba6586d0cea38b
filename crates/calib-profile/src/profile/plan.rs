//! What may be planned, and what the tracker sees.

use calib_urdf::JointId;
use nalgebra::{Isometry3, Point3, Unit, Vector3};
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
