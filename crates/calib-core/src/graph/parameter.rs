//! Scalar unknowns: their names, units, priors and bounds.

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
    Metre,
    /// Torsional compliance, rad/(N·m).
    RadianPerNewtonMetre,
    /// Linear compliance of a prismatic joint, m/N.
    MetrePerNewton,
    /// Time, s.
    Second,
    /// Ratio without unit.
    One,
}

impl Unit {
    /// Symbol: `rad`, `m`, `rad/Nm`, `m/N`, `s`, `1`.
    #[must_use]
    pub fn symbol(self) -> &'static str {
        match self {
            Self::Radian => "rad",
            Self::Metre => "m",
            Self::RadianPerNewtonMetre => "rad/Nm",
            Self::MetrePerNewton => "m/N",
            Self::Second => "s",
            Self::One => "1",
        }
    }
}

/// What a parameter describes; decides its default scale and the words about it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ParameterKind {
    /// A rotation component of an unknown pose.
    Rotation,
    /// A translation component of an unknown pose.
    Translation,
    /// A coordinate of a point in its frame.
    Point,
    /// Constant added to a joint's reading.
    ZeroOffset,
    /// Relative error of a joint's reading.
    Gain,
    /// Gear eccentricity, coefficient of cos q − 1.
    EccentricityCos,
    /// Gear eccentricity, coefficient of sin q.
    EccentricitySin,
    /// Give of a joint under the torque about its axis.
    TorqueCompliance,
    /// Give of a joint under a torque across its axis.
    LateralCompliance,
    /// Half the play, by the direction of approach.
    Backlash,
    /// Tracker clock minus encoder clock.
    ClockOffset,
    /// Share of another joint's motion that this joint makes.
    Coupling,
    /// Any other regressor that the caller supplied.
    Other,
}

impl ParameterKind {
    /// Size of a typical deviation from nominal, in the parameter's unit: the length unit of the
    /// observability analysis where a parameter has no prior.
    #[must_use]
    pub fn typical_deviation(self, unit: Unit) -> f64 {
        match (self, unit) {
            // 1e-4 rad/Nm: an arm joint that gives 5 mrad under 50 Nm.
            (Self::TorqueCompliance | Self::LateralCompliance, _) => 1e-4,
            // 10 ms: a tracker frame at 100 Hz.
            (Self::ClockOffset, _) => 0.01,
            (_, Unit::Radian) => DEFAULT_ROTATION_SIGMA,
            (_, Unit::Metre) => DEFAULT_TRANSLATION_SIGMA,
            (_, Unit::RadianPerNewtonMetre | Unit::MetrePerNewton) => 1e-4,
            (_, Unit::Second) => 0.01,
            // 1 %: the reading error of an encoder with a wrong gear ratio.
            (_, Unit::One) => 0.01,
        }
    }
}

/// One scalar of the problem. Pose components are displacements from the nominal pose (nominal 0).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Parameter {
    /// Unique name, for instance `elbow.origin.z`.
    pub name: String,
    /// The joint it belongs to, where there is one.
    pub joint: Option<String>,
    /// What it describes.
    pub kind: ParameterKind,
    /// Its unit.
    pub unit: Unit,
    /// Centre of the prior.
    pub nominal: f64,
    /// Where the solver starts.
    pub start: f64,
    /// σ of the Gaussian prior about `nominal`; `None`: the data alone decide.
    pub prior_sigma: Option<f64>,
    /// Physical limits `(lower, upper)`; `None`: unbounded.
    pub bounds: Option<(f64, f64)>,
    /// Held at `start`, not estimated.
    pub fixed: bool,
}

impl Parameter {
    /// Unit of length of this parameter in the observability analysis: its prior σ, else
    /// [`ParameterKind::typical_deviation`].
    #[must_use]
    pub fn scale(&self) -> f64 {
        self.prior_sigma
            .unwrap_or_else(|| self.kind.typical_deviation(self.unit))
    }
}
