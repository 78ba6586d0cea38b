//! The formats of `calib export`.

/// A format.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Target {
    /// URDF of the calibrated geometry.
    Urdf,
    /// URDF refitted to predict best alone.
    UrdfBest,
    /// Denavit–Hartenberg parameters (standard), YAML.
    Dh,
    /// The same with Hayati's β for nearly parallel axes.
    Hayati,
    /// Product of exponentials, YAML.
    Poe,
    /// Parameters of the six joints of a UR arm, YAML of `ur_description`.
    Ur,
    /// Parameters of an arm with an ortho-parallel basis and a spherical wrist, YAML of ROS-Industrial.
    Opw,
    /// MuJoCo.
    Mjcf,
    /// SDFormat.
    Sdf,
}

impl Target {
    /// All of them, in the order in which they are listed.
    pub const ALL: [Self; 9] = [
        Self::Urdf,
        Self::UrdfBest,
        Self::Dh,
        Self::Hayati,
        Self::Poe,
        Self::Ur,
        Self::Opw,
        Self::Mjcf,
        Self::Sdf,
    ];

    /// As it is named on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Urdf => "urdf",
            Self::UrdfBest => "urdf-best",
            Self::Dh => "dh",
            Self::Hayati => "hayati",
            Self::Poe => "poe",
            Self::Ur => "ur",
            Self::Opw => "opw",
            Self::Mjcf => "mjcf",
            Self::Sdf => "sdf",
        }
    }

    /// What it is, in a line.
    #[must_use]
    pub fn about(self) -> &'static str {
        match self {
            Self::Urdf => "URDF of the calibrated geometry, without shapes",
            Self::UrdfBest => "URDF refitted to predict best without joint effects",
            Self::Dh => "Denavit–Hartenberg parameters, YAML",
            Self::Hayati => {
                "Denavit–Hartenberg parameters with Hayati's for nearly parallel axes, YAML"
            }
            Self::Poe => "Product of exponentials: screws and home, YAML",
            Self::Ur => "Kinematics parameters of a UR arm, YAML of ur_description",
            Self::Opw => {
                "Parameters of a six-axis arm with a spherical wrist, YAML of ROS-Industrial"
            }
            Self::Mjcf => "MuJoCo's MJCF, kinematics and masses",
            Self::Sdf => "SDFormat 1.9, kinematics and masses",
        }
    }

    /// The one of that name.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|t| t.name() == name)
    }
}
