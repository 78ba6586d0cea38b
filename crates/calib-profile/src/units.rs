//! The one place where profile units become SI.

pub(crate) const MM: f64 = 1e-3;
pub(crate) const DEG: f64 = std::f64::consts::PI / 180.0;

/// Unit that ends the key of a joint value: `waist_deg`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum JointUnit {
    Deg,
    Rad,
    Mm,
    M,
}

impl JointUnit {
    pub(crate) fn factor(self) -> f64 {
        match self {
            Self::Deg => DEG,
            Self::Mm => MM,
            Self::Rad | Self::M => 1.0,
        }
    }

    pub(crate) fn is_angle(self) -> bool {
        matches!(self, Self::Deg | Self::Rad)
    }
}

/// `waist_deg` → (`waist`, deg).
pub(crate) fn split_joint_key(key: &str) -> Option<(&str, JointUnit)> {
    let units = [
        ("_deg", JointUnit::Deg),
        ("_rad", JointUnit::Rad),
        ("_mm", JointUnit::Mm),
        ("_m", JointUnit::M),
    ];
    units
        .iter()
        .find_map(|(suffix, unit)| key.strip_suffix(suffix).map(|joint| (joint, *unit)))
}
