//! Errors on poses that were not fitted.

use crate::{HeldOut, Report, Unit, number};

/// Joints of the worst pose in an answer: an arm and a torso.
const JOINTS: usize = 14;

pub(crate) fn expected_error(report: &Report) -> Vec<String> {
    let Some(held_out) = &report.verification.held_out else {
        let reason = &report.verification.reason;
        return vec![if reason.is_empty() {
            "Not known: no pose was held out.".to_owned()
        } else {
            format!("Not known: {reason}")
        }];
    };
    let mut lines = Vec::new();
    let length = |m| number::plain(m, Unit::Metre);
    let over = held_out_of(held_out);
    match (&held_out.expected, &held_out.calibrated) {
        (Some(expected), _) => lines.push(format!(
            "{} rms ({} interval {} to {}): {over}.",
            length(expected.rms_m),
            number::percent(expected.confidence),
            length(expected.low_m),
            length(expected.high_m),
        )),
        (None, Some(calibrated)) => lines.push(format!(
            "{} rms: {over}; too few for an interval.",
            length(calibrated.rms_m),
        )),
        (None, None) => lines.push("Not known: no held-out pose could be predicted.".to_owned()),
    }
    if let Some(angle) = held_out.orientation.and_then(|o| o.calibrated) {
        lines.push(format!(
            "{} rms in orientation.",
            number::plain(angle.rms_rad, Unit::Radian)
        ));
    }
    if let Some(registration) = &held_out.registration_only {
        lines.push(format!(
            "Without calibration, registered only: {} rms.",
            length(registration.rms_m)
        ));
    }
    lines
}

/// "position of the tracked bodies, 298 errors in 150 held-out postures"
pub(crate) fn held_out_of(held_out: &HeldOut) -> String {
    let plural = |n: usize, one: &str| {
        let s = if n == 1 { "" } else { "s" };
        format!("{n} {one}{s}")
    };
    let quantity = if held_out.quantity.is_empty() {
        String::new()
    } else {
        format!("{}, ", held_out.quantity)
    };
    let n = if held_out.postures > 0 && held_out.postures != held_out.n {
        format!(
            "{} in {}",
            plural(held_out.n, "error"),
            plural(held_out.postures, "held-out posture")
        )
    } else {
        plural(held_out.n, "held-out posture")
    };
    quantity + &n
}

pub(crate) fn worst_pose(report: &Report, rest: &str) -> Vec<String> {
    let worst = report
        .verification
        .held_out
        .as_ref()
        .and_then(|held_out| held_out.worst.as_ref());
    let Some(worst) = worst else {
        return vec!["Not known: no pose was held out.".to_owned()];
    };
    let joints: Vec<String> = worst
        .joints
        .iter()
        .take(JOINTS)
        .map(|joint| format!("{} {}", joint.joint, number::plain(joint.value, joint.unit)))
        .collect();
    let error = number::plain_or_unknown(worst.calibrated_m, Unit::Metre);
    let group = if worst.group.is_empty() {
        String::new()
    } else {
        format!(" ({})", worst.group)
    };
    let angle = worst.calibrated_rad.map_or_else(String::new, |angle| {
        format!(" and {}", number::plain(angle, Unit::Radian))
    });
    let mut lines = vec![format!("{}{group}: {error}{angle}.", worst.label())];
    if !joints.is_empty() {
        let more = match worst.joints.len() - joints.len() {
            0 => ".".to_owned(),
            n => format!(", and {n} more joints {rest}."),
        };
        lines.push(joints.join(", ") + &more);
    }
    lines
}
