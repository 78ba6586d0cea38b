//! Postures to be planned.

use super::body::RawPose;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// What `calib plan` may ask of the robot, and what the tracker sees.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawPlan {
    /// Range of a joint in planned postures, `<joint>_deg: [from, to]`; the URDF's limits when absent, and ±180° where it has none.
    pub joints: BTreeMap<String, [f64; 2]>,
    /// Joints held still in planned postures: `<joint>_deg: value`.
    pub hold: BTreeMap<String, f64>,
    /// Least distance between links that could touch, and from links to keep-outs and ground, mm.
    pub clearance_mm: f64,
    /// Height of the ground or table in the frame of the robot's root, mm: moving links stay above it.
    pub ground_mm: Option<f64>,
    /// Boxes that moving links stay out of, by name.
    pub keep_outs: BTreeMap<String, RawKeepOut>,
    /// The tracker's cameras, by name. From their places follows what is seen of a posture, and how the noise of a marker is distributed over the
    /// directions, in plans and in fits. Without any, a marker counts as seen in every posture, and its noise is equal in all directions.
    pub cameras: BTreeMap<String, RawCamera>,
    /// Cameras that a marker or body must be seen by.
    pub min_cameras: usize,
    /// From which side a body or marker can be seen, by its name.
    pub facing: BTreeMap<String, RawFacing>,
    /// The region where the robot is to be accurate: opposite corners of a box in the frame of its root, mm. All postures within
    /// the joint ranges when absent.
    pub task_box_mm: Option<[[f64; 3]; 2]>,
}

impl Default for RawPlan {
    fn default() -> Self {
        Self {
            joints: BTreeMap::new(),
            hold: BTreeMap::new(),
            clearance_mm: 20.0,
            ground_mm: None,
            keep_outs: BTreeMap::new(),
            cameras: BTreeMap::new(),
            min_cameras: 2,
            facing: BTreeMap::new(),
            task_box_mm: None,
        }
    }
}

/// A box that moving links stay out of.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawKeepOut {
    /// Edge lengths, mm.
    pub size_mm: [f64; 3],
    /// Where its center is in the frame of the robot's root.
    pub center: RawPose,
}

/// A camera of the tracker.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawCamera {
    /// Where it is in the tracker's frame, mm.
    pub at_mm: [f64; 3],
    /// A place that its optical axis passes through, in the tracker's frame, mm.
    pub toward_mm: [f64; 3],
    /// Full angle of its field of view, deg.
    pub field_deg: f64,
    /// Farthest distance at which it sees a marker, mm.
    #[serde(default)]
    pub range_mm: Option<f64>,
}

/// From which side a body or marker can be seen.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawFacing {
    /// Direction that it faces, in the frame of its body; of a body without a frame, of its link.
    pub normal: [f64; 3],
    /// Greatest angle between this direction and the line of sight, deg.
    pub within_deg: f64,
}
