//! Why a result was not accepted, as far as the facts of a report say it.

use calib_finding::{Fact, catalog};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{Effect, NoiseKind, Outcome, ReasonId, Report, Severity, Verdict};

/// The most likely reason why a result was not accepted.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case")]
#[non_exhaustive]
pub enum Diagnosis {
    /// A limit is below the noise of one measurement of the tracker: no robot can meet it.
    LimitBelowNoise {
        /// The limit's key in the profile.
        limit_name: String,
        /// The limit, m.
        limit_m: f64,
        /// What the tracker's noise contributes to the same number, m.
        tracker_m: f64,
    },
    /// The data, the wiring or the model have an error of structure: a wrong sign, swapped names, a moved body.
    StructuralFault {
        /// Id of the finding or the reason that says so.
        evidence: String,
    },
    /// The residuals show an effect that the model lacks.
    MissingEffect {
        /// Its parameter: `elbow.compliance`.
        parameter: String,
    },
    /// The estimate meets the limits, and its uncertainty does not decide, or nothing was verified.
    TooFewPoses {
        /// Postures that would decide it; null where that is not known.
        postures: Option<usize>,
    },
    /// The profile sets no limits.
    NoLimits,
    /// The error is larger than the limit, and nothing in the report says why.
    Unexplained,
}

impl Diagnosis {
    /// Of a judged report; `None` where the result is accepted.
    #[must_use]
    pub fn of(report: &Report) -> Option<Self> {
        if matches!(
            report.verdict,
            Verdict::Accepted | Verdict::AcceptedWithWarnings
        ) {
            return None;
        }
        let found = below_noise(report)
            .or_else(|| structural(report))
            .or_else(|| missing_effect(report))
            .or_else(|| undecided(report));
        Some(found.unwrap_or(Self::Unexplained))
    }
}

fn below_noise(report: &Report) -> Option<Diagnosis> {
    let held_out = report.verification.held_out.as_ref()?;
    let tracker_m = held_out.expected.as_ref()?.tracker_m? * stated_share(report);
    let missed = |outcome| matches!(outcome, Outcome::Exceeded | Outcome::Undecided);
    let limit = report.limits.iter().find(|limit| {
        limit.name.starts_with("held_out_rms_mm")
            && missed(limit.outcome)
            && limit.limit <= tracker_m
    })?;
    Some(Diagnosis::LimitBelowNoise {
        limit_name: limit.name.clone(),
        limit_m: limit.limit,
        tracker_m,
    })
}

/// Stated noise of the tracker over the noise that was found, at most 1: what a model lacks is found as noise, too.
fn stated_share(report: &Report) -> f64 {
    let noise = report.noise.iter();
    let positions = noise.filter(|noise| noise.kind == NoiseKind::Position);
    let shares = positions.filter_map(|noise| Some(noise.stated? / noise.sigma?));
    shares.filter(|share| *share > 0.0).fold(1.0, f64::min)
}

/// Reasons that noise and a few more poses cannot make.
const STRUCTURAL: [ReasonId; 6] = [
    ReasonId::ReversedAxis,
    ReasonId::NotConverged,
    ReasonId::OriginNotDetermined,
    ReasonId::WorseThanRegistration,
    ReasonId::RejectedPart,
    ReasonId::OrientationOff,
];

fn structural(report: &Report) -> Option<Diagnosis> {
    let error =
        |f: &&crate::Finding| f.severity == Severity::Error && f.id != catalog::MISSING_PHYSICS;
    let of_findings = report.findings.iter().find(error);
    let of_reasons = || {
        let mut reasons = report.reason_facts.iter();
        reasons.find(|r| r.effect != Effect::Supports && STRUCTURAL.contains(&r.id))
    };
    let evidence = match of_findings {
        Some(finding) => finding.id.as_str().to_owned(),
        None => of_reasons()?.id.as_str().to_owned(),
    };
    Some(Diagnosis::StructuralFault { evidence })
}

fn missing_effect(report: &Report) -> Option<Diagnosis> {
    let mut findings = report.findings.iter();
    let missing = findings.find(|f| f.id == catalog::MISSING_PHYSICS)?;
    let parameter = missing.facts.get("parameter").and_then(Fact::word)?;
    Some(Diagnosis::MissingEffect {
        parameter: parameter.to_owned(),
    })
}

fn undecided(report: &Report) -> Option<Diagnosis> {
    let has = |id| {
        let mut reasons = report.reason_facts.iter();
        reasons.find(|r| r.id == id && r.effect != Effect::Supports)
    };
    if let Some(open) = has(ReasonId::LimitUndecided) {
        let postures = open.values.get("postures").and_then(Fact::value);
        return Some(Diagnosis::TooFewPoses {
            postures: postures.map(|n| n as usize).filter(|n| *n > 0),
        });
    }
    if has(ReasonId::NoLimits).is_some() {
        return Some(Diagnosis::NoLimits);
    }
    [
        ReasonId::NoValidation,
        ReasonId::PredictionUndecided,
        ReasonId::EffectsNotExcluded,
        ReasonId::ValidationRepeatsFit,
        ReasonId::SingleJointData,
        ReasonId::LimitNotEvaluated,
    ]
    .into_iter()
    .find_map(has)
    .map(|_| Diagnosis::TooFewPoses { postures: None })
}
