//! Contact points and contacts.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::RawPose;
use crate::touched::RawTouched;

/// A point of a link, e.g. the end of a stylus or the center of a ball.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawContactPoint {
    /// The link that carries it.
    pub link: String,
    /// Where it is in the frame of that link, mm.
    #[serde(default)]
    pub at_mm: [f64; 3],
    /// Prior standard deviation of each of its coordinates, mm: it is estimated; exact when absent.
    #[serde(default)]
    pub sigma_mm: Option<f64>,
}

/// Poses in which a point of the robot is in contact with something.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawContact {
    /// The recordings; every row is one contact. They may have joint positions only.
    pub recordings: Vec<String>,
    /// The contact point, by its name under `points`.
    pub point: String,
    /// What is touched is fixed to this link, or to the tracker's frame by its name; the robot's root when absent.
    #[serde(default)]
    pub on: Option<String>,
    /// What is touched.
    pub touches: RawTouched,
    /// Where the frame of the coordinates or spots is in what it is fixed to; the same frame when absent.
    #[serde(default)]
    pub place: Option<RawPose>,
    /// Prior standard deviation of where it is, mm: its place is estimated; exact when absent.
    #[serde(default)]
    pub place_sigma_mm: Option<f64>,
    /// Prior standard deviation of its orientation (planes, lines, coordinates and spots), deg: estimated; exact when absent.
    #[serde(default)]
    pub place_sigma_deg: Option<f64>,
    /// Standard deviation of one contact, mm.
    pub sigma_mm: f64,
}
