//! The quantities of one robot over its calibrations: what no choice of frames changes, and effects of joints.
//!
//! Values are those of the data alone, so that a prior does not hold them back. From one calibration to the next the test is that of
//! [`compare`]; the table shows what has changed since the first.

use std::path::Path;

use calib_report::Unit;
use serde::Serialize;

use crate::compare::{Drift, compare};
use crate::error::DriftError;
use crate::evidence::Evidence;

/// One calibration of a history.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Calibration {
    /// Its report.
    pub report: String,
    /// When it was measured, as its profile states it.
    pub date: Option<String>,
    /// Whether it was rejected: what its model does not explain may look like a change.
    pub rejected: bool,
    /// Whether the robot changed since the calibration before, at a false-alarm rate of 1 %; null for the first, and where that is not
    /// decided or the two have nothing in common.
    pub changed: Option<bool>,
    /// Whether it changed since the first calibration, by the same test; null for the first two, and where that is not known.
    pub changed_since_first: Option<bool>,
    /// Names of what changed since the calibration before, most certain first.
    pub what: Vec<String>,
}

/// A quantity by one calibration.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Value {
    /// By the data alone.
    pub value: f64,
    /// Its σ.
    pub sigma: f64,
    /// Since the first calibration that determines it; angles by the shorter way round.
    pub change: f64,
    /// σ of the change; 0 for the first.
    pub change_sigma: f64,
}

/// A quantity over time.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Track {
    /// Stable name: `distance.shoulder.elbow`.
    pub name: String,
    /// In words.
    pub text: String,
    /// Of the numbers.
    pub unit: Unit,
    /// One per calibration; null where it does not determine the quantity.
    pub values: Vec<Option<Value>>,
}

impl Track {
    /// The largest change since the first calibration, in units of its σ.
    fn largest(&self) -> f64 {
        let values = self.values.iter().flatten();
        let changes = values.filter(|v| v.change_sigma > 0.0);
        changes
            .map(|v| (v.change / v.change_sigma).abs())
            .fold(0.0, f64::max)
    }
}

/// The calibrations of one robot in their order.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct History {
    /// Version of these keys: 1.
    pub calib_history: u32,
    /// The robot.
    pub robot: String,
    /// Whether they are in the order of their dates; else they are as they were given, because not all have one (`2026-11-03`).
    pub by_date: bool,
    /// In this order.
    pub calibrations: Vec<Calibration>,
    /// What changed most comes first.
    pub quantities: Vec<Track>,
}

/// The history of a robot from the reports, or folders of results, of its calibrations.
///
/// # Errors
/// [`DriftError`] when one is not a report, holds no covariance, or belongs to another robot.
pub fn history(reports: &[impl AsRef<Path>]) -> Result<History, DriftError> {
    let mut all = Vec::new();
    for path in reports {
        let path = path.as_ref();
        let report = calib_report::read_report(path)?;
        let name = calib_report::report_path(path).display().to_string();
        let evidence = Evidence::of(&report, &name)?;
        all.push((report.identification.date.clone(), evidence));
    }
    let dated = |(date, _): &(Option<String>, Evidence)| date.as_deref().and_then(moment);
    let by_date = all.iter().all(|one| dated(one).is_some());
    if by_date {
        all.sort_by_cached_key(|one| dated(one));
    }
    let mut calibrations: Vec<Calibration> = Vec::new();
    for (i, (date, evidence)) in all.iter().enumerate() {
        let before = i.checked_sub(1).and_then(|before| all.get(before));
        let drift = before.map_or(Ok(None), |(_, before)| decided(before, evidence))?;
        let first = all.first().filter(|_| i > 1);
        let since_first = first.map_or(Ok(None), |(_, first)| decided(first, evidence))?;
        let significant = drift.iter().flat_map(|d| &d.numbers);
        calibrations.push(Calibration {
            report: evidence.file.clone(),
            date: date.clone(),
            rejected: evidence.rejected,
            changed: drift.as_ref().map(|d| d.changed),
            changed_since_first: since_first.map(|d| d.changed),
            what: significant
                .filter(|n| n.significant && n.gauge_free)
                .map(|n| n.text.clone())
                .collect(),
        });
    }
    let evidence: Vec<&Evidence> = all.iter().map(|(_, evidence)| evidence).collect();
    Ok(History {
        calib_history: 1,
        by_date,
        robot: evidence
            .first()
            .map_or_else(String::new, |e| e.robot.clone()),
        calibrations,
        quantities: tracks(&evidence),
    })
}

