//! Tracking bodies.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A tracking body: markers, or a 6-DoF body, bolted to one link.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawBody {
    /// The link it is bolted to.
    pub link: String,
    /// Its markers. The body frame has its origin at the first, +x through the second, and the third in
    /// the half plane y > 0, unless `template_mm` says otherwise. One or two markers give points, not a frame.
    #[serde(default)]
    pub markers: Vec<String>,
    /// The recording has poses of this body (position and quaternion) instead of markers.
    #[serde(default)]
    pub pose: bool,
    /// Marker positions in the body frame, mm, where the tracker's definition of the body is known.
    #[serde(default)]
    pub template_mm: BTreeMap<String, [f64; 3]>,
    /// Standard deviation of each coordinate of `template_mm`, mm, as the instrument that measured them states it: the positions
    /// are estimated; exact when absent.
    #[serde(default)]
    pub template_sigma_mm: Option<f64>,
    /// Pose of the body on its link where it is known by construction (`link_from_body`): it is then not estimated.
    #[serde(default)]
    pub mount: Option<RawPose>,
    /// The body moved on its link during the recordings: one mount for the rows before, one for those from there on.
    #[serde(default)]
    pub split: Option<RawSplit>,
}

/// Where a body moved on its link. The rows before belong to a body of the same name with the ending `_before`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawSplit {
    /// The recording in which it moved.
    pub recording: String,
    /// The first row after it moved, as findings number rows.
    pub at_row: u64,
    /// Recordings that were made before; all others were made after.
    #[serde(default)]
    pub before: Vec<String>,
}

/// A pose: position and fixed-axis roll, pitch, yaw (URDF convention).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawPose {
    /// Position, mm.
    #[serde(default)]
    pub xyz_mm: [f64; 3],
    /// Roll, pitch, yaw about fixed axes, deg.
    #[serde(default)]
    pub rpy_deg: [f64; 3],
}
