//! What speaks against a result: one finding and one remedy each, and the place that shows the evidence.

use calib_finding::Fact;

use super::prose::{full_stop, sentence};
use crate::{Effect, Reason, ReasonId, Report};

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

/// Everything that speaks against the result, in the order of the verdict.
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
    against
        .flat_map(|reason| of_reason(report, reason))
        .collect()
}

/// The findings behind a reason, or the reason itself.
fn of_reason(report: &Report, reason: &Reason) -> Vec<Remark> {
    let id = reason.values.get("finding").and_then(Fact::word);
    let named = report.findings.iter();
    let named = named.filter(|finding| Some(finding.id.as_str()) == id);
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
