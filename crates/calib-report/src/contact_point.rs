//! Points of the robot that touch something.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A point of the robot that touches something, in the frame of its link.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ContactPoint {
    /// Its name in the profile.
    pub name: String,
    /// The link that carries it.
    pub link: String,
    /// In that link's frame, m.
    pub position_m: [f64; 3],
    /// σ of each coordinate, m; null where the profile holds it.
    pub sigma_m: Option<[f64; 3]>,
}
