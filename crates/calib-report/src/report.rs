use crate::{
    AccuracyLimit, Change, Clock, DataInformation, EstimatorResult, Finding, FitSummary, Input,
    JointCoverage, LoopClosure, Noise, NotObservable, Output, Parameter, RecordingSummary,
    Rejected, Residuals, Transform, Unit, Verification, WeakDirections, Workspace,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The result of a calibration, in SI units. Fields are in the order of `report.json`; keys are added, never renamed.
///
/// `..Report::default()` fills what a run does not have: an empty list means none, `None` means unknown.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Report {
    /// Version of this format.
    pub calib: FormatVersion,
    /// The profile's name as it was given, relative.
    pub profile: String,
    /// The robot's name.
    pub robot: String,
    /// The solution method.
    pub method: Method,
    /// Whether the result may be used.
    pub verdict: Verdict,
    /// The reasons: one sentence each, the most important first.
    pub reasons: Vec<String>,
    /// What the verdict is valid for: one sentence each (tool point, joint ranges, load).
    #[serde(default)]
    pub scope: Vec<String>,
    /// The limits of the profile and whether they were met.
    #[serde(default)]
    pub limits: Vec<Limit>,
    /// What the reader should do now, the most useful first.
    #[serde(default)]
    pub next_steps: Vec<String>,
    /// Estimated transforms, and those derived from them.
    pub transforms: Vec<Transform>,
    /// Every scalar unknown.
    pub parameters: Vec<Parameter>,
    /// The changed values of the URDF, one entry each.
    #[serde(default)]
    pub changes: Vec<Change>,
    /// The same as a unified text diff with relative paths; empty when no URDF was written.
    #[serde(default)]
    pub urdf_diff: String,
    /// Combinations of parameters that are not observable. Those of a single transform are listed with the transform.
    #[serde(default)]
    pub not_observable: Vec<NotObservable>,
    /// The loop closures: measured against forward kinematics.
    pub loops: Vec<LoopClosure>,
    /// Errors on poses that were not fitted.
    pub verification: Verification,
    /// Cross-check of the same quantities with other estimators.
    pub estimators: Vec<EstimatorResult>,
    /// How the solver ended.
    #[serde(default)]
    pub fit: Option<FitSummary>,
    /// Residuals of the fit, summarized.
    #[serde(default)]
    pub residuals: Residuals,
    /// The estimated noise.
    #[serde(default)]
    pub noise: Vec<Noise>,
    /// Offsets between the clocks of the recordings.
    #[serde(default)]
    pub clocks: Vec<Clock>,
    /// What was read.
    #[serde(default)]
    pub recordings: Vec<RecordingSummary>,
    /// The joint ranges in the data.
    #[serde(default)]
    pub coverage: Vec<JointCoverage>,
    /// Rejected samples and the reasons.
    #[serde(default)]
    pub rejected: Vec<Rejected>,
    /// The predicted uncertainty of the tool over the workspace.
    #[serde(default)]
    pub workspace: Option<Workspace>,
    /// What the data leave open at the tool. Null with `method: paper`.
    #[serde(default)]
    pub weak_directions: Option<WeakDirections>,
    /// What limits the accuracy, largest share first.
    #[serde(default)]
    pub accuracy_limits: Vec<AccuracyLimit>,
    /// Findings of the data checks.
    pub findings: Vec<Finding>,
    /// Files that were read.
    pub inputs: Vec<Input>,
    /// Files that were written.
    #[serde(default)]
    pub outputs: Vec<Output>,
    /// Commands that repeat this result.
    #[serde(default)]
    pub reproduce: Vec<String>,
    /// Commands that revert it.
    #[serde(default)]
    pub undo: Vec<String>,
    /// The seed of everything random; 0: nothing was random.
    #[serde(default)]
    pub seed: u64,
    /// The information of the data alone about the parameters, for `calib drift`. Null with `method: paper`.
    #[serde(default)]
    pub data_information: Option<DataInformation>,
    /// Version of the program.
    pub version: String,
}

/// Version of the report's format: 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
pub struct FormatVersion(pub u32);

impl Default for FormatVersion {
    fn default() -> Self {
        Self(1)
    }
}

