//! What the data leave open at the tool, in meters over the joint ranges.

use crate::Unit;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What the uncertainty of the parameters does to the tool over the box of the recorded joint ranges, joints combined freely, and
/// how much of it only the priors hold.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct WeakDirections {
    /// The body, marker or touching point.
    pub point: String,
    /// Whether the place of the robot in the tracker's frame counts; without a body in its sight only the shape of what is
    /// reached does.
    pub placed: bool,
    /// Postures over the joint ranges.
    pub postures: usize,
    /// Root mean square of the predicted σ over them, m.
    pub rms_sigma_m: f64,
    /// Largest σ, m.
    pub max_sigma_m: f64,
    /// The same root mean square over the fitted postures, m.
    pub recorded_rms_sigma_m: Option<f64>,
    /// Share of the variance that only the priors hold, in [0, 1].
    pub prior_share: f64,
    /// A direction that neither data nor prior determine moves the tool; the numbers leave it out.
    pub unbounded: bool,
    /// The size of the robot; null where all postures reach one place.
    pub size: Option<RobotSize>,
    /// Independent directions of the parameters, the worst first.
    pub directions: Vec<OpenDirection>,
}

/// How well the size of the robot is known: all lengths changed in one ratio.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RobotSize {
    /// Relative standard deviation, 1.
    pub sigma: f64,
    /// Largest distance of the tool from the robot's root, m.
    pub reach_m: f64,
    /// Share of the prior in what is known of it, in [0, 1].
    pub prior_share: f64,
    /// How much larger the found robot is than the nominal one, 1; null where the nominal place of the tool is not known.
    #[serde(default)]
    pub change: Option<f64>,
}

/// One independent direction of the parameters' uncertainty.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct OpenDirection {
    /// Displacement of the tool for one standard deviation, root mean square over the postures, m.
    pub rms_m: f64,
    /// Largest displacement, m.
    pub max_m: f64,
    /// Share of the prior in what is known along it, in [0, 1].
    pub prior_share: f64,
    /// Parameters that change together, those that matter most first.
    pub terms: Vec<WeakTerm>,
}

/// The change of one parameter along a direction.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct WeakTerm {
    /// The parameter's name.
    pub parameter: String,
    /// Its change for one standard deviation.
    pub change: f64,
    /// SI unit of the change.
    pub unit: Unit,
}

/// From this share on it is the prior that is reported, not the data.
pub const HELD_BY_PRIOR: f64 = 0.5;

impl RobotSize {
    /// What one standard deviation of the size is at the reach, m.
    #[must_use]
    pub fn at_reach_m(&self) -> f64 {
        self.sigma * self.reach_m
    }

    /// Whether the data do not see the size of the robot: it is as large as the nominal URDF says.
    #[must_use]
    pub fn is_unseen(&self) -> bool {
        self.sigma > 0.0 && self.prior_share >= HELD_BY_PRIOR
    }
}

impl WeakDirections {
    /// Root mean square over the postures of what only the priors hold, m: held-out data of the kind that was fitted cannot tell.
    #[must_use]
    pub fn held_by_prior_m(&self) -> f64 {
        self.rms_sigma_m * self.prior_share.sqrt()
    }
}
