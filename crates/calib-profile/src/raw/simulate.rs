//! Simulated recordings with known truth.

use super::body::RawPose;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// How `calib simulate` makes recordings.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawSimulate {
    /// Seed of the random numbers; `--seed` overrides it.
    pub seed: u64,
    /// Pose of the robot's root in the tracker (`tracker_from_root`).
    pub tracker_from_root: RawPose,
    /// Where the bodies are bolted on (`link_from_body`) and, for marker bodies, where their markers are.
    pub mounts: BTreeMap<String, RawSimMount>,
    /// What differs between the true robot and its description.
    #[serde(default)]
    pub errors: RawSimErrors,
    /// Measurement noise.
    #[serde(default)]
    pub noise: RawSimNoise,
    /// The protocol of each recording.
    pub recordings: BTreeMap<String, RawProtocol>,
}

/// A simulated mount.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawSimMount {
    /// Position of the body on its link, mm.
    #[serde(default)]
    pub xyz_mm: [f64; 3],
    /// Roll, pitch, yaw of the body on its link, deg.
    #[serde(default)]
    pub rpy_deg: [f64; 3],
    /// Markers in the body frame, mm.
    #[serde(default)]
    pub markers_mm: BTreeMap<String, [f64; 3]>,
}

/// Standard deviations of the differences between the true robot and its description.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawSimErrors {
    /// Zero offset of every moved joint, deg.
    pub joint_offset_deg: f64,
    /// Shift of every moved joint's axis across itself, mm.
    pub axis_mm: f64,
    /// Tilt of every moved joint's axis, deg.
    pub axis_deg: f64,
    /// Position of the mounts, mm.
    pub mount_mm: f64,
    /// Orientation of the mounts, deg.
    pub mount_deg: f64,
    /// Exact differences of fixed joints' origins (e.g. where the arm really stands on its table).
    pub fixed: BTreeMap<String, RawPose>,
    /// True compliance of joints, deg per N m of gravity torque about the axis; above 0 the joint gives way.
    pub compliance_deg_per_nm: BTreeMap<String, f64>,
}

/// Measurement noise, standard deviations.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawSimNoise {
    /// One marker coordinate, mm.
    pub marker_mm: f64,
    /// One coordinate of a body's position, mm.
    pub body_mm: f64,
    /// A body's orientation about each axis, deg.
    pub body_deg: f64,
    /// One marker coordinate along the line of sight, mm; `marker_mm` is then the noise across it.
    pub marker_sight_mm: Option<f64>,
    /// A body's position along the line of sight, mm; `body_mm` is then the noise across it.
    pub body_sight_mm: Option<f64>,
    /// A body's rotation about the line of sight, deg; `body_deg` is then the noise about the axes across it.
    pub body_sight_deg: Option<f64>,
    /// A joint's true angle about its indicated one, pose to pose, deg.
    pub joint_deg: f64,
    /// Share of samples lost to occlusion, 0..1.
    pub occluded: f64,
}

/// The poses of one recording.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawProtocol {
    /// Joints stepped over a grid; the last one varies fastest.
    #[serde(default)]
    pub grid: Vec<RawSteps>,
    /// Joints drawn at random from a range: `<joint>_deg: [from, to]`.
    #[serde(default)]
    pub random: BTreeMap<String, [f64; 2]>,
    /// Number of random poses.
    #[serde(default)]
    pub poses: usize,
    /// Repeat all poses with this joint at each of these values, one group each: `<joint>_deg: [values]`.
    #[serde(default)]
    pub repeat_at: BTreeMap<String, Vec<f64>>,
    /// The tracker's noise here is that of `noise` times this, above 0: one number for the whole recording, or a list with one per value of
    /// `repeat_at`, as `[1, 1, 1, 3, 1]` where cameras are occluded at the fourth. The joints' noise and the share of lost samples stay.
    #[serde(default)]
    pub tracker_noise_times: Option<RawNoiseTimes>,
    /// Joints held still: `<joint>_deg: value`; all others stand at zero.
    #[serde(default)]
    pub hold: BTreeMap<String, f64>,
    /// Bodies in view; all when absent.
    #[serde(default)]
    pub bodies: Option<Vec<String>>,
}

/// Factors of the tracker's noise in one recording.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(
    untagged,
    expecting = "expected a number, or a list of numbers with one per value of `repeat_at`"
)]
pub enum RawNoiseTimes {
    /// In all poses.
    Everywhere(f64),
    /// At each value of `repeat_at`.
    Each(Vec<f64>),
}

/// Equal steps over a range, ends included.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawSteps {
    /// The joint with its unit: `<joint>_deg|_rad|_mm|_m`.
    pub joint: String,
    /// First value.
    pub from: f64,
    /// Last value.
    pub to: f64,
    /// How many values.
    pub poses: usize,
}
