//! The canonical recording: what every reader makes, whatever the laboratory wrote.

use calib_finding::Finding;
use nalgebra::{Isometry3, Matrix6, Point3};
use std::collections::{BTreeMap, BTreeSet};

/// Everything that one file says: streams of joints, torques, temperatures, bodies and markers, in SI, each with its clock.
///
/// Lengths m, angles rad, times s, torques N·m, temperatures °C, right-handed. A lost sample is a state, never zeros or NaN.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Recording {
    /// Where it comes from and what was done to it.
    pub meta: Meta,
    /// The sampling instants. Streams refer to them by index, so streams of one device share one.
    pub timelines: Vec<Timeline>,
    /// Joint positions.
    pub joints: Vec<JointStream>,
    /// Joint torques (forces for prismatic joints).
    pub torques: Vec<TorqueStream>,
    /// Temperatures.
    pub temperatures: Vec<TemperatureStream>,
    /// Bodies with six degrees of freedom.
    pub bodies: Vec<BodyStream>,
    /// Single markers.
    pub markers: Vec<MarkerStream>,
}

/// Where a recording comes from and what was done to it on the way in.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Meta {
    /// The file as the caller named it.
    pub source: String,
    /// Id of the reader, see [`readers`](crate::readers::readers).
    pub format: String,
    /// Comment lines of the file (without `#`), or its header fields as `key: value`.
    pub comments: Vec<String>,
    /// What the reader converted: units, rotation convention, order, ignored columns. One sentence each.
    pub conversions: Vec<String>,
    /// The axis that points up, where the file says so (`+X` … `-Z`).
    pub up_axis: Option<String>,
    /// What the reader noticed.
    pub findings: Vec<Finding>,
    /// The columns of joints, by the joint, of a table.
    pub joint_columns: BTreeMap<String, JointColumn>,
    /// Bodies whose poses the file states the other way round, the tracker's in the body: that is what was measured, with its noise.
    pub inverse_bodies: BTreeSet<String>,
}

/// The column of a joint.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct JointColumn {
    /// Its name.
    pub name: String,
    /// The unit in which it was read, as it stands behind `_` in names: `deg`.
    pub unit: &'static str,
}

/// Sampling instants of one device.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Timeline {
    /// Which clock the times are read from, e.g. `tracker frames at 100 Hz`. Two timelines share a clock only
    /// when these texts are equal.
    pub clock: String,
    /// Where each sample stands in the file: the frame number where the format numbers its frames, else the line
    /// (from 1).
    pub rows: Vec<u64>,
    /// Times, s, never decreasing. `None` for a table of static poses, which has no useful time.
    pub t: Option<Vec<f64>>,
    /// When each sample arrived at the computer that recorded it, by that computer's own clock, s since 1970; `None`
    /// where nobody wrote it down. A second clock beside `t`: it is late by what the tracker and the network need.
    pub received: Option<Vec<f64>>,
    /// Text columns that name a sample: `trial`, `group`, … ; one text per sample.
    pub labels: BTreeMap<String, Vec<String>>,
}

impl Timeline {
    /// Number of samples.
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// No samples.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }
}

/// What a joint's number measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum JointUnit {
    /// Radians inside.
    Angle,
    /// Meters inside.
    Length,
}

/// One joint.
#[derive(Clone, Debug, PartialEq)]
pub struct JointStream {
    /// The joint's name, without unit.
    pub name: String,
    /// Index into [`Recording::timelines`].
    pub timeline: usize,
    /// Angle or length.
    pub unit: JointUnit,
    /// Position, rad or m; `None` = not recorded at this sample.
    pub q: Vec<Option<f64>>,
}

/// Torque of one joint, N·m.
#[derive(Clone, Debug, PartialEq)]
pub struct TorqueStream {
    /// The joint's name.
    pub name: String,
    /// Index into [`Recording::timelines`].
    pub timeline: usize,
    /// Torque, N·m; `None` = not recorded.
    pub torque: Vec<Option<f64>>,
}

/// Name of the temperature of a robot as a whole: the column `temperature_c`.
pub const WHOLE_ROBOT: &str = "robot";

/// Temperature of the link before one joint, or of the whole robot, °C.
#[derive(Clone, Debug, PartialEq)]
pub struct TemperatureStream {
    /// The joint's name, or [`WHOLE_ROBOT`].
    pub name: String,
    /// Index into [`Recording::timelines`].
    pub timeline: usize,
    /// Temperature, °C; `None` = not recorded.
    pub celsius: Vec<Option<f64>>,
}

/// One rigid body as the tracker reports it.
#[derive(Clone, Debug, PartialEq)]
pub struct BodyStream {
    /// Its name.
    pub name: String,
    /// Index into [`Recording::timelines`].
    pub timeline: usize,
    /// `tracker_from_body`; `None` = lost.
    pub tracker_from_body: Vec<Option<Isometry3<f64>>>,
    /// The device's own quality per sample where it gives one, in its own scale; else empty.
    pub quality: Vec<Option<f64>>,
    /// Covariance per sample in the body frame, `[ω; v]`, where the device gives one; else empty.
    pub covariance: Vec<Option<Matrix6<f64>>>,
}

/// One sample of a marker.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MarkerSample {
    /// Not seen.
    Lost,
    /// Measured.
    Measured(Point3<f64>),
    /// Interpolated, or computed from a model: not used in fits unless asked for.
    Filled(Point3<f64>),
}

/// Whether interpolated samples count.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Filled {
    /// They are treated as lost (default: an interpolated point measures nothing).
    #[default]
    Exclude,
    /// They are treated as measured.
    Include,
}

impl MarkerSample {
    /// The point, if there is one to be used.
    pub fn point(&self, filled: Filled) -> Option<Point3<f64>> {
        match (self, filled) {
            (MarkerSample::Measured(point), _) | (MarkerSample::Filled(point), Filled::Include) => {
                Some(*point)
            }
            _ => None,
        }
    }
}

/// One marker.
#[derive(Clone, Debug, PartialEq)]
pub struct MarkerStream {
    /// Its name. An unlabeled one keeps the name that the device gave it for the moment.
    pub name: String,
    /// The body that the device counts it to.
    pub body: Option<String>,
    /// The device does not know which marker this is: the same name may be another marker later.
    pub unlabeled: bool,
    /// Index into [`Recording::timelines`].
    pub timeline: usize,
    /// Points in the tracker's frame, m.
    pub samples: Vec<MarkerSample>,
}

impl MarkerStream {
    /// How many samples are lost.
    pub fn lost(&self) -> usize {
        self.samples
            .iter()
            .filter(|sample| matches!(sample, MarkerSample::Lost))
            .count()
    }
}
