//! Units of parameters, and how far each is expected from nominal.

use serde::{Deserialize, Serialize};

/// 1°: how far a rotation is expected from nominal unless the caller says otherwise (rad).
pub const DEFAULT_ROTATION_SIGMA: f64 = std::f64::consts::PI / 180.0;
/// 1 cm: how far a length is expected from nominal unless the caller says otherwise (m).
pub const DEFAULT_TRANSLATION_SIGMA: f64 = 0.01;

/// Unit of a parameter, SI.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Unit {
    /// Angle, rad.
    Radian,
    /// Length, m.
    Meter,
    /// Torsional compliance, rad/(N·m).
    RadianPerNewtonMeter,
    /// Linear compliance of a prismatic joint, m/N.
    MeterPerNewton,
    /// Time, s.
    Second,
    /// Share per kelvin, 1/K.
    PerKelvin,
    /// Mass times distance, kg·m.
    KilogramMeter,
    /// Ratio without unit.
    One,
}

impl Unit {
    /// Symbol: `rad`, `m`, `rad/Nm`, `m/N`, `s`, `1/K`, `kg·m`, `1`.
    #[must_use]
    pub fn symbol(self) -> &'static str {
        match self {
            Self::Radian => "rad",
            Self::Meter => "m",
            Self::RadianPerNewtonMeter => "rad/Nm",
            Self::MeterPerNewton => "m/N",
            Self::Second => "s",
            Self::PerKelvin => "1/K",
            Self::KilogramMeter => "kg·m",
            Self::One => "1",
        }
    }

    /// Ending of a key that holds a number in this unit: `_rad`, `_m`, `_rad_per_nm`, `_m_per_n`, `_s`, `_per_k`, `_kg_m`, or nothing.
    #[must_use]
    pub fn key_ending(self) -> &'static str {
        match self {
            Self::Radian => "_rad",
            Self::Meter => "_m",
            Self::RadianPerNewtonMeter => "_rad_per_nm",
            Self::MeterPerNewton => "_m_per_n",
            Self::Second => "_s",
            Self::PerKelvin => "_per_k",
            Self::KilogramMeter => "_kg_m",
            Self::One => "",
        }
    }

    /// Size of a typical deviation from nominal: the unit of length of the observability analysis where a parameter
    /// has no prior.
    #[must_use]
    pub fn typical_deviation(self) -> f64 {
        match self {
            Self::Radian => DEFAULT_ROTATION_SIGMA,
            Self::Meter => DEFAULT_TRANSLATION_SIGMA,
            // 1e-4 rad/Nm: an arm joint that yields 5 mrad under 50 Nm.
            Self::RadianPerNewtonMeter | Self::MeterPerNewton => 1e-4,
            // 10 ms: a tracker frame at 100 Hz.
            Self::Second => 0.01,
            // Between steel and aluminium.
            Self::PerKelvin => 2e-5,
            // A link of 5 kg with its center 0.1 m from where it was assumed.
            Self::KilogramMeter => 0.5,
            // 1 %: the reading error of an encoder with a wrong gear ratio.
            Self::One => 0.01,
        }
    }
}
