//! Why a result was not accepted, as far as the facts of a report say it.

use calib_finding::{About, Fact, Id, catalog};
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
        /// Nothing but the residuals of the fit tells that noise: what the recordings or the model lack is part of it.
        #[serde(default)]
        from_residuals: bool,
        /// How many times the stated noise that is, where the markers scatter as much about their own bodies; null elsewhere.
        #[serde(default)]
        above_stated: Option<f64>,
    },
    /// The data, the wiring or the model have an error of structure: a wrong sign, swapped names, a moved body.
    StructuralFault {
        /// Id of the finding or the reason that says so.
        evidence: String,
    },
    /// A finding that is no error by itself names what made the errors: a body that slipped, clocks that differ.
    NamedCause {
        /// Id of the finding.
        evidence: String,
    },
    /// The residuals show an effect that the model lacks.
    MissingEffect {
        /// Its parameter: `elbow.compliance`.
        parameter: String,
    },
    /// Joint values and tracker data of the rows of a recording are not of the same time.
    ClockOffset {
        /// The recording.
        recording: String,
    },
    /// The estimate meets the limits, and its uncertainty does not decide, or nothing was verified.
    TooFewPoses {
        /// Validation postures that would decide it; null where that is not known.
        postures: Option<usize>,
        /// Whether poses of the fit help more: that many validation postures are out of proportion.
        #[serde(default)]
        fitted: bool,
        /// What the tracker's noise contributes to the error, m, where that is most of it; null elsewhere.
        #[serde(default)]
        tracker_m: Option<f64>,
    },
    /// No limit is exceeded, but predictions are less certain than the result states.
    BeyondStated {
        /// Id of the reason that says so.
        evidence: String,
    },
    /// The profile sets no limits.
    NoLimits,
    /// The error is larger than the limit, and nothing in the report says why.
    Unexplained,
    /// No limit is exceeded, and a rule of the verdict leaves it open.
    Open {
        /// Id of the rule.
        evidence: String,
    },
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
        let found = clock_offset(report)
            .or_else(|| scaled(report))
            .or_else(|| error(report))
            .or_else(|| only_without_limits(report))
            .or_else(|| below_noise(report))
            .or_else(|| changed(report))
            .or_else(|| missing_effect(report))
            .or_else(|| named(report))
            .or_else(|| structural(report))
            .or_else(|| beyond_stated(report))
            .or_else(|| undecided(report))
            .or_else(|| open(report));
        Some(found.unwrap_or(Self::Unexplained))
    }
}

fn below_noise(report: &Report) -> Option<Diagnosis> {
    // A marker that is loose is not the tracker.
    let mut findings = report.findings.iter();
    if findings.any(|f| f.id == catalog::MARKER_NOISE && f.severity >= Severity::Warning) {
        return None;
    }
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
        from_residuals: from_residuals(report),
        above_stated: of_scatter(report).map(|[factor, _]| factor),
    })
}

/// Whether the tracker writes poses and nobody stated their noise: markers scatter about their bodies, poses about nothing.
fn from_residuals(report: &Report) -> bool {
    let of = |kind| report.noise.iter().filter(move |noise| noise.kind == kind);
    of(NoiseKind::Orientation).next().is_some()
        && of(NoiseKind::Position).all(|noise| noise.stated.is_none())
}

/// Noise of one coordinate, m, that no tracker has with which robots are calibrated: where none is stated, what the model lacks was found as noise.
const NO_TRACKER: f64 = 0.01;

/// How many times the stated noise was found, and how many times as much markers scatter about their own bodies, which no error of the robot makes them do;
/// `None` where the scatter does not explain the noise.
fn of_scatter(report: &Report) -> Option<[f64; 2]> {
    let mut reasons = report.reason_facts.iter();
    let above = reasons.find(|reason| reason.id == ReasonId::NoiseAboveStated)?;
    let value = |key| above.values.get(key).and_then(Fact::value);
    Some([value("factor")?, value("rigid")?])
}

