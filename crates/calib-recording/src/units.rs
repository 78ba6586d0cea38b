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
    /// Micrometers.
    Um,
    /// Inches of 25.4 mm.
    In,
    /// Feet of 12 inches.
    Ft,
}

impl LengthUnit {
    /// All of them.
    pub const ALL: [LengthUnit; 6] = [
        LengthUnit::M,
        LengthUnit::Cm,
        LengthUnit::Mm,
        LengthUnit::Um,
        LengthUnit::In,
        LengthUnit::Ft,
    ];

    /// Units in a metre.
    pub fn per_meter(self) -> f64 {
        match self {
            LengthUnit::M => 1.0,
            LengthUnit::Cm => 1e2,
            LengthUnit::Mm => 1e3,
            LengthUnit::Um => 1e6,
            LengthUnit::In => 1.0 / 0.0254,
            LengthUnit::Ft => 1.0 / 0.3048,
        }
    }

    /// From the word or abbreviation that trackers write: `mm`, `Millimeters`, `m`, … .
    pub fn from_text(text: &str) -> Option<Self> {
        match text.trim().to_ascii_lowercase().as_str() {
            "m" | "meter" | "meters" | "metre" | "metres" => Some(LengthUnit::M),
            "cm" | "centimeter" | "centimeters" | "centimetre" | "centimetres" => {
                Some(LengthUnit::Cm)
            }
            "mm" | "millimeter" | "millimeters" | "millimetre" | "millimetres" => {
                Some(LengthUnit::Mm)
            }
            "um" | "µm" | "micrometer" | "micrometers" | "micron" | "microns" => {
                Some(LengthUnit::Um)
            }
            "in" | "inch" | "inches" => Some(LengthUnit::In),
            "ft" | "foot" | "feet" => Some(LengthUnit::Ft),
            _ => None,
        }
    }

    /// The unit with this abbreviation.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|unit| unit.name() == name)
    }

    /// Abbreviation, as it stands behind `_` in a column's name.
    pub fn name(self) -> &'static str {
        match self {
            LengthUnit::M => "m",
            LengthUnit::Cm => "cm",
            LengthUnit::Mm => "mm",
            LengthUnit::Um => "um",
            LengthUnit::In => "in",
            LengthUnit::Ft => "ft",
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

    /// From the words and signs for it: `deg`, `degrees`, `°`, `rad`, … .
    pub fn from_text(text: &str) -> Option<Self> {
        match text.trim().to_ascii_lowercase().as_str() {
            "rad" | "radian" | "radians" => Some(AngleUnit::Rad),
            "deg" | "degree" | "degrees" | "°" => Some(AngleUnit::Deg),
            _ => None,
        }
    }

    /// Abbreviation, as it stands behind `_` in a column's name.
    pub fn name(self) -> &'static str {
        match self {
            AngleUnit::Rad => "rad",
            AngleUnit::Deg => "deg",
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

    /// From the words for it: `s`, `seconds`, `ms`, … .
    pub fn from_text(text: &str) -> Option<Self> {
        match text.trim().to_ascii_lowercase().as_str() {
            "s" | "sec" | "secs" | "second" | "seconds" => Some(TimeUnit::S),
            "ms" | "msec" | "millisecond" | "milliseconds" => Some(TimeUnit::Ms),
            "us" | "µs" | "usec" | "microsecond" | "microseconds" => Some(TimeUnit::Us),
            "ns" | "nsec" | "nanosecond" | "nanoseconds" => Some(TimeUnit::Ns),
            _ => None,
        }
    }

    /// Abbreviation, as it stands behind `_` in a column's name.
    pub fn name(self) -> &'static str {
        match self {
            TimeUnit::S => "s",
            TimeUnit::Ms => "ms",
            TimeUnit::Us => "us",
            TimeUnit::Ns => "ns",
        }
    }
}
