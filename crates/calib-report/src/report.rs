use crate::{
    AccuracyLimit, Change, Clock, DataInformation, EstimatorResult, Finding, FitSummary, Input,
    JointCoverage, LoopClosure, Noise, NotObservable, Output, Parameter, RecordingSummary,
    Rejected, Residuals, Transform, Unit, Verification, Workspace,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Everything a calibration has to say, in SI. Fields stand in the order of `report.json`; a key is added, never renamed.
///
/// `..Report::default()` fills what a run does not have: an empty list is "none", a `None` is "not known".
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Report {
    /// Version of this format.
    pub calib: FormatVersion,
    /// The profile's name as it was given, relative.
    pub profile: String,
    /// The robot's name.
    pub robot: String,
    /// How it was solved.
    pub method: Method,
    /// May the result be used?
    pub verdict: Verdict,
    /// Why: one sentence a reason, the decisive first.
    pub reasons: Vec<String>,
    /// For what the verdict holds: one sentence an item (which tool point, which joint ranges, which load).
    #[serde(default)]
    pub scope: Vec<String>,
    /// The limits of the profile and whether they were met.
    #[serde(default)]
    pub limits: Vec<Limit>,
    /// What the reader should do now, most useful first.
    #[serde(default)]
    pub next_steps: Vec<String>,
    /// The transforms that were solved for, and those they were derived into.
    pub transforms: Vec<Transform>,
    /// Every scalar unknown.
    pub parameters: Vec<Parameter>,
    /// What differs in the URDF: one entry for one number.
    #[serde(default)]
    pub changes: Vec<Change>,
    /// The same as a unified text diff with relative paths; empty when no URDF was written.
    #[serde(default)]
    pub urdf_diff: String,
    /// Combinations of parameters that the data cannot tell apart. Those of a single transform stand at the transform.
    #[serde(default)]
    pub not_observable: Vec<NotObservable>,
    /// The loop closures: measured against forward kinematics.
    pub loops: Vec<LoopClosure>,
    /// Errors on poses that were not fitted.
    pub verification: Verification,
    /// The same quantities by other estimators.
    pub estimators: Vec<EstimatorResult>,
    /// How the solver ended.
    #[serde(default)]
    pub fit: Option<FitSummary>,
    /// Residuals of the fit, summarised.
    #[serde(default)]
    pub residuals: Residuals,
    /// What the solver found the noise to be.
    #[serde(default)]
    pub noise: Vec<Noise>,
    /// Offsets between the clocks of the recordings.
    #[serde(default)]
    pub clocks: Vec<Clock>,
    /// What was read.
    #[serde(default)]
    pub recordings: Vec<RecordingSummary>,
    /// Where the joints were.
    #[serde(default)]
    pub coverage: Vec<JointCoverage>,
    /// What was thrown out, and why.
    #[serde(default)]
    pub rejected: Vec<Rejected>,
    /// The predicted uncertainty of the tool over the workspace.
    #[serde(default)]
    pub workspace: Option<Workspace>,
    /// What limits the accuracy now, largest share first.
    #[serde(default)]
    pub accuracy_limits: Vec<AccuracyLimit>,
    /// What the data checks found.
    pub findings: Vec<Finding>,
    /// Files that were read.
    pub inputs: Vec<Input>,
    /// Files that were written.
    #[serde(default)]
    pub outputs: Vec<Output>,
    /// Commands that repeat this result.
    #[serde(default)]
    pub reproduce: Vec<String>,
    /// Commands that take it back.
    #[serde(default)]
    pub undo: Vec<String>,
    /// The seed of everything random.
    #[serde(default)]
    pub seed: u64,
    /// What the data alone say of the parameters: for `calib drift`. Null with `method: paper`.
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

/// How the unknowns were found.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// The closed forms of the paper, one origin after the other.
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

/// May the result be used?
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Every limit was evaluated and met.
    Accepted,
    /// A limit was exceeded, or a requested quantity is not observable.
    Rejected,
    /// Nothing was exceeded, but not every limit could be evaluated. Not a pass.
    #[default]
    NotEvaluated,
}

/// A limit of the profile.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Limit {
    /// The profile's key, `held_out_rms_mm`.
    pub name: String,
    /// What is limited, in words.
    pub quantity: String,
    /// SI unit of `limit` and `value`.
    pub unit: Unit,
    /// The largest accepted value.
    pub limit: f64,
    /// What was found; `None` when it could not be evaluated.
    pub value: Option<f64>,
    /// Met, exceeded, or not evaluated.
    pub outcome: Outcome,
    /// Why it was not evaluated; empty otherwise.
    pub reason: String,
}

impl Limit {
    /// A limit that was evaluated. A value that is not finite does not meet any limit.
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

/// What became of a limit.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// value ≤ limit.
    Met,
    /// value > limit, or not a number.
    Exceeded,
    /// No data to evaluate it on. Never a pass.
    #[default]
    NotEvaluated,
}

/// The verdict that the limits alone give: exceeded beats not evaluated beats met, and no limit at all is not evaluated.
///
/// What else speaks against a result (a requested quantity that is not observable, a solver that stalled) is the caller's to add.
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
    fn a_limit_that_was_not_evaluated_is_never_a_pass() {
        let met = Limit::evaluated("a", "", Unit::Metre, 1.0, 1.0);
        let exceeded = Limit::evaluated("b", "", Unit::Metre, 1.0, 1.0 + 1e-12);
        let not_a_number = Limit::evaluated("c", "", Unit::Metre, 1.0, f64::NAN);
        let open = Limit::not_evaluated("d", "", Unit::Metre, 1.0, "no validation poses");
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
