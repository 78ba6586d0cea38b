//! Why a result was not accepted, and the command that comes next.

use super::prose::{code, full_stop};
use crate::budget::Budget;
use crate::shell_path;
use crate::{Diagnosis, HeldOut, Output, ReasonId, Report, Unit, Verdict, number};
use calib_finding::Fact;

/// Multiples of the tracker's noise that a limit of the rms error should leave room for.
const ROOM: f64 = 1.5;

impl Diagnosis {
    /// The diagnosis and the remedy, a sentence or two each; `again` is the command that runs the profile.
    pub(crate) fn words(&self, report: &Report, again: &str) -> [String; 2] {
        match self {
            Self::LimitBelowNoise {
                limit_name,
                limit_m,
                tracker_m,
                from_residuals,
                above_stated,
            } => {
                let noise = (*tracker_m, *from_residuals, *above_stated);
                limit_below_noise(limit_name, *limit_m, noise, again)
            }
            Self::StructuralFault { evidence } | Self::NamedCause { evidence } => of_finding(
                report, evidence, again,
            )
            .or_else(|| of_reason(report, evidence, again))
            .unwrap_or_else(|| {
                let id = code(evidence);
                [
                    format!(
                        "The data or the model have an error ({id}) that more poses cannot remove."
                    ),
                    format!("Correct it, then run `{again}`."),
                ]
            }),
            Self::BeyondStated { evidence } | Self::Open { evidence } => {
                let because = of_reason(report, evidence, again);
                because.unwrap_or_else(|| {
                    let id = code(evidence);
                    [
                        format!(
                            "No limit is exceeded, but a rule of the verdict leaves it open ({id})."
                        ),
                        format!("Look at this rule in the report, then run `{again}`."),
                    ]
                })
            }
            Self::ClockOffset { recording } => [
                format!(
                    "Joint values and tracker data in the rows of {} are not of the same time.",
                    code(recording)
                ),
                format!(
                    "Set `timing: {{poses: continuous, clock: estimate}}` in {} and in the recordings made in the same way, then run `{again}`.",
                    code(recording)
                ),
            ],
            Self::MissingEffect { parameter } => [
                format!(
                    "The residuals show an effect that the model lacks: {}.",
                    code(parameter)
                ),
                match report.selection {
                    None => format!("Let `{again} --select` choose the effects to free."),
                    // It would answer the same again.
                    Some(_) => format!(
                        "`--select` did not choose it: free it under `solve.joints`, run `{again}`, and compare the held-out errors."
                    ),
                },
            ],
            Self::TooFewPoses {
                postures,
                fitted,
                tracker_m,
            } => too_few_poses(*postures, *fitted, *tracker_m, again),
            Self::NoLimits => [
                "The profile sets no limits, so nothing could be accepted.".to_owned(),
                format!("Set `solve.limits.held_out_rms_mm`, then run `{again}`."),
            ],
            Self::Unexplained => unexplained(report, again),
        }
    }
}

/// Of a limit in m below the tracker's noise: that noise in m, whether only the residuals tell it, and how many times the stated one it is.
fn limit_below_noise(
    limit_name: &str,
    limit_m: f64,
    (tracker_m, from_residuals, above_stated): (f64, bool, Option<f64>),
    again: &str,
) -> [String; 2] {
    let [limit, tracker] = [limit_m, tracker_m].map(|m| number::plain(m, Unit::Meter));
    let enough = (ROOM * tracker_m * 1e4).ceil() / 10.0;
    if from_residuals {
        return [
            format!(
                "The limit of {limit} is below {tracker}, which the fit found as the noise of one tracker measurement. The profile states none: what is wrong in the recordings or missing in the model is part of it."
            ),
            format!(
                "State the noise of the tracker, `tracker: {{body_sigma_mm: …, body_sigma_deg: …}}`, so that the fit shows what exceeds it; only if the tracker is that noisy, set `solve.limits.{limit_name}` to {enough} or more. Then run `{again}`."
            ),
        ];
    }
    if let Some(factor) = above_stated {
        return [
            format!(
                "The tracker is {} times as noisy as the profile states: the noise of one measurement, {tracker}, is above the limit of {limit}, which no robot can meet so.",
                number::fixed(factor, 1)
            ),
            format!(
                "Find out why (the tracker's calibration, reflections, loose markers) and record again. If the tracker is that noisy, state its noise in `tracker`, and set `solve.limits.{limit_name}` to {enough} or more, or average several frames per pose. Then run `{again}`."
            ),
        ];
    }
    [
        format!(
            "The limit of {limit} is below the noise of one tracker measurement, {tracker}: no robot can meet it."
        ),
        format!(
            "Set `solve.limits.{limit_name}` to {enough} or more, or average several frames per pose; then run `{again}`."
        ),
    ]
}

