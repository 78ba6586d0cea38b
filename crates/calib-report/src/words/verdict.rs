//! The verdict and its reasons.

use calib_finding::Fact;

use super::prose::{code, counted, or, sentences, short};
use crate::{Effect, FitEnd, Reason, ReasonId, Report, Verdict, number};

impl Report {
    /// The verdict in a few words: `accepted with 2 warnings`.
    #[must_use]
    pub fn verdict_line(&self) -> String {
        match self.verdict {
            Verdict::AcceptedWithWarnings if self.warnings() > 0 => {
                format!("accepted with {}", counted(self.warnings(), "warning"))
            }
            verdict => verdict.word().to_owned(),
        }
    }
}

pub(crate) fn trust(report: &Report, rest: &str) -> Vec<String> {
    let verdict = match report.verdict {
        Verdict::Accepted => "Yes: accepted. Every rule of the verdict holds.".to_owned(),
        Verdict::AcceptedWithWarnings => {
            format!("Yes, with care: {}.", report.verdict_line())
        }
        Verdict::Rejected => "No: rejected.".to_owned(),
        Verdict::NotEvaluated => "Not decided.".to_owned(),
    };
    let against: Vec<String> = report.objections().cloned().collect();
    // What predictions are expected to be off by has its own place.
    let decides = |i: usize| {
        let reason = report.reason_facts.get(i);
        reason.is_none_or(|reason| reason.id != ReasonId::PredictionExpected)
    };
    let all = report.reasons.iter().enumerate();
    let reasons = if against.is_empty() {
        all.filter(|(i, _)| decides(*i))
            .map(|(_, r)| r.clone())
            .collect()
    } else {
        against
    };
    std::iter::once(verdict)
        .chain(short(&sentences(&reasons), rest))
        .collect()
}

/// The values of a reason, in the words of people.
struct Values<'a>(&'a Reason);

impl Values<'_> {
    fn get(&self, key: &str) -> Option<&Fact> {
        self.0.values.get(key)
    }

    /// A number with its unit.
    fn number(&self, key: &str) -> String {
        match self.get(key) {
            Some(Fact::Number { value, unit }) => number::plain(*value, *unit),
            _ => number::UNKNOWN.to_owned(),
        }
    }

    fn count(&self, key: &str) -> usize {
        self.get(key).and_then(Fact::value).unwrap_or(0.0) as usize
    }

    fn name(&self, key: &str) -> &str {
        self.get(key).and_then(Fact::word).unwrap_or_default()
    }

    /// A name as code.
    fn code(&self, key: &str) -> String {
        code(self.name(key))
    }

    /// `12 of 80 (15 %)`
    fn share(&self, part: &str, of: &str) -> String {
        let (part, of) = (self.count(part), self.count(of));
        let share = number::percent(part as f64 / of.max(1) as f64);
        format!("{part} of {of} ({share})")
    }
}

impl Reason {
    /// The reason as a sentence.
    #[must_use]
    pub fn sentence(&self) -> String {
        let v = Values(self);
        match self.id {
            ReasonId::LimitMet
            | ReasonId::LimitExceeded
            | ReasonId::LimitUndecided
            | ReasonId::LimitNotEvaluated
            | ReasonId::BodyAboveLimit
            | ReasonId::NoLimits => of_limit(self, &v),
            ReasonId::NotConverged
            | ReasonId::OriginNotDetermined
            | ReasonId::GoodnessOfFit
            | ReasonId::NoiseAboveStated
            | ReasonId::NoiseBelowStated
            | ReasonId::NoiseAboveScatter
            | ReasonId::UnresolvedError
            | ReasonId::WarningFinding => of_fit(self, &v),
            ReasonId::RejectedPart | ReasonId::RejectedShare | ReasonId::ScreenedHeldOut => {
                of_rejection(self, &v)
            }
            ReasonId::ImplausibleChange | ReasonId::ReversedAxis => of_change(self, &v),
            ReasonId::PredictionUndecided
            | ReasonId::EffectsNotExcluded
            | ReasonId::HeldOutBeyondStated
            | ReasonId::UncertaintyTooSmall
            | ReasonId::PredictionExpected => of_prediction(self, &v),
            _ => of_validation(self, &v),
        }
    }
}

