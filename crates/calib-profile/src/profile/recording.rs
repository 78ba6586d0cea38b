//! Recordings: what each is for, and how its rows become poses.

use super::{Clocks, ParameterValue, TimedPoses, Usage};
use calib_recording::ColumnMap;
use calib_urdf::JointId;
use std::collections::{BTreeMap, BTreeSet};

/// A recording and what it is for.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordingSpec {
    /// File, relative to the profile.
    pub file: String,
    /// What it is for.
    pub usage: Usage,
    /// Range asked of each moved joint, rad or m, lower first.
    pub ranges: BTreeMap<JointId, (f64, f64)>,
    /// Joints that stood still and are not in the file, rad or m.
    pub hold: BTreeMap<JointId, f64>,
    /// Text column that groups the poses.
    pub group: Option<String>,
    /// Reader by id; found from the content when `None`.
    pub reader: Option<String>,
    /// Parameters of the reader.
    pub reader_parameters: BTreeMap<String, ParameterValue>,
    /// Meaning of columns that do not follow our own names.
    pub columns: Option<ColumnMap>,
    /// The robot's own log, where it is another file.
    pub robot_log: Option<RobotLog>,
    /// How rows with a time become poses; `None`: every row is a pose.
    pub timing: Option<Timing>,
    /// Where it stands among the recordings of the profile, from 0: taken for the order in which they were made.
    pub place: usize,
}

impl RecordingSpec {
    /// The bodies whose columns hold the pose of the tracker in the body.
    #[must_use]
    pub fn inverse_bodies(&self) -> BTreeSet<String> {
        let columns = self.columns.as_ref();
        columns.map(ColumnMap::inverse_bodies).unwrap_or_default()
    }
}

/// The robot's own log of its joints.
#[derive(Debug, Clone, PartialEq)]
pub struct RobotLog {
    /// File, relative to the profile.
    pub file: String,
    /// Reader by id; found from the content when `None`.
    pub reader: Option<String>,
    /// Meaning of columns that do not follow our own names.
    pub columns: Option<ColumnMap>,
}

/// Time in a recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Timing {
    /// Where the poses come from.
    pub poses: TimedPoses,
    /// What is known of the clocks.
    pub clock: Clocks,
    /// Shortest hold, s.
    pub hold: f64,
    /// Rows taken from a motion, Hz.
    pub rate: f64,
    /// Largest offset between the clocks, s.
    pub max_offset: f64,
    /// By how much the values of a joint are later than those of the others, s.
    pub late: BTreeMap<JointId, f64>,
}
