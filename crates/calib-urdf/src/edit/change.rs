//! What may be changed in a URDF, and what was changed.

use nalgebra::{Isometry3, Unit, Vector3};
use serde::{Deserialize, Serialize};

/// One change of a URDF. Lengths m, angles rad.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum UrdfEdit {
    /// A joint's `<origin>`.
    SetOrigin {
        /// Which joint.
        joint: String,
        /// The new origin.
        parent_link_from_joint: Isometry3<f64>,
    },
    /// A joint's `<axis>`.
    SetAxis {
        /// Which joint; it must not be fixed.
        joint: String,
        /// In the joint's frame.
        axis: Unit<Vector3<f64>>,
    },
    /// The position limits of a joint's `<limit>`.
    SetLimits {
        /// Which joint, revolute or prismatic; it must have a `<limit>`, since a URDF wants effort and velocity there too.
        joint: String,
        /// rad or m.
        lower: f64,
        /// rad or m.
        upper: f64,
    },
    /// A new link on a new fixed joint: a tracking body, a table, a camera.
    AddFixedFrame {
        /// The new link.
        name: String,
        /// The link that carries it; an earlier edit may have added it.
        parent_link: String,
        /// The new joint.
        joint_name: String,
        /// Its origin.
        parent_from_frame: Isometry3<f64>,
        /// Written above the link.
        comment: Option<String>,
    },
    /// An XML comment above `<robot>`: where the numbers come from.
    AddProvenance {
        /// What it says.
        text: String,
    },
}

/// One attribute that a patch changed, or one element that it added (`old` is then empty).
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Change {
    /// Line in the original text, from 1.
    pub line: usize,
    /// The joint, empty for a comment above `<robot>`.
    pub joint: String,
    /// `origin xyz`, `axis xyz`, `limit upper`, …, or `<link>` for an added frame.
    pub attribute: String,
    /// The value before, as written.
    pub old: String,
    /// The value after, as written.
    pub new: String,
}
