use crate::verdict::{Effect, Judgment, Reason, ReasonId};
use crate::{
    AccuracyLimit, Change, Clock, Component, ContactPoint, DataInformation, DhTable, Diagnosis,
    EstimatorResult, Finding, FitSummary, Identification, Input, JointCoverage, LoopClosure, Noise,
    NoiseChoice, NotObservable, Output, Parameter, PriorWidth, RecordingSummary, Rejected,
    Residuals, RobotChange, Selection, TestedEffect, Transform, Unit, Verification, WeakDirections,
    Workspace,
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
    /// What was measured, by whom, when and with what, as the profile states it.
    #[serde(default)]
    pub identification: Identification,
    /// The solution method.
    pub method: Method,
    /// Whether the result may be used.
    pub verdict: Verdict,
    /// The reasons: one sentence each, the most important first.
    pub reasons: Vec<String>,
    /// The ids of the reasons, in the same order.
    #[serde(default)]
    pub reason_ids: Vec<ReasonId>,
    /// What each reason does to the verdict, and its values, in the same order.
    #[serde(default)]
    pub reason_facts: Vec<Reason>,
    /// What the verdict is valid for: one sentence each (tool point, joint ranges, load).
    #[serde(default)]
    pub scope: Vec<String>,
    /// What it must not be used for: one phrase each.
    #[serde(default)]
    pub not_for: Vec<String>,
    /// Why the result was not accepted, as far as the facts say it; null where it was.
    #[serde(default)]
    pub diagnosis: Option<Diagnosis>,
    /// The limits of the profile and whether they were met.
    #[serde(default)]
    pub limits: Vec<Limit>,
    /// What the reader should do now, the most useful first.
    #[serde(default)]
    pub next_steps: Vec<String>,
    /// Estimated transforms, and those derived from them.
    pub transforms: Vec<Transform>,
    /// Points of the robot that touch something. Empty without contacts.
    #[serde(default)]
    pub contact_points: Vec<ContactPoint>,
    /// Every scalar unknown.
    pub parameters: Vec<Parameter>,
    /// What changed of the robot itself, in numbers that no choice of frames changes; the most significant first.
    #[serde(default)]
    pub robot_changes: Vec<RobotChange>,
    /// The chain to the tool as Denavit–Hartenberg and Hayati parameters; null with `method: paper`.
    #[serde(default)]
    pub dh_table: Option<DhTable>,
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
    /// What is random from pose to pose, by evidence. Null where the profile states it, and with too few poses.
    #[serde(default)]
    pub noise_choice: Option<NoiseChoice>,
    /// Prior widths that the numbers of a kind share. Empty without a fit of all loops.
    #[serde(default)]
    pub prior_widths: Vec<PriorWidth>,
    /// Effects that the model lacks, tested on what is left: which of them the data ask for, most significant first. Empty without a fit of all loops.
    #[serde(default)]
    pub tested_effects: Vec<TestedEffect>,
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
    /// How the model was chosen; null where the profile's was used.
    #[serde(default)]
    pub selection: Option<Selection>,
    /// What limits the accuracy, largest share first.
    #[serde(default)]
    pub accuracy_limits: Vec<AccuracyLimit>,
    /// Findings of the data checks.
    pub findings: Vec<Finding>,
    /// Files that were read.
    pub inputs: Vec<Input>,
    /// Estimators, readers, report writers and joint effects that the profile named or that were found for it.
    #[serde(default)]
    pub components: Vec<Component>,
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

impl Report {
    /// The same with a verdict and its reasons.
    #[must_use]
    pub fn judged(self, judgment: Judgment) -> Self {
        let reasons = &judgment.reasons;
        let judged = Self {
            verdict: judgment.verdict,
            reasons: reasons.iter().map(Reason::sentence).collect(),
            reason_ids: reasons.iter().map(|reason| reason.id).collect(),
            reason_facts: judgment.reasons,
            ..self
        };
        Self {
            diagnosis: Diagnosis::of(&judged),
            ..judged
        }
    }

    /// How many warnings a reader is shown: a reason that stands for several findings counts each of them.
    #[must_use]
    pub fn warnings(&self) -> usize {
        let warns = |reason: &&Reason| reason.effect == Effect::Warns;
        let times = |reason: &Reason| match reason.values.get("times") {
            Some(calib_finding::Fact::Count(times)) => {
                usize::try_from(*times).unwrap_or(usize::MAX)
            }
            _ => 1,
        };
        self.reason_facts.iter().filter(warns).map(times).sum()
    }

    /// Sentences of the reasons that speak against the result; all of them where a report states no effects.
    pub fn objections(&self) -> impl Iterator<Item = &String> {
        let supports = |i: usize| {
            let reason = self.reason_facts.get(i);
            reason.is_some_and(|reason| reason.effect == Effect::Supports)
        };
        let reasons = self.reasons.iter().enumerate();
        reasons.filter(move |(i, _)| !supports(*i)).map(|(_, r)| r)
    }
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
    /// Every rule holds.
    Accepted,
    /// Nothing speaks against the result, but some rules hold only in part: every limit is met by its estimate.
    AcceptedWithWarnings,
    /// A rule says that the result is wrong: a limit was exceeded, or a requested quantity is not observable.
    Rejected,
    /// Nothing says that the result is wrong, and the evidence that it is right does not suffice. Not accepted.
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
    /// Lower end of the value's 95 % interval; `None` where the value is exact.
    #[serde(default)]
    pub low: Option<f64>,
    /// Upper end of the same.
    #[serde(default)]
    pub high: Option<f64>,
    /// Met, exceeded, undecided, or not evaluated.
    pub outcome: Outcome,
    /// Why it was not evaluated; empty otherwise.
    pub reason: String,
}

/// What a limit is about.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Limited {
    /// The profile's key, `held_out_rms_mm`.
    pub name: String,
    /// The quantity, in words.
    pub quantity: String,
    /// SI unit.
    pub unit: Unit,
}