/// Of an error that the poses do not decide.
fn too_few_poses(
    postures: Option<usize>,
    fitted: bool,
    tracker_m: Option<f64>,
    again: &str,
) -> [String; 2] {
    if let Some(tracker_m) = tracker_m {
        let needed = postures.map_or_else(String::new, |n| {
            format!(" This limit would need about {n} validation postures.")
        });
        return [
            format!(
                "The error is so near its limit that these poses do not decide, and most of it is the noise of one tracker measurement, {}.",
                number::plain(tracker_m, Unit::Meter)
            ),
            format!(
                "Average several frames per pose, which lowers that noise, or set a larger limit, then run `{again}`.{needed}"
            ),
        ];
    }
    [
        "There are too few poses to decide whether the limit is met.".to_owned(),
        match postures {
            Some(n) if fitted => format!(
                "Record more poses for the fit, in which all joints move, and run `{again}`: this error would need about {n} validation postures, a smaller one needs fewer."
            ),
            Some(n) => format!(
                "Record about {n} validation postures in which all joints move, then run `{again}`."
            ),
            None => format!(
                "Record more poses in which all joints move, some of them as validation, then run `{again}`."
            ),
        },
    ]
}

/// A selection that was made would answer the same again.
fn unexplained(report: &Report, again: &str) -> [String; 2] {
    /// Held-out poses that are off by more times what is left of the fitted ones are unlike these.
    const APART: f64 = 5.0;
    let held_out = report.verification.held_out.as_ref();
    let held_out = held_out.filter(|held_out| !held_out.left_out);
    let held_out = held_out.and_then(|held_out| held_out.calibrated.as_ref());
    let fitted = report.residuals.all.as_ref();
    let stated = Budget::of(report).map(|budget| budget.stated_m());
    if let (Some(held_out), Some(fitted), Some(stated)) = (held_out, fitted, stated)
        && held_out.rms_m > APART * fitted.rms_m.max(stated)
    {
        let [held_out, fitted] =
            [held_out.rms_m, fitted.rms_m].map(|m| number::plain(m, Unit::Meter));
        return [
            format!(
                "The held-out poses are off by {held_out} rms, though the calibrated model fits the others to {fitted}: something changed between these recordings, or readings of one of them are wrong."
            ),
            format!(
                "Compare the joint columns and the tracker's frame of the recordings, and repeat the held-out one in the state of the others, then run `{again}`."
            ),
        ];
    }
    match report.selection {
        None => [
            "The error is larger than the limit, and no single known effect explains it."
                .to_owned(),
            format!("Let `{again} --select` try the effects that the model lacks."),
        ],
        Some(_) => [
            "The error is larger than the limit, and no effect that was tried explains it."
                .to_owned(),
            format!(
                "Look at the findings and at the poses with the largest errors in the report: two causes can hide each other. Correct one, then run `{again}`."
            ),
        ],
    }
}

/// The first finding of an id, and its remedy.
fn of_finding(report: &Report, id: &str, again: &str) -> Option<[String; 2]> {
    let mut findings = report.findings.iter();
    let finding = findings.find(|f| f.id.as_str() == id)?;
    Some([
        format!("{}: {}", finding.subject, full_stop(&finding.text())),
        format!("{} Then run `{again}`.", full_stop(&finding.remedy())),
    ])
}

