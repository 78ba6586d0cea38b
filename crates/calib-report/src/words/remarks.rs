//! What speaks against a result: one finding and one remedy each, and the place that shows the evidence.

use std::cmp::Reverse;

use calib_finding::Fact;

use super::prose::{full_stop, sentence};
use crate::diagnosis::NAMED_CAUSES;
use crate::{Effect, Reason, ReasonId, Report, Severity};

/// A warning or an objection.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Remark {
    /// What it does to the verdict.
    pub(crate) effect: Effect,
    /// A sentence.
    pub(crate) text: String,
    /// What to do; may be empty.
    pub(crate) remedy: String,
    /// Id of the section with the evidence.
    pub(crate) place: &'static str,
}

/// Everything that speaks against the result, the gravest first: of what weighs the same, that which names the cause of errors, then other findings,
/// then what the rules of the verdict say.
pub(crate) fn remarks(report: &Report) -> Vec<Remark> {
    if report.reason_facts.is_empty() {
        let of_text = |text: &String| Remark {
            effect: Effect::Warns,
            text: sentence(text),
            remedy: String::new(),
            place: "verdict",
        };
        return report.reasons.iter().map(of_text).collect();
    }
    let against = report.reason_facts.iter();
    let against = against.filter(|reason| reason.effect != Effect::Supports);
    let mut against: Vec<&Reason> = against.collect();
    let is_rule = |reason: &Reason| reason.values.get("finding").is_none();
    against.sort_by_key(|reason| {
        let cause = names_a_cause(reason);
        (Reverse(reason.effect), !cause, is_rule(reason))
    });
    let all = against.into_iter();
    all.flat_map(|reason| of_reason(report, reason)).collect()
}

/// Whether a reason is a finding that says why errors are as large as they are.
fn names_a_cause(reason: &Reason) -> bool {
    let id = reason.values.get("finding").and_then(Fact::word);
    let mut causes = NAMED_CAUSES.iter();
    id.is_some_and(|id| causes.any(|cause| cause.as_str() == id))
}

/// The findings behind a reason, or the reason itself.
fn of_reason(report: &Report, reason: &Reason) -> Vec<Remark> {
    let id = reason.values.get("finding").and_then(Fact::word);
    let named = report.findings.iter();
    // One kind of a finding may be for information only beside another that warns.
    let named = named
        .filter(|finding| Some(finding.id.as_str()) == id && finding.severity != Severity::Info);
    let of_finding = |finding: &crate::Finding| Remark {
        effect: reason.effect,
        text: format!("{}: {}", finding.subject, full_stop(&finding.text())),
        remedy: full_stop(&finding.remedy()),
        place: "data",
    };
    let found: Vec<Remark> = named.map(of_finding).collect();
    if !found.is_empty() {
        return found;
    }
    vec![Remark {
        effect: reason.effect,
        text: sentence(&reason.sentence()),
        remedy: String::new(),
        place: place(reason.id),
    }]
}

/// The section that shows the evidence of a rule.
fn place(id: ReasonId) -> &'static str {
    match id {
        ReasonId::WarningFinding
        | ReasonId::UnresolvedError
        | ReasonId::RejectedPart
        | ReasonId::RejectedShare => "data",
        ReasonId::NotConverged
        | ReasonId::GoodnessOfFit
        | ReasonId::NoiseAboveStated
        | ReasonId::NoiseBelowStated => "residuals",
        ReasonId::ImplausibleChange | ReasonId::ReversedAxis => "changes",
        ReasonId::PredictionUndecided
        | ReasonId::EffectsNotExcluded
        | ReasonId::UncertaintyTooSmall
        | ReasonId::SingleJointData => "weak-directions",
        ReasonId::LimitExceeded
        | ReasonId::LimitUndecided
        | ReasonId::LimitNotEvaluated
        | ReasonId::NoLimits
        | ReasonId::OriginNotDetermined => "verdict",
        _ => "held-out",
    }
}

/// What warns, without what rejects or leaves open.
pub(crate) fn warnings(report: &Report) -> Vec<String> {
    let all = remarks(report).into_iter();
    all.filter(|r| r.effect == Effect::Warns)
        .map(|r| r.text)
        .collect()
}
