use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The SI unit of a number whose kind is only known at run time.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum Unit {
    /// Length, m; people read mm.
    #[serde(rename = "m")]
    Metre,
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
    /// Compliance of a revolute joint, rad/(N·m).
    #[serde(rename = "rad/(N·m)")]
    RadianPerNewtonMetre,
    /// Compliance of a prismatic joint, m/N.
    #[serde(rename = "m/N")]
    MetrePerNewton,
}

/// The position of one joint.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct JointValue {
    /// The joint's name in the URDF.
    pub joint: String,
    /// rad or m.
    pub value: f64,
    /// [`Unit::Radian`] or [`Unit::Metre`].
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
    pub fn metres(joint: impl Into<String>, value: f64) -> Self {
        Self {
            joint: joint.into(),
            value,
            unit: Unit::Metre,
        }
    }
}