fn of_limit(reason: &Reason, v: &Values<'_>) -> String {
    if reason.id == ReasonId::NoLimits {
        return "The profile sets no limits (`solve.limits`), so nothing could be accepted."
            .to_owned();
    }
    let (quantity, limit) = (v.name("quantity"), v.number("limit"));
    let interval = match (v.get("low"), v.get("high")) {
        (Some(_), Some(_)) => format!(
            " (95 % interval {} to {})",
            v.number("low"),
            v.number("high")
        ),
        _ => String::new(),
    };
    match reason.id {
        ReasonId::LimitNotEvaluated => {
            format!(
                "{quantity}: not evaluated ({}), limit {limit}.",
                v.name("because")
            )
        }
        ReasonId::LimitUndecided => {
            let enough = match v.count("postures") {
                0 => String::new(),
                n => format!(" About {n} validation postures are needed to decide."),
            };
            let of = |name| v.get(name).and_then(Fact::value);
            let above = |name| {
                of(name)
                    .zip(of("limit"))
                    .is_some_and(|(x, limit)| x > limit)
            };
            let open = if above("low") || (above("value") && of("low").is_none()) {
                "exceeded in leave-one-out prediction, undecided for the full fit"
            } else if above("value") {
                "the estimate is above the limit, but its interval includes the limit"
            } else {
                "the estimate is below the limit, but its interval includes the limit"
            };
            format!(
                "{quantity}: {}{interval}, limit {limit}: {open}.{enough}",
                v.number("value")
            )
        }
        ReasonId::BodyAboveLimit => format!(
            "Of body {} alone, the held-out rms error is {}{interval}, above the limit {limit} that all bodies together do not exceed.",
            v.code("body"),
            v.number("value")
        ),
        ReasonId::LimitExceeded => format!(
            "{quantity}: {}{interval}, limit {limit} (exceeded).",
            v.number("value")
        ),
        _ => format!(
            "{quantity}: {}{interval}, limit {limit} (met).",
            v.number("value")
        ),
    }
}

fn of_fit(reason: &Reason, v: &Values<'_>) -> String {
    match reason.id {
        ReasonId::NotConverged => format!(
            "The solver did not converge: it {}.",
            FitEnd::of_id(v.name("ended")).after(v.count("iterations"))
        ),
        ReasonId::OriginNotDetermined => {
            format!(
                "Origin {} is not observable in its sweep.",
                v.code("origin")
            )
        }
        ReasonId::GoodnessOfFit => {
            let what = match reason.effect {
                Effect::Warns => "the residuals are smaller than the noise that is assumed",
                _ => {
                    "the residuals are larger than the noise explains, and the stated uncertainty does not include the excess"
                }
            };
            format!(
                "χ²/dof {} is outside {} to {}: {what}.",
                v.number("value"),
                v.number("low"),
                v.number("high")
            )
        }
        ReasonId::NoiseAboveStated if v.get("rigid").is_some() => format!(
            "The estimated noise of {} is {} times the stated noise, and the markers scatter {} times as much about their own bodies: the stated noise is too small. The reported uncertainty uses the estimated noise.",
            v.name("group"),
            v.number("factor"),
            v.number("rigid")
        ),
        ReasonId::NoiseBelowStated => format!(
            "The estimated noise of {} is {} times the stated noise: the stated noise is too large. The reported uncertainty uses the estimated noise; the checks of the data that use the stated noise see less than they could.",
            v.name("group"),
            v.number("factor")
        ),
        ReasonId::NoiseAboveStated if v.get("samples").is_some() => format!(
            "The estimated noise of {} is {} times the stated noise, from {} samples only: the model is incomplete, or a reading is wrong. The reported uncertainty includes the excess.",
            v.name("group"),
            v.number("factor"),
            v.count("samples")
        ),
        ReasonId::NoiseAboveStated => format!(
            "The estimated noise of {} is {} times the stated noise: the model is incomplete. The reported uncertainty includes the excess.",
            v.name("group"),
            v.number("factor")
        ),
        ReasonId::NoiseAboveScatter => format!(
            "The estimated noise of {} is {} times the scatter of the markers about their own bodies: the model is incomplete, or a reading is wrong. The reported uncertainty includes the excess.",
            v.name("group"),
            v.number("factor")
        ),
        ReasonId::UnresolvedError => format!(
            "An error of the data or the model is not resolved: {}.",
            finding(v)
        ),
        _ => format!("The data or the model have a warning: {}.", finding(v)),
    }
}

