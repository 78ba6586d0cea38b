//! What is estimated, with priors, noise levels and limits of the verdict.

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

/// What the solver may change.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "snake_case")]
pub enum RawFree {
    /// Mounts of the tracking bodies on their links.
    Bodies,
    /// Pose of the robot's root in the tracker.
    Tracker,
    /// Zero offsets of the moved joints.
    JointOffsets,
    /// Axis lines of the moved joints: two tilts and two shifts across the axis.
    JointAxes,
    /// Whole origins of the moved joints, six numbers each.
    JointOrigins,
    /// Gains of the moved joints: true angle per indicated angle.
    JointGains,
    /// First-harmonic eccentricity of the moved joints' gears or encoders.
    Eccentricity,
    /// Turn of the moved joints per gravity torque about their axis.
    Compliance,
    /// Tilt of the moved joints' axes per gravity torque across them.
    LateralCompliance,
    /// Play of the moved joints: half of it to either side by the direction of approach from the row before.
    Backlash,
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
    /// Physical limit: each position number of its origin stays within this of the description, mm.
    #[serde(default)]
    pub within_mm: Option<f64>,
    /// Physical limit: each angle number (tilts, turns, zero offset) stays within this of the description, deg.
    #[serde(default)]
    pub within_deg: Option<f64>,
    /// The joint also turns by an unknown share of these joints' angles (belt or parallelogram coupling).
    #[serde(default)]
    pub coupled_to: Vec<String>,
}

/// What of one joint is free.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "snake_case")]
pub enum RawJointFree {
    /// Zero offset.
    Offset,
    /// Gain.
    Gain,
    /// First-harmonic eccentricity.
    Eccentricity,
    /// Compliance about the axis.
    Compliance,
    /// Compliance across the axis.
    LateralCompliance,
    /// Play, by the direction of approach.
    Backlash,
    /// Whole origin.
    Origin,
    /// Axis line only.
    Axis,
}

/// Prior standard deviations of what is freed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawPrior {
    /// Position numbers of joint origins, mm.
    pub position_mm: f64,
    /// Orientation numbers of joint origins, deg.
    pub angle_deg: f64,
    /// Zero offsets of joints, deg.
    pub offset_deg: f64,
    /// Zero offsets of prismatic joints, mm.
    pub offset_mm: f64,
    /// Gains and couplings, per cent.
    pub gain_percent: f64,
    /// Eccentricity, deg.
    pub eccentricity_deg: f64,
    /// Compliance, deg per N m.
    pub compliance_deg_per_nm: f64,
    /// Half of a joint's play, deg.
    pub backlash_deg: f64,
    /// Half of a prismatic joint's play, mm.
    pub backlash_mm: f64,
}

impl Default for RawPrior {
    fn default() -> Self {
        Self {
            position_mm: 10.0,
            angle_deg: 1.0,
            offset_deg: 1.0,
            offset_mm: 10.0,
            gain_percent: 1.0,
            eccentricity_deg: 0.5,
            compliance_deg_per_nm: 0.05,
            backlash_deg: 0.2,
            backlash_mm: 0.5,
        }
    }
}

/// Where the load of a joint comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RawLoad {
    /// Gravity on the masses of the URDF at the indicated joint positions.
    #[default]
    Gravity,
    /// The torque columns of the recordings, N m; a joint without one carries no load.
    Measured,
}

/// Noise levels: the start of their estimation, or fixed.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawNoise {
    /// Standard deviation of the joint angles from pose to pose, deg; estimated when absent.
    #[serde(default)]
    pub joint_deg: Option<f64>,
    /// Take the stated levels as true instead of estimating them.
    #[serde(default)]
    pub known: bool,
}

/// Limits of the verdict. A limit that could not be evaluated is never a pass.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawLimits {
    /// Largest accepted rms position error on held-out poses, mm.
    #[serde(default)]
    pub held_out_rms_mm: Option<f64>,
    /// Largest accepted position error on held-out poses, mm.
    #[serde(default)]
    pub held_out_max_mm: Option<f64>,
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
            free: vec![
                RawFree::Bodies,
                RawFree::Tracker,
                RawFree::JointOffsets,
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
