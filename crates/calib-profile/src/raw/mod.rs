//! The profile as a person writes it: units in key names, no logic, unknown keys refused.
//!
//! Field documentation here is the source of the profile reference in the book and of the JSON Schema
//! that editors use.

mod body;
mod contact;
mod free;
mod origin;
mod plan;
mod recording;
mod robot;
mod simulate;
mod solve;

pub use crate::touched::RawTouched;
pub use body::{RawBody, RawPose, RawSplit};
pub use contact::{RawContact, RawContactPoint};
pub(crate) use free::{ANGLE, MASS, MASS_CENTER, POSITION, PRIOR_KEYS};
pub use free::{RawFree, RawJointFree, RawPrior};
pub use origin::{RawLoop, RawOrientation, RawOrigin, RawPoint, RawTransform};
pub use plan::{RawCamera, RawFacing, RawKeepOut, RawPlan};
pub use recording::{
    RawClocks, RawRecording, RawRobotLog, RawRows, RawTimedPoses, RawTiming, RawUse,
};
pub use robot::{RawPayload, RawRobot};
pub use simulate::{
    RawNoiseTimes, RawProtocol, RawSimErrors, RawSimMount, RawSimNoise, RawSimulate, RawSteps,
};
pub use solve::{
    RawJointSolve, RawLimits, RawLoad, RawMethod, RawNoise, RawNoiseModel, RawSolve, RawStart,
};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A robot calibration profile, version 1.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawProfile {
    /// Version of this format: 1.
    pub calib: u32,
    /// The robot and its description.
    pub robot: RawRobot,
    /// What was measured, by whom, when and with what: shown in reports, used for nothing else.
    #[serde(default)]
    pub identification: RawIdentification,
    /// The optical tracker.
    pub tracker: RawTracker,
    /// What the tracker sees, by name, and which link each body is bolted to.
    pub bodies: BTreeMap<String, RawBody>,
    /// The tracker's own names of bodies and markers, where they differ: name in this profile → name in the recordings and in what a
    /// live tracker sends.
    #[serde(default)]
    pub names: BTreeMap<String, String>,
    /// The recordings, by name, in the order in which they were made.
    #[serde(deserialize_with = "recording::in_their_order")]
    pub recordings: BTreeMap<String, RawRecording>,
    /// Plugins to load, by name; found beside the profile in `plugins/` or on the search path.
    #[serde(default)]
    pub plugins: BTreeMap<String, RawPlugin>,
    /// The unknown transforms: joint origins relative to tracking bodies, by name.
    #[serde(default)]
    pub origins: BTreeMap<String, RawOrigin>,
    /// Transforms between links to report beside the origins, by name.
    #[serde(default)]
    pub transforms: BTreeMap<String, RawTransform>,
    /// Loop closures: two origins measured by the tracker against forward kinematics, by name.
    #[serde(default)]
    pub loops: BTreeMap<String, RawLoop>,
    /// Contact points of links, by name.
    #[serde(default)]
    pub points: BTreeMap<String, RawContactPoint>,
    /// Contacts: a point of one link on a plane, line, point or at a distance fixed to another link, by name.
    #[serde(default)]
    pub contacts: BTreeMap<String, RawContact>,
    /// How to solve, and what counts as good enough.
    #[serde(default)]
    pub solve: RawSolve,
    /// What is written.
    #[serde(default)]
    pub outputs: RawOutputs,
    /// Which postures `calib plan` may propose, and what the tracker sees.
    #[serde(default)]
    pub plan: RawPlan,
    /// How `calib simulate` makes recordings with known truth for this robot.
    #[serde(default)]
    pub simulate: Option<RawSimulate>,
}

/// What identifies a measurement in reports. No clock is read: a date stands here or nowhere.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawIdentification {
    /// Serial number of the robot.
    #[serde(default)]
    pub serial_number: Option<String>,
    /// Who measured.
    #[serde(default)]
    pub operator: Option<String>,
    /// When it was measured, `2026-11-03`.
    #[serde(default)]
    pub date: Option<String>,
    /// Maker and model of the tracker, number of cameras, serial number.
    #[serde(default)]
    pub tracker: Option<String>,
}

