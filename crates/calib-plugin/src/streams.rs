//! What readers give: the streams of a recording, as plain values in SI.

use crate::motion::BodyPose;

/// Sampling instants of one device.
#[derive(Debug, Clone, PartialEq)]
pub struct Timeline {
    /// Which clock; one text per clock.
    pub clock: String,
    /// Where each sample stands in the file: frame number or line, from 1.
    pub rows: Vec<u64>,
    /// Times, s, never decreasing; `None` for static poses.
    pub t_s: Option<Vec<f64>>,
    /// Text columns that name samples.
    pub labels: Vec<(String, Vec<String>)>,
}

/// One sample of a marker, m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum MarkerSample {
    /// Not seen.
    Lost,
    /// Measured.
    Measured([f64; 3]),
    /// Interpolated or computed.
    Filled([f64; 3]),
}

/// A marker.
#[derive(Debug, Clone, PartialEq)]
pub struct MarkerTrack {
    /// Its name.
    pub name: String,
    /// Index of its timeline.
    pub timeline: usize,
    /// One for each instant.
    pub samples: Vec<MarkerSample>,
}

/// A body with six degrees of freedom.
#[derive(Debug, Clone, PartialEq)]
pub struct BodyTrack {
    /// Its name.
    pub name: String,
    /// Index of its timeline.
    pub timeline: usize,
    /// `tracker_from_body`, one for each instant; `None` = lost.
    pub samples: Vec<Option<BodyPose>>,
}

/// What a joint's number measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum JointUnit {
    /// rad.
    Angle,
    /// m.
    Length,
}

/// A joint.
#[derive(Debug, Clone, PartialEq)]
pub struct JointTrack {
    /// Its name.
    pub name: String,
    /// Index of its timeline.
    pub timeline: usize,
    /// Angle or length.
    pub unit: JointUnit,
    /// rad or m, one for each instant; `None` = not recorded.
    pub samples: Vec<Option<f64>>,
}

/// The torque of a joint.
#[derive(Debug, Clone, PartialEq)]
pub struct TorqueTrack {
    /// The joint's name.
    pub name: String,
    /// Index of its timeline.
    pub timeline: usize,
    /// N·m, one for each instant; `None` = not recorded.
    pub samples: Vec<Option<f64>>,
}

/// All streams of one file.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Streams {
    /// Instants that the tracks refer to by index.
    pub timelines: Vec<Timeline>,
    /// Markers.
    pub markers: Vec<MarkerTrack>,
    /// Bodies.
    pub bodies: Vec<BodyTrack>,
    /// Joints.
    pub joints: Vec<JointTrack>,
    /// Torques.
    pub torques: Vec<TorqueTrack>,
    /// What was converted or left out, one sentence each.
    pub notes: Vec<String>,
}

impl Streams {
    /// No track at all.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.markers.is_empty()
            && self.bodies.is_empty()
            && self.joints.is_empty()
            && self.torques.is_empty()
    }
}

/// A file that was loaded for a reader.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Source<'a> {
    /// Its name, for messages.
    pub name: &'a str,
    /// All of it.
    pub bytes: &'a [u8],
}

/// A calibration, for a report writer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ReportInput<'a> {
    /// What `report.json` holds; SI.
    pub report_json: &'a [u8],
    /// What `scene.json` holds, where there is one.
    pub scene_json: Option<&'a [u8]>,
}

/// A file that a report writer made.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ReportFile {
    /// Relative, `/` between folders, no `..`.
    pub path: String,
    /// Its content.
    pub bytes: Vec<u8>,
}
