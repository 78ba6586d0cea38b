//! The profile as the program needs it: SI, ids, every reference resolved.

mod body;
mod contact;
mod load;
mod origin;
mod plan;
mod recording;
mod simulate;
mod solve;

pub use crate::touched::Touched;
pub use body::{Body, BodyKind};
pub use contact::{ByRow, Contact, ContactBase, Spots, Tip};
pub use load::RobotLoad;
pub use origin::{LinkTransform, Loop, Orientation, Origin, PointChoice, SweptAxis};
pub use plan::{Camera, Facing, KeepOut, PlanSpec};
pub use recording::{RecordingSpec, RobotLog, Timing};
pub use simulate::{Error3, Protocol, SimErrors, SimMount, SimNoise, Simulation, Steps};
pub use solve::{
    FreeEffect, JointException, JointFreeSet, Limits, Noise, OriginFreeSet, Prior, SharedWidth,
    Solve,
};

pub use crate::raw::{
    RawClocks as Clocks, RawFree as Free, RawIdentification as Identification,
    RawJointFree as JointFree, RawLoad as Load, RawMethod as Method, RawSplit as Split,
    RawStart as StartFrom, RawTimedPoses as TimedPoses, RawUpAxis as UpAxis, RawUse as Usage,
};
pub use crate::raw::{RawPlugin as Plugin, RawValue as ParameterValue};

use nalgebra::Isometry3;
use std::collections::BTreeMap;

/// A checked profile. Lengths m, angles rad, torques N m.
#[derive(Debug, Clone, PartialEq)]
pub struct Profile {
    /// Name of the robot in reports.
    pub robot: String,
    /// URDF file, relative to the profile.
    pub urdf: String,
    /// Folders of packages with meshes, relative to the profile, by name.
    pub packages: BTreeMap<String, String>,
    /// What loads the joints.
    pub load: RobotLoad,
    /// What was measured, by whom, when and with what.
    pub identification: Identification,
    /// The tracker.
    pub tracker: Tracker,
    /// Tracking bodies by name.
    pub bodies: BTreeMap<String, Body>,
    /// The tracker's name of a body or marker, by its name in the profile.
    pub names: BTreeMap<String, String>,
    /// Recordings by name.
    pub recordings: BTreeMap<String, RecordingSpec>,
    /// Plugins to load, by name.
    pub plugins: BTreeMap<String, Plugin>,
    /// Unknown transforms by name.
    pub origins: BTreeMap<String, Origin>,
    /// Transforms between links to report, by name.
    pub transforms: BTreeMap<String, LinkTransform>,
    /// Loop closures by name.
    pub loops: BTreeMap<String, Loop>,
    /// Touching points by name.
    pub points: BTreeMap<String, Tip>,
    /// Touches by name.
    pub contacts: BTreeMap<String, Contact>,
    /// How to solve.
    pub solve: Solve,
    /// What is written.
    pub outputs: Outputs,
    /// Which postures may be planned, and what the tracker sees.
    pub plan: PlanSpec,
    /// How to simulate, when the profile says.
    pub simulate: Option<Simulation>,
}

/// The tracker and what its maker states about its noise (standard deviations).
#[derive(Debug, Clone, PartialEq)]
pub struct Tracker {
    /// Name of its world frame.
    pub frame: String,
    /// One marker coordinate, m.
    pub marker_sigma: Option<f64>,
    /// One coordinate of a body's position, m.
    pub body_sigma: Option<f64>,
    /// A body's orientation about each axis, rad.
    pub body_sigma_rad: Option<f64>,
    /// One along the line of sight, where it is stated apart from those across it.
    pub sight: SightSigma,
    /// Axis of the tracker's frame along which the robot's root has its z, where it was said.
    pub up_axis: Option<UpAxis>,
    /// Measured pose of the robot's root.
    pub from_root: Option<FromRoot>,
}

/// What is stated of the noise along the line of sight (standard deviations).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SightSigma {
    /// A marker, m.
    pub marker: Option<f64>,
    /// A body's position, m.
    pub body: Option<f64>,
    /// A body's rotation about the line of sight, rad.
    pub body_rad: Option<f64>,
}

impl Tracker {
    /// rms over the directions of the σ of a marker's coordinate, m, where it is stated.
    #[must_use]
    pub fn marker_coordinate(&self) -> Option<f64> {
        rms(self.marker_sigma, self.sight.marker)
    }

    /// rms over the directions of the σ of a coordinate of a body's position, m, where it is stated.
    #[must_use]
    pub fn body_coordinate(&self) -> Option<f64> {
        rms(self.body_sigma, self.sight.body)
    }
}

/// Of two directions across the line of sight and one along it.
fn rms(across: Option<f64>, along: Option<f64>) -> Option<f64> {
    let across = across?;
    let along = along.filter(|along| *along != across);
    Some(along.map_or(across, |along| {
        ((2.0 * across * across + along * along) / 3.0).sqrt()
    }))
}

/// A measured `tracker_from_root`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FromRoot {
    /// The pose.
    pub pose: Isometry3<f64>,
    /// σ of each coordinate of the position, m.
    pub sigma: f64,
    /// σ of the orientation about each axis, rad.
    pub sigma_rad: f64,
}

/// What is written.
#[derive(Debug, Clone, PartialEq)]
pub struct Outputs {
    /// Patched URDF.
    pub urdf: String,
    /// Scene.
    pub scene: String,
    /// Bodies added to the patched URDF.
    pub add_bodies: Vec<String>,
    /// Points added to the patched URDF.
    pub add_points: Vec<String>,
    /// Report writers to run too, with their parameters.
    pub reports: BTreeMap<String, BTreeMap<String, ParameterValue>>,
}
