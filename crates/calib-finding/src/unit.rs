//! Units of numbers whose kind is only known at run time.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The SI unit of a number whose kind is only known at run time.
#[derive(
    Debug,
    Clone,
    Copy,
    Default,
    PartialEq,
    Eq,
    PartialOrd,
    Ord,
    Hash,
    Serialize,
    Deserialize,
    JsonSchema,
)]
#[non_exhaustive]
pub enum Unit {
    /// Length, m; people read mm.
    #[serde(rename = "m")]
    Meter,
    /// Angle, rad; people read degrees.
    #[serde(rename = "rad")]
    Radian,
    /// Time, s; people read ms.
    #[serde(rename = "s")]
    Second,
    /// A ratio.
    #[default]
    #[serde(rename = "1")]
    One,
    /// Angular velocity, rad/s; people read degrees per second.
    #[serde(rename = "rad/s")]
    RadianPerSecond,
    /// Compliance of a revolute joint, rad/(N·m).
    #[serde(rename = "rad/(N·m)")]
    RadianPerNewtonMeter,
    /// Compliance of a prismatic joint, m/N.
    #[serde(rename = "m/N")]
    MeterPerNewton,
    /// Motion of a revolute joint per motion of a prismatic one, rad/m; people read degrees per meter.
    #[serde(rename = "rad/m")]
    RadianPerMeter,
    /// Motion of a prismatic joint per motion of a revolute one, m/rad; people read millimeters per radian.
    #[serde(rename = "m/rad")]
    MeterPerRadian,
    /// Thermal expansion, 1/K.
    #[serde(rename = "1/K")]
    PerKelvin,
    /// First moment of a mass, kg·m.
    #[serde(rename = "kg·m")]
    KilogramMeter,
    /// Mass, kg.
    #[serde(rename = "kg")]
    Kilogram,
}

impl Unit {
    /// Symbol of the SI unit: `m`, `rad`, `1`.
    #[must_use]
    pub const fn symbol(self) -> &'static str {
        match self {
            Unit::Meter => "m",
            Unit::Radian => "rad",
            Unit::Second => "s",
            Unit::One => "1",
            Unit::RadianPerSecond => "rad/s",
            Unit::RadianPerNewtonMeter => "rad/(N·m)",
            Unit::MeterPerNewton => "m/N",
            Unit::RadianPerMeter => "rad/m",
            Unit::MeterPerRadian => "m/rad",
            Unit::PerKelvin => "1/K",
            Unit::KilogramMeter => "kg·m",
            Unit::Kilogram => "kg",
        }
    }

    /// The factor from SI to the unit that people read, and its suffix, with a space where one belongs.
    ///
    /// ```
    /// assert_eq!(calib_finding::Unit::Meter.display(), (1e3, " mm"));
    /// ```
    #[must_use]
    pub const fn display(self) -> (f64, &'static str) {
        const DEGREES: f64 = 180.0 / std::f64::consts::PI;
        match self {
            Unit::Meter => (1e3, " mm"),
            Unit::Radian => (DEGREES, "°"),
            Unit::Second => (1e3, " ms"),
            Unit::One => (1.0, ""),
            Unit::RadianPerSecond => (DEGREES, "°/s"),
            Unit::RadianPerNewtonMeter => (DEGREES, "°/(N·m)"),
            Unit::MeterPerNewton => (1e3, " mm/N"),
            Unit::RadianPerMeter => (DEGREES, "°/m"),
            Unit::MeterPerRadian => (1e3, " mm/rad"),
            Unit::PerKelvin => (1e6, " ppm/K"),
            Unit::KilogramMeter => (1.0, " kg·m"),
            Unit::Kilogram => (1.0, " kg"),
        }
    }

    /// The unit that people read, as the heading of a column: `mm`, `deg`.
    #[must_use]
    pub const fn heading(self) -> &'static str {
        match self {
            Unit::Meter => "mm",
            Unit::Radian => "deg",
            Unit::Second => "ms",
            Unit::One => "1",
            Unit::RadianPerSecond => "deg/s",
            Unit::RadianPerNewtonMeter => "deg/(N·m)",
            Unit::MeterPerNewton => "mm/N",
            Unit::RadianPerMeter => "deg/m",
            Unit::MeterPerRadian => "mm/rad",
            Unit::PerKelvin => "ppm/K",
            Unit::KilogramMeter => "kg·m",
            Unit::Kilogram => "kg",
        }
    }
}
