//! How a model was chosen: which effects, axes and origins the recordings support.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What a part of a model frees.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PartKind {
    /// An effect of a joint.
    #[default]
    Effect,
    /// The axis line of a joint.
    Axis,
    /// The whole origin of a joint.
    Origin,
    /// A share of another joint's motion.
    Coupling,
    /// The first moments of all links, beyond the given masses.
    Masses,
}

/// Parameters that are free together.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct ModelPart {
    /// What it frees.
    pub kind: PartKind,
    /// The effect, as in the table of effects; null for what is none.
    pub effect: Option<String>,
    /// The joint; null for all joints.
    pub joint: Option<String>,
    /// The joint whose motion a coupling follows.
    pub other: Option<String>,
}

/// How the trial of a part ended.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SelectionOutcome {
    /// It is in the model.
    Added,
    /// It predicts no better by one standard error.
    NoBetter,
    /// It was added, and later parts made it needless.
    Removed,
    /// The score test does not ask for it.
    #[default]
    NotSignificant,
}

/// A part that was looked at.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SelectionStep {
    /// The part.
    pub part: ModelPart,
    /// How it ended.
    pub outcome: SelectionOutcome,
    /// Parameters that it adds.
    pub parameters: usize,
    /// Statistic of the score test.
    pub z2: f64,
    /// Its degrees of freedom.
    pub rank: usize,
    /// Its probability by chance, corrected for all parts that were tested.
    pub p_value: f64,
    /// Position error of left-out poses without it, root mean square, m.
    pub before_rms_m: f64,
    /// The same with it; the same number where it was not fitted in full.
    pub after_rms_m: f64,
    /// Share of the squared error of left-out poses that it saves.
    pub saved: f64,
    /// Standard error of `saved`, paired over poses.
    pub saved_error: f64,
    /// Of a part for all joints: what of it stayed.
    pub members: Vec<ModelPart>,
    /// Parts that explain the same and predict alike: not distinguishable.
    pub alike: Vec<ModelPart>,
    /// The part that took its place once the rest was known.
    pub replaced_by: Option<ModelPart>,
    /// In how many folds it was added; null without folds.
    pub in_folds: Option<usize>,
}

/// Errors of poses in folds that took no part in the choice.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct NestedSelection {
    /// Number of folds.
    pub folds: usize,
    /// Position error, the choice repeated without each fold, root mean square, m.
    pub rms_m: f64,
    /// The same of the profile's model, m.
    pub first_rms_m: f64,
    /// The same of the chosen model, fitted without each fold but chosen with it, m.
    pub chosen_rms_m: f64,
}

/// How a model was chosen.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Selection {
    /// Parts that were looked at, in this order.
    pub steps: Vec<SelectionStep>,
    /// What was added to the profile's model.
    pub added: Vec<ModelPart>,
    /// What the profile frees and the predictions do not need.
    pub unsupported: Vec<ModelPart>,
    /// Number of parts that could be tested.
    pub tested: usize,
    /// Parameters that the data determine, in the profile's model.
    pub first_parameters: usize,
    /// The same in the chosen model.
    pub chosen_parameters: usize,
    /// Position error of left-out poses, profile's model, root mean square, m.
    pub first_rms_m: f64,
    /// The same of the chosen model, m: what the choice itself looked at.
    pub chosen_rms_m: f64,
    /// The error to be stated for a chosen model; null where there are too few poses.
    pub nested: Option<NestedSelection>,
    /// Standard deviations of the result over those of the same model without a choice; null where the choice cost nothing.
    pub sigma_factor: Option<f64>,
    /// `free` and `joints` of the profile's `solve:` for the chosen model, YAML.
    pub solve: String,
}