/// The optical tracker.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawTracker {
    /// Name of the tracker's world frame in reports and scenes.
    pub frame: String,
    /// Stated standard deviation of one marker coordinate, mm; estimated from the data when absent.
    #[serde(default)]
    pub marker_sigma_mm: Option<f64>,
    /// Stated standard deviation of one coordinate of a body's position, mm.
    #[serde(default)]
    pub body_sigma_mm: Option<f64>,
    /// Stated standard deviation of a body's orientation about each axis, deg.
    #[serde(default)]
    pub body_sigma_deg: Option<f64>,
    /// Stated standard deviation of a marker along the line of sight from the tracker's origin, mm, if it differs from that across it, which `marker_sigma_mm` then states.
    #[serde(default)]
    pub marker_sight_sigma_mm: Option<f64>,
    /// Stated standard deviation of a body's position along the line of sight, mm, if it differs from that across it (single camera), which `body_sigma_mm` then states.
    #[serde(default)]
    pub body_sight_sigma_mm: Option<f64>,
    /// Stated standard deviation of a body's rotation about the line of sight, deg, if it differs from that about the axes across it, which `body_sigma_deg` then states.
    #[serde(default)]
    pub body_sight_sigma_deg: Option<f64>,
    /// The axis of the tracker's world frame along which the robot's root frame has its z: `+Z` for a robot that stands
    /// upright before a tracker whose z is up. Only compared with what the recordings show, never assumed.
    #[serde(default)]
    pub up_axis: Option<RawUpAxis>,
    /// Where the robot's root was measured to be in the tracker's frame (`tracker_from_root`), e.g. by its reference holes.
    #[serde(default)]
    pub from_root: Option<RawFromRoot>,
}

/// A measured pose of the robot's root in the tracker's frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawFromRoot {
    /// Position, mm.
    #[serde(default)]
    pub xyz_mm: [f64; 3],
    /// Roll, pitch, yaw about fixed axes, deg.
    #[serde(default)]
    pub rpy_deg: [f64; 3],
    /// Standard deviation of each coordinate of the position, mm.
    pub sigma_mm: f64,
    /// Standard deviation of the orientation about each axis, deg.
    pub sigma_deg: f64,
}

/// An axis of the tracker's world frame, with its sign.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum RawUpAxis {
    /// Along x.
    #[serde(rename = "+X")]
    PlusX,
    /// Along y.
    #[serde(rename = "+Y")]
    PlusY,
    /// Along z.
    #[serde(rename = "+Z")]
    PlusZ,
    /// Against x.
    #[serde(rename = "-X")]
    MinusX,
    /// Against y.
    #[serde(rename = "-Y")]
    MinusY,
    /// Against z.
    #[serde(rename = "-Z")]
    MinusZ,
}

impl RawUpAxis {
    /// As in the profile: `+Z`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::PlusX => "+X",
            Self::PlusY => "+Y",
            Self::PlusZ => "+Z",
            Self::MinusX => "-X",
            Self::MinusY => "-Y",
            Self::MinusZ => "-Z",
        }
    }
}

/// A plugin to load.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawPlugin {
    /// The library, relative to the profile; found by its name when absent.
    pub path: Option<String>,
    /// SHA-256 of the library: another file is refused.
    pub sha256: Option<String>,
}

/// A value of an estimator's parameter.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum RawValue {
    /// Yes or no.
    Bool(bool),
    /// A whole number.
    Integer(i64),
    /// A number.
    Number(f64),
    /// A text.
    Text(String),
}

/// What is written, relative to the output folder.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawOutputs {
    /// Name of the patched URDF; `<robot>.calibrated.urdf` when absent.
    pub urdf: Option<String>,
    /// Name of the scene; `<robot>.scene.json` when absent.
    pub scene: Option<String>,
    /// Tracking bodies to add to the patched URDF as fixed joints and links; of a body with one or two markers, the points.
    pub add_bodies: Vec<String>,
    /// Points (of `points`) to add to the patched URDF as fixed joints and links, e.g. a tool center point.
    pub add_points: Vec<String>,
    /// Report writers to run too, built-in or of a plugin, each with its parameters.
    pub reports: BTreeMap<String, BTreeMap<String, RawValue>>,
}
