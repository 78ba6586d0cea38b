//! Why a result was not accepted, and the command that comes next.

use super::prose::code;
use crate::{Diagnosis, Output, Report, Unit, Verdict, number};

/// Multiples of the tracker's noise that a limit of the rms error should leave room for.
const ROOM: f64 = 1.5;

impl Diagnosis {
    /// The diagnosis and the remedy, a sentence each; `again` is the command that runs the profile.
    pub(crate) fn words(&self, again: &str) -> [String; 2] {
        match self {
            Self::LimitBelowNoise {
                limit_name,
                limit_m,
                tracker_m,
            } => {
                let [limit, tracker] = [limit_m, tracker_m].map(|m| number::plain(*m, Unit::Meter));
                let enough = (ROOM * tracker_m * 1e4).ceil() / 10.0;
                [
                    format!(
                        "The limit of {limit} is below the noise of one tracker measurement, {tracker}: no robot can meet it."
                    ),
                    format!(
                        "Set `solve.limits.{limit_name}` to {enough} or more, or average several frames per pose; then run `{again}`."
                    ),
                ]
            }
            Self::StructuralFault { evidence } => [
                format!(
                    "The data or the model have an error that more poses do not remove ({}).",
                    code(evidence)
                ),
                format!("Correct it, then run `{again}`."),
            ],
            Self::MissingEffect { parameter } => [
                format!(
                    "The residuals show an effect that the model lacks: {}.",
                    code(parameter)
                ),
                format!("Let `{again} --select` choose the effects to free."),
            ],
            Self::TooFewPoses { postures } => [
                "The poses do not decide it.".to_owned(),
                match postures {
                    Some(n) => format!(
                        "Record about {n} validation postures in which all joints move, then run `{again}`."
                    ),
                    None => format!(
                        "Record more poses in which all joints move, some of them as validation, then run `{again}`."
                    ),
                },
            ],
            Self::NoLimits => [
                "The profile sets no limits, so nothing could be accepted.".to_owned(),
                format!("Set `solve.limits.held_out_rms_mm`, then run `{again}`."),
            ],
            Self::Unexplained => [
                "The error is larger than the limit, and no known effect explains it.".to_owned(),
                format!("Let `{again} --select` try the effects that the model lacks."),
            ],
        }
    }
}

/// The command that runs a profile again.
pub(crate) fn again(profile: &str) -> String {
    format!("calib run {profile}")
}

/// Diagnosis and remedy of a result that was not accepted; `again` is the command that runs the profile.
pub(crate) fn diagnosis_from(report: &Report, again: &str) -> Option<[String; 2]> {
    let diagnosis = report.diagnosis.as_ref()?;
    Some(diagnosis.words(again))
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

/// The command that shows what an accepted result would change in a URDF, from these places.
pub(crate) fn apply(report: &Report, results: &str, urdf: &str) -> Option<String> {
    let accepted = matches!(
        report.verdict,
        Verdict::Accepted | Verdict::AcceptedWithWarnings
    );
    accepted.then(|| format!("calib apply {results} {urdf} --diff"))
}
