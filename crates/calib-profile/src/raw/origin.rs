//! Unknown transforms, transforms to report, and loop closures.

use super::RawValue;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// An unknown transform `body_from_joint`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawOrigin {
    /// The joint whose origin is sought; the frame is that of its child link.
    pub joint: String,
    /// The tracking body that moves with it.
    pub body: String,
    /// The recording that sweeps it.
    pub sweep: String,
    /// Report the origin at this link instead, which must be fixed to the joint's child link (a TCP behind a sphere joint).
    #[serde(default)]
    pub link: Option<String>,
    /// Center-of-rotation estimator (see `calib plugins`).
    #[serde(default)]
    pub center: Option<String>,
    /// Parameters of the center estimator, by name.
    #[serde(default)]
    pub center_parameters: BTreeMap<String, RawValue>,
    /// Axis-of-rotation estimator (see `calib plugins`).
    #[serde(default)]
    pub axis: Option<String>,
    /// Parameters of the axis estimator, by name.
    #[serde(default)]
    pub axis_parameters: BTreeMap<String, RawValue>,
    /// The swept joints and the axis of the joint frame each turns about at the zero position: `{z: pan, y: tilt}`;
    /// a minus turns it about (`-z: pan`).
    #[serde(default)]
    pub axes: BTreeMap<String, String>,
    /// Where the orientation comes from when fewer than two axes are swept.
    #[serde(default)]
    pub orientation: Option<RawOrientation>,
    /// With one swept axis: the point of the line that is called the origin.
    #[serde(default)]
    pub point: Option<RawPoint>,
}

/// Where an orientation comes from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum RawOrientation {
    /// The robot is taken to stand as the URDF says relative to the link that carries this body. An assumption.
    From(String),
}

/// The chosen point on an axis of which only the line can be observed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum RawPoint {
    /// The point of the axis nearest to the center of another origin, moved along the axis by the URDF's nominal distance.
    NominalDistanceFrom(String),
    /// The foot of the perpendicular from the body's origin, moved along the axis by this distance, mm.
    FromBodyMm(f64),
}

/// A transform between two links, at the zero position of all joints.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawTransform {
    /// The link in whose frame it is expressed.
    pub parent: String,
    /// The link whose frame it is.
    pub child: String,
    /// With `method: paper`, the fixed joint between them whose origin in the URDF takes up the difference.
    #[serde(default)]
    pub correct: Option<String>,
}

/// A loop closure between two origins.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawLoop {
    /// The origin that is the reference.
    pub from: String,
    /// The origin that is measured relative to it.
    pub to: String,
    /// The recording to evaluate; all validation recordings when absent.
    #[serde(default)]
    pub recording: Option<String>,
}
