//! The one large number of the first screen, and what it is made of.

use super::prose::counted;
use crate::{ErrorSource, Limit, PoseError, Report, Unit, number};

/// Position error on new poses, in words.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct Headline {
    /// What the number is.
    pub(crate) quantity: &'static str,
    /// `0.611 mm rms`.
    pub(crate) value: String,
    /// `95 % interval 0.542 mm to 0.700 mm`; empty where there is none.
    pub(crate) interval: String,
    /// `limit 1.50 mm`; empty where the profile sets none.
    pub(crate) limit: String,
    /// What the parts are: of the number, or of a larger one.
    pub(crate) made_of: &'static str,
    /// `tracker 0.52 mm`, largest first.
    pub(crate) parts: Vec<String>,
    /// `the robot itself: about 0.316 mm`; empty where the tracker's noise is not known.
    pub(crate) robot: String,
    /// Orientation, largest error, URDF alone.
    pub(crate) more: Vec<String>,
}

/// The key of the limit that the number is compared with.
const LIMIT: &str = "held_out_rms_mm";

/// The limit of the rms position error.
pub(crate) fn limit(report: &Report) -> Option<&Limit> {
    report.limits.iter().find(|limit| limit.name == LIMIT)
}

fn length(m: f64) -> String {
    number::plain(m, Unit::Meter)
}

/// The headline of a report.
pub(crate) fn headline(report: &Report) -> Headline {
    let none = Headline {
        quantity: "Position error on new poses",
        value: "not verified".to_owned(),
        limit: limit(report).map_or_else(String::new, |l| format!("limit {}", length(l.limit))),
        ..Headline::default()
    };
    let Some(held_out) = &report.verification.held_out else {
        return none;
    };
    let rms = held_out.expected.map(|e| e.rms_m);
    let Some(rms) = rms.or(held_out.calibrated.map(|c| c.rms_m)) else {
        return none;
    };
    let interval = held_out.expected.map_or_else(
        || format!("{}, too few for an interval", counted(held_out.n, "error")),
        |e| {
            let percent = number::percent(e.confidence);
            format!(
                "{percent} interval {} to {}",
                length(e.low_m),
                length(e.high_m)
            )
        },
    );
    // Held-out errors that are by chance no larger than the tracker's noise do not make the robot better than the fit says.
    let stated: f64 = known(report)
        .filter(|(kind, _)| *kind != ErrorSource::TrackerNoise)
        .map(|(_, m)| m * m)
        .sum();
    let robot = held_out.expected.and_then(|e| e.without_tracker());
    let robot = robot.map(|robot| robot.max(stated.sqrt()));
    Headline {
        quantity: if held_out.left_out {
            "Position error, leave-one-out"
        } else {
            none.quantity
        },
        value: format!("{} rms", length(rms)),
        interval,
        made_of: made_of(report, rms),
        parts: parts(report),
        robot: robot.map_or_else(String::new, |m| {
            format!("the robot itself: about {}", length(m))
        }),
        more: more(report),
        ..none
    }
}

impl ErrorSource {
    /// The source in a word or two.
    pub(crate) fn short(self) -> &'static str {
        match self {
            Self::TrackerNoise => "tracker",
            Self::JointNoise => "joint repeatability",
            Self::Parameters => "geometry",
            Self::NotModeled => "unexplained",
        }
    }
}

/// The known parts of the error, m.
fn known(report: &Report) -> impl Iterator<Item = (ErrorSource, f64)> {
    let of = report.accuracy_limits.iter();
    of.filter_map(|part| Some((part.kind, part.sigma_m.filter(|m| *m > 0.0)?)))
}

fn parts(report: &Report) -> Vec<String> {
    known(report)
        .map(|(kind, m)| format!("{} {}", kind.short(), length(m)))
        .collect()
}

/// The parts are stated by the fit. Where they exceed the measured error, they are not parts of it.
fn made_of(report: &Report, rms: f64) -> &'static str {
    /// Standard deviations and errors of few poses differ by this much.
    const MORE: f64 = 1.2;
    let all: f64 = known(report).map(|(_, m)| m * m).sum();
    if all.sqrt() > MORE * rms {
        "The fit expects more"
    } else {
        "Of this"
    }
}

/// `checks:12 linkM_3`, and its error.
pub(crate) fn largest(worst: &PoseError) -> Option<String> {
    let error = length(worst.calibrated_m?);
    Some(format!("Largest error: {error} ({})", worst.label()))
}

fn more(report: &Report) -> Vec<String> {
    let Some(held_out) = &report.verification.held_out else {
        return Vec::new();
    };
    let angle = held_out.orientation.and_then(|o| o.calibrated);
    let limit = report.limits.iter().find(|l| l.name == "held_out_rms_deg");
    let angle = angle.map(|angle| {
        let rms = number::plain(angle.rms_rad, Unit::Radian);
        let limit = limit.map_or_else(String::new, |l| {
            format!(" (limit {})", number::plain(l.limit, Unit::Radian))
        });
        format!("Orientation: {rms} rms{limit}")
    });
    let alone = held_out.urdf_alone.map(|alone| {
        format!(
            "URDF alone, without joint effects: {} rms",
            length(alone.rms_m)
        )
    });
    let worst = held_out.worst.as_ref().and_then(largest);
    angle.into_iter().chain(worst).chain(alone).collect()
}

/// Nominal, after registration only, calibrated: names and rms errors in m.
pub(crate) fn steps(report: &Report) -> Vec<(&'static str, f64)> {
    let Some(held_out) = &report.verification.held_out else {
        return Vec::new();
    };
    [
        ("nominal", held_out.nominal),
        ("registration only", held_out.registration_only),
        ("calibrated", held_out.calibrated),
    ]
    .into_iter()
    .filter_map(|(name, stats)| Some((name, stats?.rms_m)))
    .filter(|(_, rms)| rms.is_finite())
    .collect()
}

/// `s/n 48 · measured 2026-11-03 by A. Smith · Qualisys, 4 cameras`; empty where the profile states nothing.
pub(crate) fn identification(report: &Report) -> String {
    let of = &report.identification;
    let measured = match (&of.date, &of.operator) {
        (Some(date), Some(who)) => Some(format!("measured {date} by {who}")),
        (Some(date), None) => Some(format!("measured {date}")),
        (None, Some(who)) => Some(format!("measured by {who}")),
        (None, None) => None,
    };
    let serial = of.serial_number.as_ref().map(|n| format!("s/n {n}"));
    let parts: Vec<String> = [serial, measured, of.tracker.clone()]
        .into_iter()
        .flatten()
        .collect();
    parts.join(" · ")
}
