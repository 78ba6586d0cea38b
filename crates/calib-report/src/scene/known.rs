//! What the calibration knows of the robot and of its surroundings: joints, tips, what was touched, the verdict.

use std::collections::BTreeMap;

use calib_model::file::{ModelMimic, ModelMotion};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{Component, Input, Report, Status, Verdict};

/// What a calibration is worth.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SceneVerdict {
    /// As in the report.
    pub verdict: Verdict,
    /// Position error to expect on a new pose, rms, m: of held-out poses, or of poses left out in turn; null where none was predicted.
    pub position_error_m: Option<f64>,
    /// Ends of its 95 % interval, m.
    pub interval_m: Option<[f64; 2]>,
    /// What the result was shown to be good for, in sentences.
    pub scope: Vec<String>,
    /// What it was not shown to be good for, in sentences.
    pub not_for: Vec<String>,
}

/// A joint of the robot. At position 0 its child link stands where its frame of the scene is.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SceneJoint {
    /// The joint's name.
    pub name: String,
    /// How it moves.
    pub motion: ModelMotion,
    /// The link that carries it; a frame has the same name.
    pub parent: String,
    /// The link that it moves; a frame has the same name.
    pub child: String,
    /// Unit vector in the frame of the child; null for a joint that does not move.
    pub axis: Option<[f64; 3]>,
    /// Lowest and highest position, rad or m; null where there are none.
    pub limits: Option<[f64; 2]>,
    /// Lowest and highest position that was recorded for the calibration, rad or m: equal where it stood still, null where it moves nothing that was seen.
    pub fitted_range: Option<[f64; 2]>,
    /// The joint that it follows.
    pub mimic: Option<ModelMimic>,
    /// Whether effects were found that axis and origin do not hold (compliance, backlash, …): the model file has them.
    pub has_effects: bool,
}

/// A point of the robot.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SceneTip {
    /// The point's name; a frame without orientation has the same name.
    pub name: String,
    /// The link that it is fixed to.
    pub link: String,
    /// In the link's frame, m.
    pub xyz_m: [f64; 3],
    /// 3×3 in the link's frame, m²; null where it was not estimated.
    pub covariance: Option<[[f64; 3]; 3]>,
    /// Whether the recordings tell all three coordinates: else the rest is from the prior, often a convention with the zero of the last joint.
    pub observable: bool,
    /// Where the numbers come from.
    pub status: Status,
}

/// A thing that was touched: its frame has z along the normal of a plane, and along a line or a cylinder.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SceneTouched {
    /// The contact's name in the profile.
    pub name: String,
    /// Its frame of the scene.
    pub frame: String,
    /// The tip that touched it.
    pub tip: String,
    /// What it is.
    pub shape: TouchedShape,
    /// Radius of a sphere or a cylinder, m.
    pub radius_m: Option<f64>,
    /// Named spots in its frame, m.
    pub spots_m: BTreeMap<String, [f64; 3]>,
}

/// What is touched, in its own frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum TouchedShape {
    /// The plane z = 0.
    Plane,
    /// The line along z.
    Line,
    /// The origin.
    Point,
    /// A sphere about the origin: the other end of a bar.
    Sphere,
    /// A cylinder about z.
    Cylinder,
    /// Points that the recordings list.
    Points,
}

impl SceneVerdict {
    /// That of a report.
    #[must_use]
    pub fn of(report: &Report) -> Self {
        let held_out = report.verification.held_out.as_ref();
        let expected = held_out.and_then(|held_out| held_out.expected);
        Self {
            verdict: report.verdict,
            position_error_m: expected.map(|e| e.rms_m),
            interval_m: expected.map(|e| [e.low_m, e.high_m]),
            scope: report.scope.clone(),
            not_for: report.not_for.clone(),
        }
    }
}

/// Where a scene comes from.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Provenance {
    /// The program.
    pub tool: String,
    /// Its version.
    pub version: String,
    /// The profile, relative.
    pub profile: String,
    /// What was read.
    pub inputs: Vec<Input>,
    /// Estimators, readers and report writers that were used, with the plugins that they are from.
    #[serde(default)]
    pub components: Vec<Component>,
    /// When it was measured, as the profile states it; null where it does not.
    #[serde(default)]
    pub date: Option<String>,
}