/// "`body-slip` (2 findings)"
fn finding(v: &Values<'_>) -> String {
    match v.count("times") {
        0 | 1 => v.code("finding"),
        n => format!("{} ({})", v.code("finding"), counted(n, "finding")),
    }
}

fn of_rejection(reason: &Reason, v: &Values<'_>) -> String {
    match reason.id {
        ReasonId::RejectedPart => {
            let what = if v.get("joint").is_some() {
                format!(
                    "of the measurements with {} from {} to {}",
                    v.code("joint"),
                    v.number("from"),
                    v.number("to")
                )
            } else if let Some(Fact::Names(subjects)) = v.get("subjects") {
                let subjects: Vec<String> = subjects.iter().map(|name| code(name)).collect();
                format!(
                    "of the measurements of {} in recording {}",
                    subjects.join(", "),
                    v.code("recording")
                )
            } else if v.get("subject").is_some() {
                format!(
                    "of the measurements of {} in recording {}",
                    v.code("subject"),
                    v.code("recording")
                )
            } else {
                format!("of the measurements of recording {}", v.code("recording"))
            };
            let share = v.share("rejected", "of");
            format!(
                "{share} {what} were excluded before the fit or rejected by it: the model does not fit this part of the data."
            )
        }
        ReasonId::RejectedShare => format!(
            "{} measurements of the fitted recordings were excluded before the fit or rejected by it.",
            v.share("rejected", "of")
        ),
        _ => format!(
            "{} held-out measurements were screened out as gross outliers.",
            v.share("screened", "of")
        ),
    }
}

fn of_change(reason: &Reason, v: &Values<'_>) -> String {
    let more = match v.count("more") {
        0 => String::new(),
        n => format!(" (and {n} more)"),
    };
    let what = match reason.id {
        ReasonId::ReversedAxis => format!(
            "The axis of {}{more} was rotated by {}: its sign in the URDF or in the recordings is wrong.",
            v.code("name"),
            v.number("change")
        ),
        _ => format!(
            "{} changed by {}, {} standard deviations of its prior{more}: compare the value with the mechanical drawing.",
            v.code("name"),
            v.number("change"),
            v.number("sigmas")
        ),
    };
    match reason.effect {
        Effect::Warns => format!("{what} Held-out poses confirm it."),
        _ => format!("{what} No held-out poses in which the joints move together confirm it."),
    }
}

/// What the model does not have, in words: "a gain of `elbow`".
fn effect(v: &Values<'_>) -> String {
    let (of, other) = (v.code("of"), v.code("other"));
    match v.name("effect") {
        "gain" => format!("a gain of {of}"),
        "eccentricity" => format!("an eccentricity of {of}"),
        "compliance" => format!("compliance of {of} under gravity"),
        "coupling" => format!("a share of the motion of {other} in that of {of}"),
        "step" => format!("a step of the zero of {of} during recording"),
        "drift" => format!("a drift of {of}"),
        "bump" => format!("a displacement of {of} during recording"),
        _ => format!("a slip of {of} during recording"),
    }
}

fn of_prediction(reason: &Reason, v: &Values<'_>) -> String {
    match reason.id {
        ReasonId::PredictionUndecided => format!(
            "Over the recorded joint ranges, the position error that the data cannot exclude is {} rms (99 % upper limit {}), limit {}. Record more poses in which the joints move together.",
            v.number("expected"),
            v.number("upper"),
            v.number("limit")
        ),
        ReasonId::EffectsNotExcluded => format!(
            "The data do not exclude {}, with an error of {} rms over the recorded joint ranges (99 % upper limit {}), limit {}. Record more poses in which the joints move together.",
            effect(v),
            v.number("expected"),
            v.number("upper"),
            v.number("limit")
        ),
        ReasonId::HeldOutBeyondStated => {
            let [value, high] = ["value", "high"].map(|key| v.number(key));
            let because = match v.name("cause") {
                "" => "something changed before the validation, the model lacks an effect, or the stated uncertainty is too small".to_owned(),
                cause => format!(
                    "because of what `{cause}` names, or because the stated uncertainty is too small"
                ),
            };
            format!("χ²/dof of the held-out errors is {value}, above {high}: {because}.")
        }
        ReasonId::UncertaintyTooSmall => format!(
            "The fit states {} rms over the recorded joint ranges, and the data do not exclude {} with {} rms. Record more poses in which the joints move together.",
            v.number("stated"),
            effect(v),
            v.number("expected")
        ),
        _ => {
            let with = match v.get("effect") {
                Some(_) => format!(", {} included, which the data do not exclude", effect(v)),
                None => String::new(),
            };
            format!(
                "Over the recorded joint ranges, the error of a predicted position is expected to be {} rms (99 % upper limit {}){with}; the fit alone states {}.",
                v.number("expected"),
                v.number("upper"),
                v.number("stated")
            )
        }
    }
}

