//! What a finding is about.

use crate::printable_line;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::fmt;

/// What a finding is about: a thing, and the recordings or the file in which it was seen.
#[derive(
    Debug, Clone, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema,
)]
pub struct Subject {
    /// The thing.
    #[serde(flatten)]
    pub about: About,
    /// The recordings in which it was seen; empty where none is named.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub recordings: Vec<String>,
    /// The file in which it was seen, where no recording is named.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub file: Option<String>,
}

/// A reference to one thing by its kind and name.
#[derive(
    Debug, Clone, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema,
)]
#[serde(tag = "kind", content = "name", rename_all = "snake_case")]
#[non_exhaustive]
pub enum About {
    /// A recording as a whole.
    #[default]
    Recording,
    /// A marker.
    Marker(String),
    /// Several markers.
    Markers(Vec<String>),
    /// A tracked body.
    Body(String),
    /// A joint of the robot.
    Joint(String),
    /// A column, field or topic of a file.
    Column(String),
    /// A file.
    File(String),
    /// A hold of a recording.
    Hold(String),
    /// An origin of the profile.
    Origin(String),
    /// A parameter of the fit.
    Parameter(String),
    /// The time of the rows.
    Time,
    /// The clocks of tracker and robot.
    Clocks,
    /// All lengths of a recording.
    Lengths,
    /// The tracker.
    Tracker,
    /// The method of the solution.
    Method,
    /// The fit.
    Fit,
}

impl From<About> for Subject {
    fn from(about: About) -> Self {
        Subject {
            about,
            recordings: Vec::new(),
            file: None,
        }
    }
}

impl Subject {
    /// A recording as a whole.
    pub fn recording(name: impl Into<String>) -> Self {
        Subject::default().in_recording(name)
    }

    /// A marker.
    pub fn marker(name: impl Into<String>) -> Self {
        About::Marker(name.into()).into()
    }

    /// A tracked body.
    pub fn body(name: impl Into<String>) -> Self {
        About::Body(name.into()).into()
    }

    /// A joint.
    pub fn joint(name: impl Into<String>) -> Self {
        About::Joint(name.into()).into()
    }

    /// A column, field or topic of a file.
    pub fn column(name: impl Into<String>) -> Self {
        About::Column(name.into()).into()
    }

    /// The same thing, in this recording instead of a file.
    #[must_use]
    pub fn in_recording(mut self, name: impl Into<String>) -> Self {
        self.recordings = vec![name.into()];
        self.file = None;
        self
    }

    /// The same thing, in this file.
    #[must_use]
    pub fn in_file(mut self, name: impl Into<String>) -> Self {
        self.file = Some(name.into());
        self
    }

    /// Whether the thing was seen in this recording.
    #[must_use]
    pub fn is_in(&self, recording: &str) -> bool {
        self.recordings.iter().any(|name| name == recording)
    }
}

impl fmt::Display for Subject {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let place = match &self.file {
            Some(file) if self.recordings.is_empty() => file.clone(),
            _ => self.recordings.join(", "),
        };
        let about = self.about.to_string();
        match (place.is_empty(), about.is_empty()) {
            (true, true) => f.write_str("recording"),
            (true, false) => f.write_str(&about),
            (false, true) => f.write_str(&printable_line(&place)),
            (false, false) => write!(f, "{}: {about}", printable_line(&place)),
        }
    }
}

/// The name; nothing for a recording as a whole.
impl fmt::Display for About {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            About::Recording => Ok(()),
            About::Marker(name)
            | About::Body(name)
            | About::Joint(name)
            | About::Column(name)
            | About::File(name)
            | About::Origin(name)
            | About::Parameter(name) => f.write_str(&printable_line(name)),
            About::Markers(names) => f.write_str(&printable_line(&names.join(", "))),
            About::Hold(name) => write!(f, "hold {}", printable_line(name)),
            About::Time => f.write_str("time"),
            About::Clocks => f.write_str("clocks"),
            About::Lengths => f.write_str("lengths"),
            About::Tracker => f.write_str("tracker"),
            About::Method => f.write_str("method"),
            About::Fit => f.write_str("fit"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_subject_leads_with_its_place() {
        let marker = Subject::marker("m1");
        assert_eq!(marker.to_string(), "m1");
        assert_eq!(marker.clone().in_file("a.csv").to_string(), "a.csv: m1");
        let mut placed = marker.in_file("a.csv").in_recording("sweep");
        assert_eq!(placed.to_string(), "sweep: m1");
        placed.recordings.push("poses".to_owned());
        assert_eq!(placed.to_string(), "sweep, poses: m1");
        assert_eq!(Subject::recording("sweep").to_string(), "sweep");
        assert_eq!(Subject::default().to_string(), "recording");
    }
}
