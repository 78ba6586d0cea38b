//! Units that columns of joints and trackers may have been misread in.

use std::f64::consts::PI;

use serde::Serialize;

/// A unit that was misread in the column of a joint: what the values are, and what they were read as.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
pub enum UnitMistake {
    /// Values in degrees, read as radians.
    DegreesReadAsRadians,
    /// Values in radians, read as degrees.
    RadiansReadAsDegrees,
    /// Lengths.
    Length {
        /// What the values are.
        unit: Length,
        /// What they were read as.
        read_as: Length,
    },
}

impl UnitMistake {
    /// Millimeters, read as meters.
    pub const MILLIMETERS_READ_AS_METERS: Self = Self::Length {
        unit: Length::Millimeter,
        read_as: Length::Meter,
    };
    /// Meters, read as millimeters.
    pub const METERS_READ_AS_MILLIMETERS: Self = Self::Length {
        unit: Length::Meter,
        read_as: Length::Millimeter,
    };

    /// Whether it is a unit of angle.
    #[must_use]
    pub fn of_angles(self) -> bool {
        matches!(
            self,
            Self::DegreesReadAsRadians | Self::RadiansReadAsDegrees
        )
    }

    /// What the value that was read must be multiplied by.
    #[must_use]
    pub fn factor(self) -> f64 {
        match self {
            Self::DegreesReadAsRadians => PI / 180.0,
            Self::RadiansReadAsDegrees => 180.0 / PI,
            Self::Length { unit, read_as } => unit.meters() / read_as.meters(),
        }
    }
}

/// A unit of length that a tracker may write.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
pub enum Length {
    /// 1 m.
    Meter,
    /// 0.01 m.
    Centimeter,
    /// 0.001 m.
    Millimeter,
    /// 1e-6 m.
    Micrometer,
    /// 0.0254 m.
    Inch,
    /// 0.3048 m.
    Foot,
}

impl Length {
    /// In meters.
    #[must_use]
    pub fn meters(self) -> f64 {
        match self {
            Self::Meter => 1.0,
            Self::Centimeter => 0.01,
            Self::Millimeter => 0.001,
            Self::Micrometer => 1e-6,
            Self::Inch => 0.0254,
            Self::Foot => 0.3048,
        }
    }
}

/// Units of a tracker that are asked about: what the values are, and what they were read as. Each is another ratio.
pub const TRACKER_UNITS: [(Length, Length); 8] = [
    (Length::Millimeter, Length::Meter),
    (Length::Meter, Length::Millimeter),
    (Length::Centimeter, Length::Meter),
    (Length::Meter, Length::Centimeter),
    (Length::Centimeter, Length::Millimeter),
    (Length::Millimeter, Length::Centimeter),
    (Length::Inch, Length::Meter),
    (Length::Inch, Length::Millimeter),
];
