//! The frame of a joint with two axes: its samples and its coordinate axes.

use nalgebra::{Unit, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use crate::measured::Pose;

/// One row of a frame recording.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct FrameSample {
    /// Pose of the body in the tracker's frame; `None` where it was not seen.
    pub world_from_body: Option<Pose>,
    /// Angle of the proximal joint, rad.
    pub proximal: f64,
    /// Angle of the distal joint, rad.
    pub distal: f64,
    /// How many single samples it is worth: its noise variance is σ²/w. A sample of weight 0 counts as not seen.
    pub weight: f64,
}

impl FrameSample {
    /// The pose, where it was seen and counts.
    #[must_use]
    pub fn seen(&self) -> Option<&Pose> {
        self.world_from_body.as_ref().filter(|_| self.weight != 0.0)
    }
}

/// A coordinate axis of the joint's frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum FrameAxis {
    /// First.
    X,
    /// Second.
    Y,
    /// Third.
    Z,
}

impl FrameAxis {
    /// 0, 1, 2.
    #[must_use]
    pub fn index(self) -> usize {
        match self {
            Self::X => 0,
            Self::Y => 1,
            Self::Z => 2,
        }
    }

    /// The unit vector.
    #[must_use]
    pub fn axis(self) -> Unit<Vector3<f64>> {
        Unit::new_unchecked(Vector3::ith(self.index(), 1.0))
    }
}

/// Which coordinate axis each joint rotates about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct FrameAxes {
    /// The axis of the joint nearer to the base: the paper's z for the hand, pan for the head.
    pub proximal: FrameAxis,
    /// The axis of the joint nearer to the body: the paper's x for the hand, tilt (y) for the head.
    pub distal: FrameAxis,
}

impl Default for FrameAxes {
    fn default() -> Self {
        Self {
            proximal: FrameAxis::Z,
            distal: FrameAxis::X,
        }
    }
}

impl FrameAxes {
    /// Rot(proximal, α) · Rot(distal, β).
    #[must_use]
    pub fn turned(&self, proximal: f64, distal: f64) -> UnitQuaternion<f64> {
        UnitQuaternion::from_axis_angle(&self.proximal.axis(), proximal)
            * UnitQuaternion::from_axis_angle(&self.distal.axis(), distal)
    }
}

/// How the axis of each plane of circles is fitted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PlaneFit {
    /// Planar and radial cost with the center held: the paper's.
    PlanarRadial,
    /// The plane's normal.
    Plane,
    /// One line for all circles around the proximal axis, which does not move; orthogonal-distance circles around
    /// the distal one.
    CommonLine,
}
