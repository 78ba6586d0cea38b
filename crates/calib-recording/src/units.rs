//! Units at the edge of the crate: what a column's number is divided by to become SI.
//!
//! Division, because 1000 is a double and 0.001 is not: 237 mm is then exactly the double 0.237.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Unit of lengths in a file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum LengthUnit {
    /// Meters.
    #[default]
    M,
    /// Centimeters.
    Cm,
    /// Millimeters.
    Mm,
}

impl LengthUnit {
    /// Units in a metre.
    pub fn per_meter(self) -> f64 {
        match self {
            LengthUnit::M => 1.0,
            LengthUnit::Cm => 1e2,
            LengthUnit::Mm => 1e3,
        }
    }

    /// From the word or abbreviation that trackers write: `mm`, `Millimeters`, `m`, … .
    pub fn from_text(text: &str) -> Option<Self> {
        match text.trim().to_ascii_lowercase().as_str() {
            "m" | "meter" | "meters" | "metre" | "metres" => Some(LengthUnit::M),
            "cm" | "centimeter" | "centimeters" | "centimetres" => Some(LengthUnit::Cm),
            "mm" | "millimeter" | "millimeters" | "millimetres" => Some(LengthUnit::Mm),
            _ => None,
        }
    }

    /// Abbreviation.
    pub fn name(self) -> &'static str {
        match self {
            LengthUnit::M => "m",
            LengthUnit::Cm => "cm",
            LengthUnit::Mm => "mm",
        }
    }
}

/// Unit of angles in a file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum AngleUnit {
    /// Radians.
    #[default]
    Rad,
    /// Degrees.
    Deg,
}

impl AngleUnit {
    /// Units in a radian.
    pub fn per_radian(self) -> f64 {
        match self {
            AngleUnit::Rad => 1.0,
            AngleUnit::Deg => 180.0 / std::f64::consts::PI,
        }
    }
}

/// Unit of times in a file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum TimeUnit {
    /// Seconds.
    #[default]
    S,
    /// Milliseconds.
    Ms,
    /// Microseconds.
    Us,
    /// Nanoseconds.
    Ns,
}

impl TimeUnit {
    /// Units in a second.
    pub fn per_second(self) -> f64 {
        match self {
            TimeUnit::S => 1.0,
            TimeUnit::Ms => 1e3,
            TimeUnit::Us => 1e6,
            TimeUnit::Ns => 1e9,
        }
    }
}