/// A reason of the verdict, and what can be done about it.
fn of_reason(report: &Report, id: &str, again: &str) -> Option<[String; 2]> {
    let mut reasons = report.reason_facts.iter();
    let reason = reasons.find(|r| r.id.as_str() == id)?;
    let remedy = match reason.id {
        ReasonId::ReversedAxis => {
            format!(
                "Correct the sign of this joint in the URDF or in the recordings, then run `{again}`."
            )
        }
        ReasonId::NotConverged => {
            format!(
                "Free less under `solve`, or record more poses in which all joints move, then run `{again}`."
            )
        }
        ReasonId::OriginNotDetermined => {
            format!("Sweep the joints of this origin over more of their range, then run `{again}`.")
        }
        ReasonId::RejectedPart => {
            format!(
                "Check what is special about this part of the recordings; record it again, then run `{again}`."
            )
        }
        ReasonId::OrientationOff => {
            format!(
                "Check the bodies' orientations and mounts, or set `solve.limits.held_out_rms_deg`, then run `{again}`."
            )
        }
        ReasonId::WorseThanRegistration | ReasonId::NotBetterThanRegistration => {
            format!(
                "Check that joints and tracker recorded the same motion at the same times, and record more poses; then run `{again}`."
            )
        }
        ReasonId::BodyNotVerified => {
            let body = reason.values.get("body").and_then(Fact::word);
            format!(
                "Record validation poses that show {}, with all joints moving; then run `{again}`.",
                code(body.unwrap_or("every body"))
            )
        }
        ReasonId::BodyAboveLimit => {
            let body = reason.values.get("body").and_then(Fact::word);
            format!(
                "Look at the poses of {} with the largest errors in the report, and record more fitted poses in which the joints that carry it move; then run `{again}`.",
                code(body.unwrap_or("this body"))
            )
        }
        ReasonId::TooFewToCompare => {
            format!("Record at least five validation poses, then run `{again}`.")
        }
        ReasonId::HeldOutBeyondStated => {
            format!(
                "Look at the poses with the largest errors in the report. If nothing changed between the fitted recordings and the validation (the payload, the zero of a joint, a body), let `{again} --select` try the effects that the model lacks."
            )
        }
        ReasonId::ImplausibleChange => {
            format!(
                "Compare the value with the mechanical drawing, or hold out poses in which all joints move; then run `{again}`."
            )
        }
        ReasonId::UncertaintyTooSmall
        | ReasonId::PredictionUndecided
        | ReasonId::EffectsNotExcluded => {
            format!("Record more poses in which the joints move together, then run `{again}`.")
        }
        _ => format!("Correct it, then run `{again}`."),
    };
    Some([reason.sentence(), remedy])
}

/// The command that runs a profile again.
pub(crate) fn again(profile: &str) -> String {
    format!("calib run {}", shell_path(profile))
}

/// Diagnosis and remedy of a result that was not accepted; `again` is the command that runs the profile.
pub(crate) fn diagnosis_from(report: &Report, again: &str) -> Option<[String; 2]> {
    let diagnosis = report.diagnosis.as_ref()?;
    Some(diagnosis.words(report, again))
}

/// The same from the folder of the profile.
pub(crate) fn diagnosis(report: &Report) -> Option<[String; 2]> {
    diagnosis_from(report, &again(&report.profile))
}

/// The URDF that a run started from, as the profile names it.
pub(crate) fn nominal_urdf(report: &Report) -> Option<&str> {
    let mut outputs = report.outputs.iter();
    outputs.find_map(|output: &Output| output.changes.as_deref())
}

/// The command that shows what an accepted result would change in a URDF, from these places; `None` where nothing is gained by the change.
pub(crate) fn apply(report: &Report, results: &str, urdf: &str) -> Option<String> {
    let accepted = matches!(
        report.verdict,
        Verdict::Accepted | Verdict::AcceptedWithWarnings
    );
    let no_better = ReasonId::NotBetterThanRegistration;
    let held_out = report.verification.held_out.as_ref();
    let alone = held_out.is_none_or(HeldOut::urdf_alone_gains);
    let gains = alone && !report.changes.is_empty() && !report.reason_ids.contains(&no_better);
    let [results, urdf] = [results, urdf].map(shell_path);
    (accepted && gains).then(|| format!("calib apply {results} {urdf} --diff"))
}
