//! Unknown transforms, transforms to report, and loop closures.

use super::ParameterValue;
use calib_urdf::JointId;
use calib_urdf::LinkId;
use nalgebra::Unit;
use nalgebra::Vector3;
use std::collections::BTreeMap;

/// An unknown transform `body_from_joint`, the joint's frame being that of its child link.
#[derive(Debug, Clone, PartialEq)]
pub struct Origin {
    /// The joint.
    pub joint: JointId,
    /// Link whose frame is reported, fixed to the joint's child link (the child link itself by default).
    pub link: LinkId,
    /// The body that moves with it.
    pub body: String,
    /// The recording that sweeps it.
    pub sweep: String,
    /// Center estimator, by id.
    pub center: String,
    /// Whether the profile names it.
    pub center_stated: bool,
    /// Parameters of the center estimator.
    pub center_parameters: BTreeMap<String, ParameterValue>,
    /// Axis estimator, by id.
    pub axis: String,
    /// Whether the profile names it.
    pub axis_stated: bool,
    /// Parameters of the axis estimator.
    pub axis_parameters: BTreeMap<String, ParameterValue>,
    /// The swept joints, proximal first.
    pub axes: Vec<SweptAxis>,
    /// Where the orientation comes from.
    pub orientation: Orientation,
    /// With one axis only: which point of the line is the origin.
    pub point: Option<PointChoice>,
}

/// A swept joint and the direction it turns about in the origin's joint frame at the zero position.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SweptAxis {
    /// The joint.
    pub joint: JointId,
    /// Unit direction in the joint frame of the origin, at the zero position of all joints.
    pub direction: Unit<Vector3<f64>>,
}

/// Where the orientation of an origin comes from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Orientation {
    /// From the axes of rotation.
    Axes,
    /// Taken from the URDF relative to the link that carries this body: an assumption.
    FromBody(String),
}

/// The point that is called the origin where only a line is observable.
#[derive(Debug, Clone, PartialEq)]
pub enum PointChoice {
    /// The foot of the other origin's center on the axis, moved along it by the URDF's nominal distance.
    NominalDistanceFrom(String),
    /// The foot of the body's origin on the axis, moved along it by this distance, m.
    FromBody(f64),
}

/// A transform between two links at the zero position of all joints.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LinkTransform {
    /// Link in whose frame it is expressed.
    pub parent: LinkId,
    /// Link whose frame it is.
    pub child: LinkId,
    /// Fixed joint that takes up the difference with `method: paper`.
    pub correct: Option<JointId>,
}

/// Two origins measured by the tracker against forward kinematics.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Loop {
    /// Reference origin.
    pub from: String,
    /// Measured origin.
    pub to: String,
    /// Recording; all validation recordings when absent.
    pub recording: Option<String>,
}