/// How the unknowns were estimated.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// The closed forms of the paper, one origin at a time.
    Paper,
    /// Maximum likelihood over all loops at once.
    #[default]
    Ml,
}

impl Method {
    /// `paper` or `ml`, as in the profile.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Paper => "paper",
            Self::Ml => "ml",
        }
    }
}

/// Whether the result may be used.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Every limit was evaluated and met.
    Accepted,
    /// A limit was exceeded, or a requested quantity is not observable.
    Rejected,
    /// No limit was exceeded, but not every limit could be evaluated. Not accepted.
    #[default]
    NotEvaluated,
}

/// A limit of the profile.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Limit {
    /// The profile's key, `held_out_rms_mm`.
    pub name: String,
    /// The limited quantity, in words.
    pub quantity: String,
    /// SI unit of `limit` and `value`.
    pub unit: Unit,
    /// The largest accepted value.
    pub limit: f64,
    /// The value; `None` when it could not be evaluated.
    pub value: Option<f64>,
    /// Met, exceeded, or not evaluated.
    pub outcome: Outcome,
    /// Why it was not evaluated; empty otherwise.
    pub reason: String,
}

impl Limit {
    /// A limit that was evaluated. A value that is not finite meets no limit.
    #[must_use]
    pub fn evaluated(
        name: impl Into<String>,
        quantity: impl Into<String>,
        unit: Unit,
        limit: f64,
        value: f64,
    ) -> Self {
        let outcome = if value <= limit {
            Outcome::Met
        } else {
            Outcome::Exceeded
        };
        let value = value.is_finite().then_some(value);
        Self {
            name: name.into(),
            quantity: quantity.into(),
            unit,
            limit,
            value,
            outcome,
            reason: String::new(),
        }
    }

    /// A limit that could not be evaluated, and why.
    #[must_use]
    pub fn not_evaluated(
        name: impl Into<String>,
        quantity: impl Into<String>,
        unit: Unit,
        limit: f64,
        reason: impl Into<String>,
    ) -> Self {
        let outcome = Outcome::NotEvaluated;
        Self {
            name: name.into(),
            quantity: quantity.into(),
            unit,
            limit,
            value: None,
            outcome,
            reason: reason.into(),
        }
    }
}

/// The outcome of a limit.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// value ≤ limit.
    Met,
    /// value > limit, or not a number.
    Exceeded,
    /// No data to evaluate it with. Never accepted.
    #[default]
    NotEvaluated,
}

/// The verdict that the limits alone give: exceeded beats not evaluated beats met, and no limit at all is not evaluated.
///
/// The caller adds further reasons for rejection (a requested quantity that is not observable, a solver that stalled).
#[must_use]
pub fn judge(limits: &[Limit]) -> Verdict {
    if limits
        .iter()
        .any(|limit| limit.outcome == Outcome::Exceeded)
    {
        Verdict::Rejected
    } else if limits.is_empty()
        || limits
            .iter()
            .any(|limit| limit.outcome == Outcome::NotEvaluated)
    {
        Verdict::NotEvaluated
    } else {
        Verdict::Accepted
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_limit_that_was_not_evaluated_is_never_met() {
        let met = Limit::evaluated("a", "", Unit::Meter, 1.0, 1.0);
        let exceeded = Limit::evaluated("b", "", Unit::Meter, 1.0, 1.0 + 1e-12);
        let not_a_number = Limit::evaluated("c", "", Unit::Meter, 1.0, f64::NAN);
        let open = Limit::not_evaluated("d", "", Unit::Meter, 1.0, "no validation poses");
        assert_eq!(not_a_number.outcome, Outcome::Exceeded);
        assert_eq!(not_a_number.value, None);
        let table = [
            (vec![], Verdict::NotEvaluated),
            (vec![met.clone()], Verdict::Accepted),
            (vec![met.clone(), open.clone()], Verdict::NotEvaluated),
            (vec![open.clone(), exceeded.clone()], Verdict::Rejected),
            (vec![met, not_a_number], Verdict::Rejected),
            (vec![open], Verdict::NotEvaluated),
        ];
        for (limits, verdict) in table {
            assert_eq!(judge(&limits), verdict, "{limits:?}");
        }
    }
}
