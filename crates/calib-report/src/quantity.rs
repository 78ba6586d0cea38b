use calib_finding::Unit;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The position of one joint.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct JointValue {
    /// The joint's name in the URDF.
    pub joint: String,
    /// rad or m.
    pub value: f64,
    /// [`Unit::Radian`] or [`Unit::Meter`].
    pub unit: Unit,
}

impl JointValue {
    /// A revolute joint's angle in rad.
    #[must_use]
    pub fn radians(joint: impl Into<String>, value: f64) -> Self {
        Self {
            joint: joint.into(),
            value,
            unit: Unit::Radian,
        }
    }

    /// A prismatic joint's position in m.
    #[must_use]
    pub fn meters(joint: impl Into<String>, value: f64) -> Self {
        Self {
            joint: joint.into(),
            value,
            unit: Unit::Meter,
        }
    }
}
