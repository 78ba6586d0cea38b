//! What is estimated, with priors, noise levels and limits of the verdict.

use super::{RawFree, RawJointFree, RawPrior, RawValue};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Which estimation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RawMethod {
    /// The closed forms of the paper, each origin alone.
    Paper,
    /// Maximum likelihood over all loops at once.
    #[default]
    Ml,
}

/// Where the fit of all loops starts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RawStart {
    /// At the nominal robot, with the bodies where it sees them.
    #[default]
    Nominal,
    /// At the mounts that the estimators of `origins` find; elsewhere as `nominal`.
    Origins,
}

/// Extra effects or prior width of one joint (fixed joints included).
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawJointSolve {
    /// What of this joint is free, instead of what `free` says for all.
    #[serde(default)]
    pub free: Option<Vec<RawJointFree>>,
    /// Prior standard deviation of its position numbers, mm.
    #[serde(default)]
    pub sigma_mm: Option<f64>,
    /// Prior standard deviation of its angle numbers, deg.
    #[serde(default)]
    pub sigma_deg: Option<f64>,
    /// Physical limit: each position number of its origin stays within this of the nominal URDF, mm.
    #[serde(default)]
    pub within_mm: Option<f64>,
    /// Physical limit: each angle number (tilts, turns, zero offset) stays within this of the nominal URDF, deg.
    #[serde(default)]
    pub within_deg: Option<f64>,
    /// The joint also turns by an unknown share of these joints' angles (belt or parallelogram coupling).
    #[serde(default)]
    pub coupled_to: Vec<String>,
    /// Effects of plugins that this joint has, by name, each with its parameters (see `calib plugins`); their coefficients are estimated.
    #[serde(default)]
    pub effects: BTreeMap<String, BTreeMap<String, RawValue>>,
}

/// Where the load of a joint comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RawLoad {
    /// Gravity on the masses of the URDF at the indicated joint positions; on uniform rods between the joints where it has none.
    #[default]
    Gravity,
    /// The torque columns of the recordings, N m: what the joints hold (as drives and torque sensors state it), so that the load is minus
    /// that. A joint without a column carries no load.
    Measured,
}

/// What is random from pose to pose, beside the noise of each measurement.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RawNoiseModel {
    /// What the recordings speak for (default): each of the others is tried on left-out poses.
    #[default]
    Auto,
    /// Nothing: the weights of plain least squares.
    White,
    /// The angles of the joints that turn, with one level.
    Joint,
    /// With one more level for the positions of the joints that slide.
    JointAndSlide,
    /// The pose of each body with three markers and more.
    BodyPose,
    /// The joint positions, with a level for each joint.
    JointEach,
}

/// Noise levels: the start of their estimation, or fixed.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawNoise {
    /// What is random from pose to pose: `auto` (default), `white`, `joint`, `joint_and_slide`, `body_pose` or `joint_each`.
    #[serde(default)]
    pub model: RawNoiseModel,
    /// Standard deviation of the joint angles from pose to pose, deg; estimated when absent.
    #[serde(default)]
    pub joint_deg: Option<f64>,
    /// Take the stated levels as true instead of estimating them.
    #[serde(default)]
    pub known: bool,
}

/// Limits of the verdict, compared with the 95 % interval of what was measured. A limit that could not be evaluated is
/// never a pass. Without validation recordings every fitted pose is left out in turn.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawLimits {
    /// Largest accepted rms position error on held-out poses, mm.
    #[serde(default)]
    pub held_out_rms_mm: Option<f64>,
    /// Largest accepted position error on held-out poses, mm.
    #[serde(default)]
    pub held_out_max_mm: Option<f64>,
    /// Largest accepted rms orientation error on held-out poses, deg.
    #[serde(default)]
    pub held_out_rms_deg: Option<f64>,
    /// Largest accepted orientation error on held-out poses, deg.
    #[serde(default)]
    pub held_out_max_deg: Option<f64>,
    /// Largest accepted mean translation error of a loop, by loop, mm.
    #[serde(default)]
    pub loop_mean_mm: BTreeMap<String, f64>,
    /// Largest accepted standard deviation of an origin's observable position, mm.
    #[serde(default)]
    pub origin_sigma_mm: Option<f64>,
}

/// How to solve.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawSolve {
    /// `ml` (default) or `paper`.
    pub method: RawMethod,
    /// Where `ml` starts: `nominal` (default), or `origins`, at the mounts that the estimators of `origins` find.
    pub start_from: RawStart,
    /// What is free, for all moved joints.
    pub free: Vec<RawFree>,
    /// Exceptions by joint.
    pub joints: BTreeMap<String, RawJointSolve>,
    /// Prior standard deviations.
    pub prior: RawPrior,
    /// Noise levels.
    pub noise: RawNoise,
    /// Where the torques of compliance come from: `gravity` (default) or `measured`.
    pub load: RawLoad,
    /// Detect and remove outliers and swapped markers.
    pub robust: bool,
    /// Limits of the verdict.
    pub limits: RawLimits,
}

impl Default for RawSolve {
    fn default() -> Self {
        Self {
            method: RawMethod::Ml,
            start_from: RawStart::default(),
            free: vec![
                RawFree::Bodies,
                RawFree::Tracker,
                RawFree::Effect(&calib_core::effect::offset::EFFECT),
                RawFree::JointAxes,
            ],
            joints: BTreeMap::new(),
            prior: RawPrior::default(),
            noise: RawNoise::default(),
            load: RawLoad::default(),
            robust: true,
            limits: RawLimits::default(),
        }
    }
}