/// Stated noise of the tracker over the noise that was found, at most 1: what a model lacks is found as noise, too. Where that is known, no more
/// than the stated noise is called the tracker's anyway. Where none is stated, and the noise is far above the scatter of the markers about their bodies, it
/// is not the tracker's.
fn stated_share(report: &Report) -> f64 {
    let lacking = [catalog::MISSING_PHYSICS, catalog::CHANGED_WHILE_RECORDING];
    if report.findings.iter().any(|f| lacking.contains(&f.id)) {
        return 1.0;
    }
    if let Some([factor, rigid]) = of_scatter(report) {
        return (rigid / factor).min(1.0);
    }
    let mut reasons = report.reason_facts.iter();
    let above = reasons.find(|reason| reason.id == ReasonId::NoiseAboveScatter);
    if let Some(factor) = above.and_then(|reason| reason.values.get("factor")?.value()) {
        return 1.0 / factor;
    }
    let noise = report.noise.iter();
    let positions = noise.filter(|noise| noise.kind == NoiseKind::Position);
    let unstated = positions.clone().filter(|noise| noise.stated.is_none());
    if unstated
        .filter_map(|noise| noise.sigma)
        .any(|sigma| sigma > NO_TRACKER)
    {
        return 0.0;
    }
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

/// Recordings in units of length of their own: whatever else is found follows from them.
fn scaled(report: &Report) -> Option<Diagnosis> {
    let mut findings = report.findings.iter();
    let scaled = findings.find(|f| f.id == catalog::TRACKER_SCALE)?;
    Some(Diagnosis::NamedCause {
        evidence: scaled.id.as_str().to_owned(),
    })
}

/// An error of the data or the model.
fn error(report: &Report) -> Option<Diagnosis> {
    let is_error = |f: &&crate::Finding| {
        f.severity == Severity::Error
            && f.id != catalog::MISSING_PHYSICS
            && !is_left_by_change(report, f)
    };
    let finding = report.findings.iter().find(is_error)?;
    Some(Diagnosis::StructuralFault {
        evidence: finding.id.as_str().to_owned(),
    })
}

/// Whether held-out recordings differ by what changed while the fitted ones were recorded: the fit is of neither state of it.
fn is_left_by_change(report: &Report, error: &crate::Finding) -> bool {
    let held_out = [
        catalog::TRACKER_MOVED,
        catalog::BODY_REMOUNTED,
        catalog::JOINT_ZERO_CHANGED,
    ];
    let is_held_out = error.id == catalog::JOINT_ZERO_CHANGED
        || error.facts.get("kind").and_then(Fact::word) == Some("held_out");
    if !held_out.contains(&error.id) || !is_held_out {
        return false;
    }
    let explains = |about: &About| match (about, error.facts.get("joints")) {
        (About::Joint(joint), Some(Fact::Names(joints))) => joints.contains(joint),
        _ => false,
    };
    let mut findings = report.findings.iter();
    findings.any(|f| {
        let about = &f.subject.about;
        f.id == catalog::CHANGED_WHILE_RECORDING
            && (*about == error.subject.about || explains(about))
    })
}

fn structural(report: &Report) -> Option<Diagnosis> {
    // Where positions are off, wrong orientations are no other fault.
    let beside = |id| id == ReasonId::OrientationOff && any_exceeded(report);
    let mut reasons = report.reason_facts.iter();
    let is_one = |id| STRUCTURAL.contains(&id) && !beside(id);
    let reason = reasons.find(|r| r.effect != Effect::Supports && is_one(r.id))?;
    Some(Diagnosis::StructuralFault {
        evidence: reason.id.as_str().to_owned(),
    })
}

/// What moved during recording, unless a missing effect explains more.
fn changed(report: &Report) -> Option<Diagnosis> {
    let mut findings = report.findings.iter();
    let of = findings.find(|f| f.id == catalog::CHANGED_WHILE_RECORDING)?;
    let own = of.facts.get("physics").is_none();
    own.then(|| Diagnosis::NamedCause {
        evidence: of.id.as_str().to_owned(),
    })
}

/// Findings that say what made the errors.
pub(crate) const NAMED_CAUSES: [Id; 12] = [
    catalog::TRACKER_SCALE,
    catalog::CHANGED_WHILE_RECORDING,
    catalog::MISSING_PHYSICS,
    CAUSES[0],
    CAUSES[1],
    CAUSES[2],
    CAUSES[3],
    CAUSES[4],
    CAUSES[5],
    CAUSES[6],
    CAUSES[7],
    CAUSES[8],
];

/// Findings that name a cause of errors without a test of the fit, the most likely first.
const CAUSES: [Id; 9] = [
    catalog::BASE_MOVES,
    catalog::TRACKER_SWAYS,
    catalog::ERRORS_FOLLOW_PLACE,
    catalog::JOINTS_HELD,
    catalog::CLOCK_LAG,
    catalog::JOINT_GAIN,
    catalog::JOINT_COUPLING,
    catalog::JOINT_SCATTERS,
    catalog::MARKER_NOISE,
];

/// Kinds of an offset of the clocks that the fit took into account: it made no error.
const CORRECTED: [&str; 3] = ["corrected_behind", "corrected_ahead", "offset"];

fn named(report: &Report) -> Option<Diagnosis> {
    let is_corrected = |f: &crate::Finding| {
        let kind = f.facts.get("kind").and_then(Fact::word);
        f.id == catalog::CLOCK_LAG && kind.is_some_and(|kind| CORRECTED.contains(&kind))
    };
    let warns = |id: &Id| {
        let mut findings = report.findings.iter();
        findings.any(|f| f.id == *id && f.severity >= Severity::Warning && !is_corrected(f))
    };
    let id = CAUSES.into_iter().find(warns)?;
    Some(Diagnosis::NamedCause {
        evidence: id.as_str().to_owned(),
    })
}

/// A clock, or readings of a joint that are late, explain most of what the model lacks; where an error was found it must have been seen before the fit, too.
fn clock_offset(report: &Report) -> Option<Diagnosis> {
    let missing = report.findings.iter();
    let missing = missing.filter(|f| f.id == catalog::MISSING_PHYSICS);
    let explains = |f: &crate::Finding| f.facts.get("explains").and_then(Fact::value);
    let most = missing.max_by(|a, b| {
        let [a, b] = [a, b].map(|f| explains(f).unwrap_or(0.0));
        a.total_cmp(&b)
    })?;
    let word = |f: &crate::Finding, key| f.facts.get(key).and_then(Fact::word).map(str::to_owned);
    let mut findings = report.findings.iter();
    let seen_before = findings.clone().find(|f| f.id == catalog::CLOCK_LAG);
    let error = findings.any(|f| f.severity == Severity::Error && f.id != catalog::MISSING_PHYSICS);
    if seen_before.is_none() && error {
        return None;
    }
    if let Some(recording) = word(most, "recording") {
        return Some(Diagnosis::ClockOffset { recording });
    }
    // Of one joint: as it was found before the fit, where it was.
    most.facts.get("late")?;
    let same = |f: &&crate::Finding| word(f, "joint") == word(most, "joint");
    let of = seen_before.filter(same).map_or(most.id, |f| f.id);
    Some(Diagnosis::NamedCause {
        evidence: of.as_str().to_owned(),
    })
}

fn missing_effect(report: &Report) -> Option<Diagnosis> {
    let mut findings = report.findings.iter();
    let missing = findings.find(|f| f.id == catalog::MISSING_PHYSICS)?;
    let parameter = missing.facts.get("parameter").and_then(Fact::word)?;
    Some(Diagnosis::MissingEffect {
        parameter: parameter.to_owned(),
    })
}

/// A validation that would need more than this many times its postures is not what decides.
const OUT_OF_PROPORTION: usize = 3;

fn any_exceeded(report: &Report) -> bool {
    let mut limits = report.limits.iter();
    limits.any(|limit| limit.outcome == Outcome::Exceeded)
}

/// What leaves a verdict open although no limit is exceeded.
fn open(report: &Report) -> Option<Diagnosis> {
    if any_exceeded(report) {
        return None;
    }
    let mut reasons = report.reason_facts.iter();
    let reason = reasons.find(|r| matches!(r.effect, Effect::LeavesOpen | Effect::Rejects))?;
    let evidence = reason.id.as_str().to_owned();
    Some(match reason.id {
        ReasonId::HeldOutBeyondStated
        | ReasonId::UncertaintyTooSmall
        | ReasonId::GoodnessOfFit
        | ReasonId::NoiseAboveStated
        | ReasonId::NoiseBelowStated => Diagnosis::BeyondStated { evidence },
        _ => Diagnosis::Open { evidence },
    })
}

/// Errors of the validation that are larger than the fit allows: more poses like them do not mend what makes them.
fn beyond_stated(report: &Report) -> Option<Diagnosis> {
    if any_exceeded(report) {
        return None;
    }
    let mut reasons = report.reason_facts.iter();
    let opens = |effect| matches!(effect, Effect::LeavesOpen | Effect::Rejects);
    let beyond = reasons.find(|r| r.id == ReasonId::HeldOutBeyondStated && opens(r.effect))?;
    let evidence = beyond.id.as_str().to_owned();
    Some(Diagnosis::BeyondStated { evidence })
}

/// The profile sets no limits, and nothing else leaves the verdict open: whatever the findings warn of, without limits the answer stays the same.
fn only_without_limits(report: &Report) -> Option<Diagnosis> {
    let mut opens = (report.reason_facts.iter())
        .filter(|r| matches!(r.effect, Effect::LeavesOpen | Effect::Rejects))
        .peekable();
    let any = opens.peek().is_some();
    (any && opens.all(|r| r.id == ReasonId::NoLimits)).then_some(Diagnosis::NoLimits)
}

fn undecided(report: &Report) -> Option<Diagnosis> {
    // More poses do not mend an error that is larger than a limit.
    if any_exceeded(report) {
        return None;
    }
    let has = |id| {
        let mut reasons = report.reason_facts.iter();
        reasons.find(|r| r.id == id && r.effect != Effect::Supports)
    };
    if let Some(open) = has(ReasonId::LimitUndecided) {
        let postures = open.values.get("postures").and_then(Fact::value);
        let postures = postures.map(|n| n as usize).filter(|n| *n > 0);
        let held_out = report.verification.held_out.as_ref();
        let now = held_out.map_or(0, |h| if h.left_out { 0 } else { h.postures });
        let fitted = now > 0 && postures.is_some_and(|n| n > OUT_OF_PROPORTION * now);
        return Some(Diagnosis::TooFewPoses {
            postures,
            fitted,
            tracker_m: mostly_tracker(report).filter(|_| fitted),
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
    .map(|_| Diagnosis::TooFewPoses {
        postures: None,
        fitted: false,
        tracker_m: None,
    })
}

/// What the tracker's noise contributes to the position error on new poses, m, where that is more than half of its variance: better geometry hardly lowers it.
fn mostly_tracker(report: &Report) -> Option<f64> {
    let expected = report.verification.held_out.as_ref()?.expected?;
    let tracker_m = expected.tracker_m? * stated_share(report);
    (2.0 * tracker_m.powi(2) > expected.rms_m.powi(2)).then_some(tracker_m)
}

#[cfg(test)]
mod tests;
