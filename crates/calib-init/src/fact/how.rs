//! How units were found.

use serde::Serialize;

/// How the unit of angles was found.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum AngleHow {
    /// The names of the columns say it.
    Named,
    /// The largest number.
    Range {
        /// In the unit of the file.
        largest: f64,
    },
}

/// How the unit of lengths was found.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum LengthHow {
    /// The names of the columns say it.
    Named,
    /// The extent of what was tracked against the reach of the robot.
    Range {
        /// In the unit of the file.
        extent: f64,
        /// m.
        reach: f64,
    },
}