fn body_not_verified(v: &Values<'_>) -> String {
    let body = code(v.name("body"));
    match v.get("joints") {
        Some(Fact::Names(joints)) => {
            let joints: Vec<String> = joints.iter().map(|joint| code(joint)).collect();
            format!(
                "No held-out pose shows {body}: neither its mount nor the calibration of {} is verified.",
                joints.join(", ")
            )
        }
        _ => format!("No held-out pose shows {body}: its mount is not verified."),
    }
}

fn of_validation(reason: &Reason, v: &Values<'_>) -> String {
    let postures = || counted(v.count("postures"), "posture");
    match reason.id {
        ReasonId::WorseThanRegistration => format!(
            "Calibrated {} rms, with registration only {} rms ({}): the calibration made it worse.",
            v.number("calibrated"),
            v.number("registration"),
            postures()
        ),
        ReasonId::NotBetterThanRegistration => format!(
            "Calibrated {} rms, with registration only {} rms ({}, p = {}): no significant improvement.",
            v.number("calibrated"),
            v.number("registration"),
            postures(),
            v.number("p")
        ),
        ReasonId::TooFewToCompare => format!(
            "Calibrated {} rms, with registration only {} rms: {} too few to tell whether that is an improvement. Five that all are better would show it.",
            v.number("calibrated"),
            v.number("registration"),
            match v.count("postures") {
                1 => "1 posture is".to_owned(),
                _ => format!("{} are", postures()),
            }
        ),
        ReasonId::UrdfAlone => {
            let error = format!(
                "The URDF alone, without the joint effects that it cannot hold: {} rms; with them {} rms",
                v.number("rms"),
                v.number("with_effects")
            );
            let error = match v.get("refitted") {
                Some(_) => format!(
                    "{error}; the URDF that was fitted to be used without them {} rms",
                    v.number("refitted")
                ),
                None => error,
            };
            match (reason.effect, v.get("limit")) {
                (Effect::Warns, Some(_)) => format!(
                    "{error} (limit {}): use it only with the effects.",
                    v.number("limit")
                ),
                (Effect::Warns, None) => format!("{error}: use it only with the effects."),
                _ => format!("{error}."),
            }
        }
        ReasonId::NoValidation => "Nothing was verified on poses that were not fitted.".to_owned(),
        ReasonId::ValidationRepeatsFit => format!(
            "{} held-out postures repeat fitted ones: they do not test the model.",
            v.share("repeated", "postures")
        ),
        ReasonId::LeaveOneOut => format!(
            "No recording is held out: each of {} was predicted from the others, which is not independent of them.",
            postures()
        ),
        ReasonId::OrientationOff => format!(
            "Orientation error: {} rms, {} accepted without a limit in the profile (`held_out_rms_deg`).",
            v.number("rms"),
            v.number("accepted")
        ),
        ReasonId::OrientationNotMeasured => {
            "The orientation of the last body was not measured: only positions were verified."
                .to_owned()
        }
        ReasonId::SingleJointData => {
            let data = match v.name("data") {
                "fitted" => "the fitted recordings",
                "held_out" => "the held-out poses",
                _ => "all recordings",
            };
            match reason.effect {
                Effect::LeavesOpen => format!(
                    "One joint at a time moved in {data}, and physics is missing from the model or something changed during recording: the effect on poses in which several joints move is unknown."
                ),
                _ => format!(
                    "One joint at a time moved in {data}: poses in which several joints move were not tested."
                ),
            }
        }
        ReasonId::BodyNotVerified => body_not_verified(v),
        ReasonId::JointsNotVerified => {
            let joints = match v.get("joints") {
                Some(Fact::Names(names)) => names.clone(),
                _ => Vec::new(),
            };
            format!(
                "The held-out poses hardly move {}: their calibration is not verified.",
                or(joints.iter().map(|j| code(j)).collect(), "a joint").join(", ")
            )
        }
        _ => format!(
            "Reason {} of another version of the program.",
            code(reason.id.as_str())
        ),
    }
}
