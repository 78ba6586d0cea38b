//! Regressors that need no call: those of sines that several terms share, and those that are numbers of the state.

use super::{EffectKind, JointState};

/// Sine and cosine of an angle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SinCos {
    /// Sine.
    pub sin: f64,
    /// Cosine.
    pub cos: f64,
}

impl SinCos {
    /// Of an angle, rad.
    #[inline]
    #[must_use]
    pub fn of(angle: f64) -> Self {
        let (sin, cos) = angle.sin_cos();
        Self { sin, cos }
    }
}

/// Terms that [`EffectKind::of_angles`] gives: those of the reading, then those of the motor's angle.
pub const HARMONICS: [EffectKind; 8] = [
    EffectKind::EccentricityCos,
    EffectKind::EccentricitySin,
    EffectKind::Eccentricity2Cos,
    EffectKind::Eccentricity2Sin,
    EffectKind::MotorCos,
    EffectKind::MotorSin,
    EffectKind::Motor2Cos,
    EffectKind::Motor2Sin,
];

/// Terms that [`EffectKind::of_state`] gives.
pub const OF_STATE: [EffectKind; 5] = [
    EffectKind::ZeroOffset,
    EffectKind::Gain,
    EffectKind::TorqueCompliance,
    EffectKind::Backlash,
    EffectKind::Friction,
];

/// Terms whose F is the torque about each of the two axes across, which they drive.
pub const LATERAL: [EffectKind; 2] = [EffectKind::Lateral1, EffectKind::Lateral2];

impl EffectKind {
    /// F of equation (1) from sines that several terms share; `None` for terms of another kind.
    ///
    /// ```text
    /// cos 2q − 1 = −2 sin² q,   sin 2q = 2 sin q cos q
    /// ```
    #[inline]
    #[must_use]
    pub fn of_angles(self, reading: &SinCos, motor: &SinCos) -> Option<f64> {
        Some(match self {
            Self::EccentricityCos => reading.cos - 1.0,
            Self::EccentricitySin => reading.sin,
            Self::Eccentricity2Cos => -2.0 * reading.sin * reading.sin,
            Self::Eccentricity2Sin => 2.0 * reading.sin * reading.cos,
            Self::MotorCos => motor.cos - 1.0,
            Self::MotorSin => motor.sin,
            Self::Motor2Cos => -2.0 * motor.sin * motor.sin,
            Self::Motor2Sin => 2.0 * motor.sin * motor.cos,
            _ => return None,
        })
    }

    /// F of equation (1) where it is 1 or a number of the state; `None` for terms of another kind.
    #[inline]
    #[must_use]
    pub fn of_state(self, s: &JointState) -> Option<f64> {
        Some(match self {
            Self::ZeroOffset => 1.0,
            Self::Gain => s.q,
            Self::TorqueCompliance => s.torque,
            Self::Backlash => -s.approach,
            Self::Friction => -s.approach * s.torque.abs(),
            _ => return None,
        })
    }
}