impl Limit {
    /// A limit against a value and its interval; without one the value is exact. A value that is not finite meets no limit.
    #[must_use]
    pub fn compared(of: Limited, limit: f64, value: f64, interval: Option<(f64, f64)>) -> Self {
        let (low, high) = interval.unwrap_or((value, value));
        let outcome = if high <= limit {
            Outcome::Met
        } else if low <= limit {
            Outcome::Undecided
        } else {
            Outcome::Exceeded
        };
        Self {
            name: of.name,
            quantity: of.quantity,
            unit: of.unit,
            limit,
            value: value.is_finite().then_some(value),
            low: interval.map(|i| i.0),
            high: interval.map(|i| i.1),
            outcome,
            reason: String::new(),
        }
    }

    /// Errors of poses left out in turn are those of results with a pose less, `over` times larger than with all of them: a limit
    /// that all of them may meet is not exceeded.
    #[must_use]
    pub fn left_out(mut self, over: Option<f64>) -> Self {
        let held_out = self.name.starts_with("held_out");
        let least = self.low.or(self.value).zip(over.filter(|_| held_out));
        if self.outcome == Outcome::Exceeded
            && least.is_some_and(|(low, over)| low <= over * self.limit)
        {
            self.outcome = Outcome::Undecided;
        }
        self
    }

    /// A limit against an exact value.
    #[must_use]
    pub fn evaluated(of: Limited, limit: f64, value: f64) -> Self {
        Self::compared(of, limit, value, None)
    }

    /// A limit that could not be evaluated, and why.
    #[must_use]
    pub fn not_evaluated(of: Limited, limit: f64, reason: impl Into<String>) -> Self {
        Self {
            name: of.name,
            quantity: of.quantity,
            unit: of.unit,
            limit,
            reason: reason.into(),
            ..Self::default()
        }
    }
}

/// The outcome of a limit.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// The value, and the upper end of its interval where it has one, is at most the limit.
    Met,
    /// The value, and the lower end of its interval where it has one, is above the limit, or is not a number.
    Exceeded,
    /// The limit lies within the interval of the value.
    Undecided,
    /// No data to evaluate it with. Never accepted.
    #[default]
    NotEvaluated,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_limit_is_compared_with_the_interval() {
        let limit = |value, interval| Limit::compared(named(), 1.0, value, interval).outcome;
        assert_eq!(limit(0.9, Some((0.8, 1.0))), Outcome::Met);
        assert_eq!(limit(0.9, Some((0.8, 1.1))), Outcome::Undecided);
        assert_eq!(limit(1.1, Some((0.9, 1.3))), Outcome::Undecided);
        assert_eq!(limit(1.2, Some((1.1, 1.3))), Outcome::Exceeded);
        assert_eq!(limit(1.0, None), Outcome::Met);
        assert_eq!(limit(1.0 + 1e-12, None), Outcome::Exceeded);
        assert_eq!(limit(f64::NAN, None), Outcome::Exceeded);
        assert_eq!(Limit::compared(named(), 1.0, f64::NAN, None).value, None);
    }

    fn named() -> Limited {
        Limited {
            name: "a".into(),
            quantity: String::new(),
            unit: Unit::Meter,
        }
    }
}
