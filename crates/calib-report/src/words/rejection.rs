//! Samples that did not take part in the fit.

use super::prose::{counted, or, short};
use crate::{RecordingSummary, RecordingUse, Rejected, RejectedFor, Report, number};

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

/// Measurements of the fitted recordings that were excluded before the fit: [`rejected_of`] does not count them.
pub(crate) fn excluded_of(report: &Report) -> usize {
    let recordings = report.recordings.iter();
    let fitted = recordings.filter(|r| r.used_for != RecordingUse::Validation);
    fitted.map(|r| r.measurements.excluded).sum()
}

/// `12 measurements of the fitted recordings were excluded before the fit.`
fn excluded(report: &Report) -> Option<String> {
    match excluded_of(report) {
        0 => None,
        1 => Some("1 measurement of the fitted recordings was excluded before the fit.".to_owned()),
        n => Some(format!(
            "{n} measurements of the fitted recordings were excluded before the fit."
        )),
    }
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

/// Markers and bodies whose same rows of a recording took no part for the same cause.
pub(crate) struct Together<'a> {
    /// The recording, the rows and the cause.
    pub(crate) rejected: &'a Rejected,
    /// The markers and bodies; none where whole rows were rejected.
    pub(crate) subjects: Vec<&'a str>,
}

/// What was rejected or excluded, each rows of a recording once for each cause.
pub(crate) fn together(report: &Report) -> Vec<Together<'_>> {
    let mut all: Vec<Together<'_>> = Vec::new();
    for rejected in &report.rejected {
        let subject = Some(rejected.subject.as_str()).filter(|subject| !subject.is_empty());
        let same = |of: &&mut Together<'_>| {
            let [a, b] = [of.rejected, rejected];
            (&a.recording, &a.rows, a.cause, &a.reason)
                == (&b.recording, &b.rows, b.cause, &b.reason)
                && subject.is_some()
                && !of.subjects.is_empty()
        };
        match all.iter_mut().find(same) {
            Some(of) => of.subjects.extend(subject),
            None => all.push(Together {
                rejected,
                subjects: subject.into_iter().collect(),
            }),
        }
    }
    all
}

pub(crate) fn rejected(report: &Report, rest: &str) -> Vec<String> {
    /// Names in a line; of more, the first and how many others.
    const NAMES: usize = 4;
    let line = |of: &Together<'_>| {
        let rejected = of.rejected;
        let subject = match of.subjects.as_slice() {
            [] => String::new(),
            names if names.len() <= NAMES => format!(" {}", names.join(", ")),
            [first, others @ ..] => format!(" {first} and {} others", others.len()),
        };
        let stage = match rejected.cause {
            // The reason says no more than the stage.
            RejectedFor::Unstated => String::new(),
            cause => format!(" {}", cause.stage()),
        };
        format!(
            "{}{subject}: {}{stage}, {}.",
            rejected.recording,
            counted(rejected.rows.len(), "row"),
            rejected.reason
        )
    };
    let lines: Vec<String> = together(report).iter().map(line).collect();
    let mut lines = or(short(&lines, rest), "Nothing.");
    lines.extend(by_chance(report));
    lines.extend(excluded(report));
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Fates;

    fn recording(name: &str, used_for: RecordingUse) -> RecordingSummary {
        RecordingSummary {
            name: name.to_owned(),
            used_for,
            measurements: Fates {
                of: 32,
                used: 20,
                excluded: 12,
                ..Fates::default()
            },
            ..RecordingSummary::default()
        }
    }

    #[test]
    fn markers_with_the_same_rows_are_one_line_and_what_the_fit_did_not_see_is_not_rejected_by_it()
    {
        let of = |recording: &str, marker: &str| {
            Rejected::new(recording, marker, vec![3, 9], RejectedFor::RestlessHold)
        };
        let report = Report {
            recordings: vec![
                recording("fit", RecordingUse::Static),
                recording("check", RecordingUse::Validation),
            ],
            rejected: vec![
                of("check", "P1"),
                of("fit", "P1"),
                of("check", "P2"),
                of("fit", "P2"),
                Rejected::new("fit", "P2", vec![5], RejectedFor::Outlier),
            ],
            ..Report::default()
        };
        assert_eq!(
            rejected(&report, "below"),
            [
                "check P1, P2: 2 rows excluded before the fit, not settled: the hold drifts or scatters.",
                "fit P1, P2: 2 rows excluded before the fit, not settled: the hold drifts or scatters.",
                "fit P2: 1 row rejected by the fit, outlier: residual too large for the noise.",
                "12 measurements of the fitted recordings were excluded before the fit.",
            ]
        );
        assert_eq!(rejected_of(&report), Some([0, 20]));
        assert_eq!(excluded_of(&report), 12);
    }
}
