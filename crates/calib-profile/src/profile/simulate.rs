//! Simulated recordings with known truth.

use calib_urdf::JointId;
use nalgebra::Isometry3;
use nalgebra::Point3;
use std::collections::BTreeMap;

/// How to simulate recordings with known truth.
#[derive(Debug, Clone, PartialEq)]
pub struct Simulation {
    /// Seed.
    pub seed: u64,
    /// `tracker_from_root`.
    pub tracker_from_root: Isometry3<f64>,
    /// Nominal mounts by body.
    pub mounts: BTreeMap<String, SimMount>,
    /// Differences between the true robot and its description.
    pub errors: SimErrors,
    /// Measurement noise.
    pub noise: SimNoise,
    /// Protocol by recording.
    pub recordings: BTreeMap<String, Protocol>,
}

/// A simulated mount.
#[derive(Debug, Clone, PartialEq)]
pub struct SimMount {
    /// `link_from_body`.
    pub link_from_body: Isometry3<f64>,
    /// Markers in the body frame, m.
    pub markers: BTreeMap<String, Point3<f64>>,
}

/// Position and angle standard deviations, m and rad.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Error3 {
    /// m.
    pub position: f64,
    /// rad.
    pub angle: f64,
}

/// Differences between the true robot and its description (standard deviations, or exact where said).
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SimErrors {
    /// Zero offsets, rad.
    pub joint_offset: f64,
    /// Axis lines.
    pub axis: Error3,
    /// Mounts.
    pub mount: Error3,
    /// Exact right-hand changes of fixed joints' origins.
    pub fixed: BTreeMap<JointId, Isometry3<f64>>,
    /// Exact compliance, rad per N m.
    pub compliance: BTreeMap<JointId, f64>,
}

/// Measurement noise, standard deviations.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SimNoise {
    /// One marker coordinate, m.
    pub marker: f64,
    /// A body's pose.
    pub body: Error3,
    /// A marker along the line of sight, m, where that differs.
    pub marker_sight: Option<f64>,
    /// A body's position along the line of sight, m, where that differs.
    pub body_sight: Option<f64>,
    /// A body's rotation about the line of sight, rad, where that differs.
    pub body_sight_rad: Option<f64>,
    /// A joint, rad.
    pub joint: f64,
    /// Share of lost samples.
    pub occluded: f64,
}

/// The poses of one simulated recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Protocol {
    /// Grid joints; the last varies fastest.
    pub grid: Vec<(JointId, Steps)>,
    /// Random joints and ranges, rad or m.
    pub random: BTreeMap<JointId, (f64, f64)>,
    /// Number of random poses.
    pub poses: usize,
    /// One group of all poses per value of this joint.
    pub repeat_at: Option<(JointId, Vec<f64>)>,
    /// What the tracker's noise is multiplied by, above 0: one factor per value of `repeat_at`, or a single one without.
    pub tracker_noise_times: Vec<f64>,
    /// Held joints.
    pub hold: BTreeMap<JointId, f64>,
    /// Bodies in view.
    pub bodies: Vec<String>,
}

/// Equal steps, ends included, rad or m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Steps {
    /// First.
    pub from: f64,
    /// Last.
    pub to: f64,
    /// How many.
    pub poses: usize,
}
