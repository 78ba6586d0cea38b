//! What a study finds, as plain data: one cell for each scene, method and quantity.

use serde::{Deserialize, Serialize};

/// Which question a cell belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Part {
    /// The paper's grid of counts and noise.
    Grid,
    /// Short arcs: is the estimate biased?
    Arc,
    /// Raw markers of a rigid body.
    Markers,
    /// Two moving bodies.
    Bodies,
    /// Noise that is larger along the line of sight.
    Depth,
    /// Three tenths of the samples are wrong.
    Outliers,
    /// A sweep about one axis, given to estimators of a center.
    OneAxis,
    /// The frame of a joint with two axes.
    Frame,
}

impl Part {
    /// The word in tables.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Grid => "grid",
            Self::Arc => "arc",
            Self::Markers => "markers",
            Self::Bodies => "bodies",
            Self::Depth => "depth",
            Self::Outliers => "outliers",
            Self::OneAxis => "one_axis",
            Self::Frame => "frame",
        }
    }
}

/// What was measured, under which noise.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Scene {
    /// The question.
    pub part: Part,
    /// The motion, in words.
    pub motion: String,
    /// What else is special, in words; empty for nothing.
    pub condition: String,
    /// Poses of the trial.
    pub samples: usize,
    /// Distance of the body from the center or axis, m.
    pub radius_m: f64,
    /// Position noise, one coordinate, m (for ranges of noise: the upper end).
    pub sigma_t_m: f64,
    /// Orientation noise about one axis, rad.
    pub sigma_r_rad: f64,
}

impl Scene {
    /// A name that no other scene has; the random draws hang on it.
    #[must_use]
    pub fn id(&self) -> String {
        format!(
            "{}/{}/{}/n{}/r{}mm/s{}mm/{}deg",
            self.part.word(),
            self.motion,
            self.condition,
            self.samples,
            shortest(self.radius_m * 1e3),
            shortest(self.sigma_t_m * 1e3),
            shortest(self.sigma_r_rad.to_degrees()),
        )
    }
}

impl Scene {
    /// Motion and condition.
    pub(crate) fn words(&self) -> String {
        if self.condition.is_empty() {
            self.motion.clone()
        } else {
            format!("{}, {}", self.motion, self.condition)
        }
    }
}

/// At most four decimals, without the rounding of unit conversion.
pub(crate) fn shortest(x: f64) -> String {
    format!("{}", (x * 1e4).round() / 1e4)
}

/// The quantity whose error a cell describes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    /// Center of rotation, m.
    Center,
    /// Direction of the axis, rad.
    Direction,
    /// The axis beside the joint's point, m.
    Offset,
    /// Rotation of the joint's frame in the body, rad.
    Turn,
    /// Origin of the joint's frame in the body, m.
    Shift,
}

impl Quantity {
    /// The word in tables.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Center => "center",
            Self::Direction => "direction",
            Self::Offset => "offset",
            Self::Turn => "rotation",
            Self::Shift => "translation",
        }
    }

    /// `m` or `rad`.
    #[must_use]
    pub fn unit(self) -> &'static str {
        if self.is_angle() { "rad" } else { "m" }
    }

    /// Whether the error is an angle.
    #[must_use]
    pub fn is_angle(self) -> bool {
        matches!(self, Self::Direction | Self::Turn)
    }
}

/// One method in one scene. Errors in the unit of the quantity; those of trials with an answer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Cell {
    /// The scene.
    pub scene: Scene,
    /// The estimator and how it was used.
    pub method: String,
    /// Its id in the table of estimators.
    pub estimator: String,
    /// Whether a plugin offers it.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub from_plugin: bool,
    /// The quantity.
    pub quantity: Quantity,
    /// Trials run.
    pub trials: u64,
    /// Trials with an estimate, weak ones included.
    pub answered: u64,
    /// Trials whose verdict is `ok`.
    pub observable: u64,
    /// Root mean square of the error.
    pub rms: Option<f64>,
    /// Monte-Carlo standard error of `rms`.
    pub rms_mc: Option<f64>,
    /// Mean size of the error, mean |e|.
    pub mean_abs: Option<f64>,
    /// Size of the mean error, |mean e|: the bias.
    pub bias: Option<f64>,
    /// Monte-Carlo standard error of the mean error.
    pub bias_mc: Option<f64>,
    /// Root of the Cramér–Rao bound of the data that the method uses.
    pub bound: Option<f64>,
    /// Bound / mean square of the error.
    pub efficiency: Option<f64>,
    /// Its Monte-Carlo standard error.
    pub efficiency_mc: Option<f64>,
    /// Mean of the covariances that the method reports / mean square of the error; 1 where they are true.
    pub covariance_ratio: Option<f64>,
    /// Efficiency that no unbiased estimator exceeds in this scene, where that is known to be less than 1.
    pub unbiased_limit: Option<f64>,
    /// Efficiency that the best estimator has to second order in the noise, where that is known to be less than 1.
    pub second_order_limit: Option<f64>,
}
