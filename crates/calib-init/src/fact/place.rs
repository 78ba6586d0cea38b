//! Parts of a profile that facts are about.

use serde::Serialize;

/// What a fact is about: a part of the profile.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Place {
    /// The robot.
    Robot,
    /// The tracker and its noise.
    Tracker,
    /// A body, by name.
    Body(String),
    /// All recordings together.
    Recordings,
    /// A recording, by name.
    Recording(String),
    /// The limits of the verdict.
    Limits,
    /// The simulated recordings.
    Simulate,
}
