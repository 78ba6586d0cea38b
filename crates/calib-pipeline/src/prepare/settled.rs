//! Holds that had not settled are rejected.

use std::collections::BTreeMap;

use calib_checks::sync::{HoldSettings, holds, static_poses};
use calib_finding::{About, Fact, Finding, Subject, catalog};
use calib_profile::{Timing, Tracker};
use calib_recording::Poses;
use calib_report::RejectedFor;
use nalgebra::Matrix3;

use crate::prepare::aligned::{Aligned, ClockState};
use crate::prepare::excluded::Excluded;
use crate::prepare::row_noise::RowNoise;

/// Variance of a hold, in units of the usual, from which it had not settled.
const RESTLESS: f64 = 16.0;

/// Scatter of a hold, m, that no tracker's noise reaches.
const RESTLESS_SIGMA: f64 = 2e-4;

/// Part of the holds that may be restless: beyond it the robot's stand shakes, and leaving out helps no more.
const MANY: f64 = 0.34;

/// Why a hold had not settled.
struct Restless {
    /// The marker or body that shows it.
    name: String,
    /// Its drift, or its scatter.
    facts: Vec<(&'static str, Fact)>,
}

/// One pose per hold, with the shapes of the markers' scatter; restless holds are listed.
pub(crate) fn settle(
    name: &str,
    timing: &Timing,
    tracker: &Tracker,
    full: &Poses,
    aligned: &mut Aligned,
) {
    let settings = hold_settings(timing, tracker);
    let found = holds(full, &settings);
    aligned.findings.extend(holds_apart(
        name,
        full,
        (&settings, found.len()),
        &aligned.alignment.clocks,
    ));
    let table = static_poses(full, &found);
    aligned.alignment.holds = Some(found.len());
    // Holds whose halves differ, and holds that scatter more than the others.
    let mut restless: BTreeMap<usize, Restless> = BTreeMap::new();
    for finding in table.findings {
        let first = finding.rows.first().copied();
        let hold = found
            .iter()
            .position(|h| first == Some(full.rows[h.rows.start]));
        if let Some(hold) = hold {
            restless.entry(hold).or_insert_with(|| Restless {
                name: finding.subject.to_string(),
                facts: ["drift", "time"]
                    .into_iter()
                    .filter_map(|key| Some((key, finding.facts.get(key)?.clone())))
                    .collect(),
            });
        }
    }
    let mut usual = Vec::new();
    for (marker, covariances) in &table.marker_covariance {
        let traces = covariances.iter().map(|c| c.map(|c| c.trace()));
        let step = table.written_step.get(marker).copied().unwrap_or(0.0);
        let stream = (marker.as_str(), step);
        note_scatter(stream, traces.collect(), &mut usual, &mut restless);
    }
    for (body, covariances) in &table.body_covariance {
        let traces = covariances
            .iter()
            .map(|c| c.map(|c| c.fixed_view::<3, 3>(3, 3).trace()));
        let step = table.written_step.get(body).copied().unwrap_or(0.0);
        let stream = (body.as_str(), step);
        note_scatter(stream, traces.collect(), &mut Vec::new(), &mut restless);
    }
    aligned.row_noise = RowNoise::of(
        table.marker_covariance.values(),
        table.body_covariance.values(),
    );
    // The part that changes from hold to hold and is constant within one (distortion, refraction) does not show in the
    // scatter: half of the weight is the same for all.
    usual.sort_by(f64::total_cmp);
    if let Some(variance) = usual.get(usual.len() / 2).map(|trace| trace / 3.0) {
        let shape = |c: &Option<Matrix3<f64>>| {
            c.filter(|_| variance > 0.0)
                .map(|c| (Matrix3::identity() + c / variance) * 0.5)
        };
        aligned.shapes = table
            .marker_covariance
            .iter()
            .map(|(marker, all)| (marker.clone(), all.iter().map(shape).collect()))
            .collect();
    }
    let many = restless.len() as f64 > MANY * found.len() as f64;
    let rows: Vec<u64> = restless.keys().map(|&h| table.poses.rows[h]).collect();
    if let Some(first) = restless.values().next() {
        let kind = if many { "holds_kept" } else { "holds" };
        let finding = Finding::of_kind(catalog::UNSETTLED_ROWS, kind, Subject::recording(name))
            .with("restless", Fact::count(restless.len()))
            .with("holds", Fact::count(found.len()))
            .with("name", Fact::name(&first.name));
        let finding = first.facts.iter().fold(finding, |finding, (key, fact)| {
            finding.with(key, fact.clone())
        });
        aligned.findings.push(finding.at_rows(rows));
    }
    if !many {
        let names = table.poses.markers.keys().chain(table.poses.bodies.keys());
        for stream in names {
            aligned
                .excluded
                .extend(restless.keys().map(|&row| Excluded {
                    recording: name.to_owned(),
                    row,
                    body: stream.clone(),
                    cause: RejectedFor::RestlessHold,
                }));
        }
    }
    aligned.poses = table.poses;
}

/// What counts as a hold at this noise of the tracker.
fn hold_settings(timing: &Timing, tracker: &Tracker) -> HoldSettings {
    let usual = HoldSettings::default();
    // Within a window of some twenty samples noise spreads over less than twelve σ.
    let spread = |sigma: Option<f64>| sigma.map_or(0.0, |s| 12.0 * s);
    let position = spread(tracker.marker_coordinate()).max(spread(tracker.body_coordinate()));
    HoldSettings {
        min_duration: timing.hold,
        point_range: usual.point_range.max(position),
        turn_range: usual.turn_range.max(spread(tracker.body_sigma_rad)),
        ..usual
    }
}

/// Holds of the bodies in this ratio to those of bodies and joints, and so many more, are no accident.
const APART: (f64, usize) = (1.5, 5);

/// Holds of the bodies in which the joints move, or have no values, by two clocks that were stated to be one.
fn holds_apart(
    name: &str,
    full: &Poses,
    (settings, both): (&HoldSettings, usize),
    clocks: &ClockState,
) -> Option<Finding> {
    if full.joints.is_empty() || !matches!(clocks, ClockState::Declared) {
        return None;
    }
    let alone = Poses {
        joints: BTreeMap::new(),
        ..full.clone()
    };
    let bodies = holds(&alone, settings).len();
    (bodies as f64 >= APART.0 * both as f64 && bodies >= both + APART.1).then(|| {
        Finding::of_kind(catalog::CLOCK_LAG, "holds_apart", About::Clocks)
            .in_recording(name)
            .with("bodies", Fact::count(bodies))
            .with("both", Fact::count(both))
    })
}

/// Adds the usual scatter of one stream and the holds that exceed it. Positions that were rounded to a step scatter by up to half of it along
/// each axis where nothing moves, and by nothing at all in other holds: √3 of it is beyond that.
fn note_scatter(
    (stream, step): (&str, f64),
    traces: Vec<Option<f64>>,
    usual: &mut Vec<f64>,
    restless: &mut BTreeMap<usize, Restless>,
) {
    let mut known: Vec<f64> = traces.iter().flatten().copied().collect();
    known.sort_by(f64::total_cmp);
    let Some(&middle) = known.get(known.len() / 2) else {
        return;
    };
    usual.push(middle);
    for (hold, trace) in traces.iter().enumerate() {
        if let Some(trace) = trace
            && *trace > RESTLESS * middle
            && trace.sqrt() > RESTLESS_SIGMA.max(3.0_f64.sqrt() * step)
        {
            restless.entry(hold).or_insert_with(|| Restless {
                name: stream.to_owned(),
                facts: vec![
                    ("scatter", Fact::meters(trace.sqrt())),
                    ("usual", Fact::meters(middle.sqrt())),
                ],
            });
        }
    }
}
