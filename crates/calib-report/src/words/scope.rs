//! What a result is valid for.

use super::prose::{code, counted, sentence};
use crate::{Report, Scope, Verdict};

/// What the result may be used for, a sentence each: nothing, unless it was accepted.
pub(crate) fn valid_for(report: &Report) -> Vec<String> {
    let only = match report.verdict {
        Verdict::Rejected => "Nothing: the result is rejected.",
        Verdict::NotEvaluated => "Nothing yet: the evidence does not suffice for a verdict.",
        Verdict::Accepted | Verdict::AcceptedWithWarnings if report.scope.is_empty() => {
            "Only for poses similar to those that were recorded: the profile states no scope."
        }
        Verdict::Accepted | Verdict::AcceptedWithWarnings => {
            return report.scope.iter().map(|item| sentence(item)).collect();
        }
    };
    vec![only.to_owned()]
}

/// What an accepted result must not be used for, in one sentence without its heading.
pub(crate) fn not_for(report: &Report) -> Option<String> {
    let accepted = matches!(
        report.verdict,
        Verdict::Accepted | Verdict::AcceptedWithWarnings
    );
    (accepted && !report.not_for.is_empty()).then(|| format!("{}.", report.not_for.join("; ")))
}

/// The same with its heading, as a list shows it.
pub(crate) fn not_for_line(report: &Report) -> Option<String> {
    not_for(report).map(|excluded| format!("Not for: {excluded}"))
}

impl Scope {
    /// The condition as a sentence.
    #[must_use]
    pub fn sentence(&self) -> String {
        match self {
            Self::TrackedBodies { frame } => format!(
                "Positions of the tracked bodies in the tracker frame `{frame}`, within the joint ranges of the fit and at the recorded load."
            ),
            Self::Contacts => {
                "The recorded contacts, within the joint ranges of the fit and at the recorded load."
                    .to_owned()
            }
            Self::SingleJointMotions => {
                "Motions of one joint at a time from the recorded postures: no recording moves several joints."
                    .to_owned()
            }
            Self::PositionsOnly => {
                "Positions only: the orientation of the last body was not measured.".to_owned()
            }
            Self::HeldOutPoses {
                postures,
                outside,
                still,
            } => {
                let range = match outside {
                    0 => "all within these ranges".to_owned(),
                    n => format!("{n} of them beyond these ranges"),
                };
                let joints: Vec<String> = still.iter().map(|joint| code(joint)).collect();
                let still = if joints.is_empty() {
                    String::new()
                } else {
                    format!("; they hardly move {}", joints.join(", "))
                };
                format!(
                    "Verified on {}, {range}{still}.",
                    counted(*postures, "held-out posture")
                )
            }
            Self::LeftOutPoses { postures } => format!(
                "Verified by leaving out each of {} of the fit in turn: valid for similar poses recorded on the same day.",
                counted(*postures, "posture")
            ),
            Self::EffectsOf { file, alone } => {
                let without = alone.as_ref().map_or_else(String::new, |urdf| {
                    format!(" Without them, use `{urdf}`.")
                });
                format!(
                    "Together with the joint effects in `{file}`, which a URDF cannot represent.{without}"
                )
            }
            Self::OriginsOneByOne => {
                "Origins were estimated one at a time (`method: paper`); the link geometry is that of the nominal URDF."
                    .to_owned()
            }
        }
    }

    /// What the condition excludes, as a phrase.
    #[must_use]
    pub fn excluded(&self) -> Option<String> {
        let excluded = match self {
            Self::TrackedBodies { .. } | Self::Contacts => {
                "joint ranges and loads that were not recorded".to_owned()
            }
            Self::SingleJointMotions => "poses in which several joints move".to_owned(),
            Self::PositionsOnly => "orientations".to_owned(),
            Self::HeldOutPoses { still, .. } if !still.is_empty() => {
                let joints: Vec<String> = still.iter().map(|joint| code(joint)).collect();
                format!("motions of {}", joints.join(", "))
            }
            Self::LeftOutPoses { .. } => "poses of another day".to_owned(),
            Self::EffectsOf { file, .. } => format!("the calibrated URDF without `{file}`"),
            Self::HeldOutPoses { .. } | Self::OriginsOneByOne => return None,
        };
        Some(excluded)
    }
}
