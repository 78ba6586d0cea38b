//! Prior standard deviations of effects, with their keys in profiles.

/// A prior standard deviation that a profile can change.
#[derive(Debug, PartialEq)]
pub struct PriorKey {
    /// Key under `solve.prior`, unit included.
    pub key: &'static str,
    /// What it is, with its unit.
    pub text: &'static str,
    /// Default, in the unit of the key.
    pub default: f64,
    /// SI per unit of the key.
    pub si: f64,
}

/// Prior of an effect's coefficients: the same key for both kinds of joint where there is only one.
#[derive(Debug)]
pub struct Prior {
    /// At revolute joints.
    pub revolute: &'static PriorKey,
    /// At prismatic joints.
    pub prismatic: &'static PriorKey,
    /// σ is never below this (SI).
    pub least: f64,
}

/// Radians per degree: priors in profiles are in degrees.
const DEG: f64 = std::f64::consts::PI / 180.0;
/// Meters per millimeter.
const MM: f64 = 1e-3;

impl PriorKey {
    /// A key in degrees.
    pub(crate) const fn deg(key: &'static str, text: &'static str, default: f64) -> Self {
        Self {
            key,
            text,
            default,
            si: DEG,
        }
    }

    /// A key in millionths per kelvin.
    pub(crate) const fn ppm_per_k(key: &'static str, text: &'static str, default: f64) -> Self {
        Self {
            key,
            text,
            default,
            si: 1e-6,
        }
    }

    /// A key in millimeters.
    pub(crate) const fn mm(key: &'static str, text: &'static str, default: f64) -> Self {
        Self {
            key,
            text,
            default,
            si: MM,
        }
    }
}

impl Prior {
    /// The key at this kind of joint.
    #[must_use]
    pub fn key(&self, prismatic: bool) -> &'static PriorKey {
        if prismatic {
            self.prismatic
        } else {
            self.revolute
        }
    }

    /// The same key at revolute and prismatic joints.
    pub(crate) const fn of(key: &'static PriorKey) -> Self {
        Self {
            revolute: key,
            prismatic: key,
            least: 0.0,
        }
    }
}
