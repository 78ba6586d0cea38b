//! Errors on poses that were not fitted.

use super::prose::{capital, counted, full_stop};
use crate::{ExpectedError, HeldOut, JointValue, PoseError, Report, Unit, number};

/// Joints of the worst pose in an answer: an arm and a torso.
const JOINTS: usize = 14;

/// Why there is no held-out error.
pub(crate) fn missing(report: &Report) -> String {
    match report.verification.reason.as_str() {
        "" => "Not evaluated: no poses were held out.".to_owned(),
        reason => format!("Not evaluated: {}", full_stop(reason)),
    }
}

/// `0.51 mm rms (95 % interval 0.42 mm to 0.63 mm)`
fn rms(expected: &ExpectedError) -> String {
    let length = |m| number::plain(m, Unit::Meter);
    format!(
        "{} rms ({} interval {} to {})",
        length(expected.rms_m),
        number::percent(expected.confidence),
        length(expected.low_m),
        length(expected.high_m),
    )
}

/// `; the tracker's noise is 0.5 mm of it, 0.1 mm remain without`
fn tracker(expected: &ExpectedError) -> String {
    let length = |m| number::plain(m, Unit::Meter);
    match (expected.tracker_m, expected.without_tracker()) {
        (Some(tracker), Some(without)) => format!(
            "; the noise of one tracker measurement, {}, is included: {} without it",
            length(tracker),
            length(without)
        ),
        _ => String::new(),
    }
}

/// What a screening left out, and the error with it.
fn screened(held_out: &HeldOut) -> Option<String> {
    let with = held_out.with_screened.as_ref()?;
    let why = if held_out.left_out {
        "were rejected by the fit"
    } else {
        "were screened out as gross outliers"
    };
    Some(format!(
        "{} of {} {why}; counted, the error is {} rms, {} maximum.",
        held_out.screened,
        counted(held_out.n + held_out.screened, "error"),
        number::plain(with.rms_m, Unit::Meter),
        number::plain(with.max_m, Unit::Meter)
    ))
}

/// Above the table of a terminal: `Held-out errors [mm], 20 values`.
pub(crate) fn heading(held_out: &HeldOut) -> String {
    let which = if held_out.left_out {
        "Leave-one-out errors"
    } else {
        "Held-out errors"
    };
    format!("{which} [mm], {} values", held_out.n)
}

/// Below that table.
pub(crate) fn expected_lines(held_out: &HeldOut) -> Vec<String> {
    let expected = held_out.expected.iter();
    expected
        .map(|e| format!("Expected on a new pose: {}{}.", rms(e), tracker(e)))
        .chain(screened(held_out))
        .collect()
}

pub(crate) fn expected_error(report: &Report) -> Vec<String> {
    let Some(held_out) = &report.verification.held_out else {
        return vec![missing(report)];
    };
    let mut lines = Vec::new();
    let length = |m| number::plain(m, Unit::Meter);
    let basis = basis(held_out);
    match (&held_out.expected, &held_out.calibrated) {
        (Some(expected), _) => {
            lines.push(format!("{}: {basis}{}.", rms(expected), tracker(expected)));
        }
        (None, Some(calibrated)) => lines.push(format!(
            "{} rms: {basis}, too few for an interval.",
            length(calibrated.rms_m),
        )),
        (None, None) => {
            lines.push("Not evaluated: no held-out pose could be predicted.".to_owned())
        }
    }
    if let Some(angle) = held_out.orientation.and_then(|o| o.calibrated) {
        lines.push(format!(
            "Orientation error: {} rms.",
            number::plain(angle.rms_rad, Unit::Radian)
        ));
    }
    if let Some(registration) = &held_out.registration_only {
        lines.push(format!(
            "With registration only, without calibration: {} rms.",
            length(registration.rms_m)
        ));
    }
    lines.extend(screened(held_out));
    lines
}

/// `position of the tracked bodies, 298 errors in 150 held-out poses`
fn basis(held_out: &HeldOut) -> String {
    let quantity = if held_out.quantity.is_empty() {
        String::new()
    } else {
        format!("{}, ", held_out.quantity)
    };
    let poses = if held_out.left_out {
        "left-out pose"
    } else {
        "held-out pose"
    };
    let n = if held_out.postures > 0 && held_out.postures != held_out.n {
        format!(
            "{} in {}",
            counted(held_out.n, "error"),
            counted(held_out.postures, poses)
        )
    } else {
        counted(held_out.n, poses)
    };
    quantity + &n
}

/// What the table of held-out errors shows.
pub(crate) fn table_intro(held_out: &HeldOut) -> String {
    format!(
        "{}; predicted minus measured, in mm.",
        capital(&basis(held_out))
    )
}

/// Above the table of the poses with the largest errors.
pub(crate) fn worst_poses(shown: usize, all: usize) -> String {
    if all > shown {
        format!("The {shown} largest of {all} errors, mm (orientation: calibrated):")
    } else {
        "All errors, largest first, mm (orientation: calibrated):".to_owned()
    }
}

pub(crate) fn worst_pose(report: &Report, rest: &str) -> Vec<String> {
    let held_out = report.verification.held_out.as_ref();
    let Some(worst) = held_out.and_then(|held_out| held_out.worst.as_ref()) else {
        return vec!["Not evaluated: no poses were held out.".to_owned()];
    };
    let group = if worst.group.is_empty() {
        String::new()
    } else {
        format!(" ({})", worst.group)
    };
    let mut lines = vec![format!("{}{group}: {}.", worst.label(), errors(worst))];
    if !worst.joints.is_empty() {
        let shown = &worst.joints[..worst.joints.len().min(JOINTS)];
        let more = match worst.joints.len() - shown.len() {
            0 => ".".to_owned(),
            n => format!(", and {n} more joints {rest}."),
        };
        lines.push(joints(shown) + &more);
    }
    lines
}

/// `0.31 mm and 0.2°`
fn errors(pose: &PoseError) -> String {
    let length = number::plain_or_unknown(pose.calibrated_m, Unit::Meter);
    let angle = pose.calibrated_rad.map_or_else(String::new, |angle| {
        format!(" and {}", number::plain(angle, Unit::Radian))
    });
    length + &angle
}

/// `elbow 12°, slide 3 mm`
pub(crate) fn joints(joints: &[JointValue]) -> String {
    let position =
        |joint: &JointValue| format!("{} {}", joint.joint, number::plain(joint.value, joint.unit));
    joints.iter().map(position).collect::<Vec<_>>().join(", ")
}

impl HeldOut {
    /// What is measured where bodies are tracked, things are touched, or both.
    #[must_use]
    pub fn quantity_of(bodies: bool, touches: bool) -> &'static str {
        match (bodies, touches) {
            (false, _) => "contact residual",
            (true, true) => "position of the tracked bodies, and contact residual",
            (true, false) => "position of the tracked bodies",
        }
    }

    /// The errors of one pose, by body, for the 3-D view: `errors: gripM 0.31 mm and 0.2°; linkM 0.42 mm`. Empty
    /// where the pose has none.
    #[must_use]
    pub fn errors_of(&self, pose: &str) -> String {
        let of_pose = self.poses.iter().filter(|error| error.pose == pose);
        let parts: Vec<String> = of_pose
            .map(|error| format!("{} {}", error.subject, errors(error)))
            .collect();
        if parts.is_empty() {
            String::new()
        } else {
            format!("errors: {}", parts.join("; "))
        }
    }
}
