//! What a target is.

use serde::Serialize;

/// What a target is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// A URDF.
    Urdf,
    /// A xacro: patched in its own text, its properties and the YAML that it loads.
    Xacro,
    /// A YAML with origins of joints, as the `kinematics_params` of a UR arm.
    Yaml,
}

impl Kind {
    /// The word for people and JSON.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Urdf => "urdf",
            Self::Xacro => "xacro",
            Self::Yaml => "yaml",
        }
    }
}
