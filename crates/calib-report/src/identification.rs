//! What was measured, by whom, when and with what, as the profile states it.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What identifies a measurement, as the profile states it. No clock is read.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Identification {
    /// Serial number of the robot.
    #[serde(default)]
    pub serial_number: Option<String>,
    /// Who measured.
    #[serde(default)]
    pub operator: Option<String>,
    /// When it was measured.
    #[serde(default)]
    pub date: Option<String>,
    /// Maker and model of the tracker, number of cameras, serial number.
    #[serde(default)]
    pub tracker: Option<String>,
}
