//! Samples that did not take part in the fit.

use super::prose::{counted, or, short};
use crate::{RecordingSummary, RecordingUse, Rejected, Report, number};

/// Share of good measurements that the fit's gate rejects by chance.
const BY_CHANCE: f64 = 0.001;

/// Rejected measurements of the fit, and all of them; `None` where nothing was counted.
pub(crate) fn rejected_of(report: &Report) -> Option<[usize; 2]> {
    let fitted = |r: &&RecordingSummary| r.used_for != RecordingUse::Validation;
    let counts = || report.recordings.iter().filter(fitted);
    let rejected: usize = counts().map(|r| r.measurements.rejected).sum();
    let tested: usize = counts().map(|r| r.measurements.used).sum::<usize>() + rejected;
    (tested > 0).then_some([rejected, tested])
}

/// How many measurements of the fit the gate rejected, and how many it rejects by chance alone.
fn by_chance(report: &Report) -> Option<String> {
    let [rejected, tested] = rejected_of(report)?;
    (rejected > 0).then(|| {
        format!(
            "{rejected} of {tested} fitted measurements were rejected; about {} would be rejected by chance alone.",
            number::fixed(BY_CHANCE * tested as f64, 1)
        )
    })
}

pub(crate) fn rejected(report: &Report, rest: &str) -> Vec<String> {
    let line = |rejected: &Rejected| {
        let subject = if rejected.subject.is_empty() {
            String::new()
        } else {
            format!(" {}", rejected.subject)
        };
        format!(
            "{}{subject}: {}, {}.",
            rejected.recording,
            counted(rejected.rows.len(), "row"),
            rejected.reason
        )
    };
    let lines: Vec<String> = report.rejected.iter().map(line).collect();
    let mut lines = or(short(&lines, rest), "Nothing.");
    lines.extend(by_chance(report));
    let recordings = report.recordings.iter();
    let lost: usize = recordings.flat_map(|r| &r.lost).map(|lost| lost.lost).sum();
    match lost {
        0 => {}
        1 => lines.push("1 sample was lost by the tracker.".to_owned()),
        n => lines.push(format!("{n} samples were lost by the tracker.")),
    }
    lines
}

/// Beside errors of the fit: whether they are those of all observations.
pub(crate) fn not_counted(rejected: usize) -> String {
    match rejected {
        0 => "No observation was rejected.".to_owned(),
        1 => "1 rejected observation is not counted in the errors.".to_owned(),
        n => format!("{n} rejected observations are not counted in the errors."),
    }
}