/// Year, month, day and the numbers of a time of day: `2026-11-03`, `2026-11-3 9:30`, `2026-11-03T09:30:00Z`. `None` for what is no such
/// date: of `03.11.2026` nobody knows which number is the month.
fn moment(date: &str) -> Option<Vec<u32>> {
    let (day, time) = date
        .trim()
        .split_once(['T', 't', ' '])
        .unwrap_or((date.trim(), ""));
    let mut numbers: Vec<u32> = Vec::new();
    for part in day.split('-') {
        numbers.push(part.parse().ok()?);
    }
    let is_date = matches!(numbers[..], [1000..=9999, 1..=12, 1..=31]);
    let time = time
        .split(|c: char| !c.is_ascii_digit())
        .map_while(|part| part.parse::<u32>().ok());
    numbers.extend(time);
    is_date.then_some(numbers)
}

/// The comparison of two calibrations, where it decides anything.
fn decided(old: &Evidence, new: &Evidence) -> Result<Option<Drift>, DriftError> {
    match compare(old, new) {
        Err(DriftError::NothingInCommon { .. }) => Ok(None),
        Ok(drift) if drift.undecided.is_some() => Ok(None),
        drift => drift.map(Some),
    }
}

/// What any of the calibrations determines, what changed most first.
fn tracks(all: &[&Evidence]) -> Vec<Track> {
    let mut tracks: Vec<Track> = Vec::new();
    for number in all.iter().flat_map(|e| &e.numbers) {
        if number.displaces || tracks.iter().any(|t| t.name == number.name) {
            continue;
        }
        let mut values: Vec<Option<Value>> = Vec::new();
        let mut first: Option<Value> = None;
        for evidence in all {
            let known = evidence.numbers.iter().find(|n| n.name == number.name);
            let known = known.filter(|n| evidence.determines(n) && evidence.is_credible(n));
            let value = known.map(|n| {
                let (value, variance) = evidence.estimate(n);
                let sigma = variance.sqrt();
                let (change, change_sigma) = first.map_or((0.0, 0.0), |first| {
                    let plain = value - first.value;
                    let change = match n.unit {
                        Unit::Radian => plain.sin().atan2(plain.cos()),
                        _ => plain,
                    };
                    (change, sigma.hypot(first.sigma))
                });
                Value {
                    value,
                    sigma,
                    change,
                    change_sigma,
                }
            });
            first = first.or(value);
            values.push(value);
        }
        if first.is_some() {
            tracks.push(Track {
                name: number.name.clone(),
                text: number.text.clone(),
                unit: number.unit,
                values,
            });
        }
    }
    tracks.sort_by(|a, b| b.largest().total_cmp(&a.largest()));
    tracks
}

#[cfg(test)]
mod tests {
    use super::moment;

    #[test]
    fn dates_are_ordered_as_days_are() {
        let ordered = [
            "2025-12-31",
            "2026-2-1",
            "2026-10-05",
            "2026-11-02 9:30",
            "2026-11-02T10:00:00Z",
            "2026-11-2 10:00:01",
        ];
        for pair in ordered.windows(2) {
            assert!(moment(pair[0]) < moment(pair[1]), "{pair:?}");
        }
        for no_date in [
            "03.11.2026",
            "99-01-01",
            "2026-13-01",
            "2026-11",
            "",
            "spring",
            "2026-11-03-1",
        ] {
            assert_eq!(moment(no_date), None, "{no_date}");
        }
    }
}
