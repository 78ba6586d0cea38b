//! Exchanged marker labels, put right in the recordings before anything else looks at them.
//!
//! The distances `d_ij` between the markers of a body do not depend on where it is. Over all recordings their medians are
//! the reference; a row that disagrees with it, and agrees with exactly one other arrangement of its labels, gets that
//! arrangement ([`calib_core::relabel`]). What is put right is said, row by row; what cannot be, is left to the data
//! checks.

use calib_geometry::statistics::{SIGMA_PER_MAD, upper_median};
use std::collections::BTreeMap;

use calib_core::{MarkerObservation, MeasurementKind, NoiseKind, PointId, Problem, measurement};
use calib_finding::{Fact, Finding, Subject, catalog};
use calib_profile::BodyKind;
use nalgebra::Point3;

use crate::prepare::exchanged::between_bodies;
use crate::prepare::exchanged_rows::in_rows;
use crate::prepare::inputs::{Inputs, Loaded};
use crate::prepare::scatter::scatter;

/// Distances stay within this many σ: one Gaussian value in 10¹⁵ does not.
const SIGMAS: f64 = 8.0;
/// Smallest deviation of a distance that is called a fault, m.
const SMALLEST_FAULT: f64 = 4e-4;

/// Puts exchanged labels right in all recordings; one finding per recording and body with the rows.
#[must_use]
pub fn relabel(inputs: &mut Inputs) -> Vec<Finding> {
    let bodies: Vec<(String, Vec<String>)> = inputs
        .robot
        .profile
        .bodies
        .iter()
        .filter_map(|(name, body)| match &body.kind {
            BodyKind::Markers { names, .. } if names.len() >= 3 => {
                Some((name.clone(), names.clone()))
            }
            _ => None,
        })
        .collect();
    let stated = inputs.robot.profile.tracker.marker_coordinate();
    // The distances of a body whose labels are another's say nothing of its rows.
    let mut findings = between_bodies(inputs);
    findings.extend(in_rows(inputs));
    for (body, markers) in bodies {
        findings.extend(relabel_body(
            &mut inputs.recordings,
            &body,
            &markers,
            stated,
        ));
    }
    // The scatter of markers under wrong labels is not that of the tracker.
    let robot = &inputs.robot;
    for name in findings.iter().flat_map(|f| &f.subject.recordings) {
        if let Some(loaded) = inputs.recordings.get_mut(name) {
            loaded.scatter = scatter(&robot.profile, &robot.model, &loaded.poses);
        }
    }
    findings
}

fn relabel_body(
    recordings: &mut BTreeMap<String, Loaded>,
    body: &str,
    markers: &[String],
    stated: Option<f64>,
) -> Vec<Finding> {
    let names: Vec<String> = recordings.keys().cloned().collect();
    let mut tables: Vec<&mut Tracks> = recordings
        .values_mut()
        .map(|loaded| &mut loaded.poses.markers)
        .collect();
    let relabeled = put_right(&mut tables, markers, stated);
    // Recording → rows with the markers that were exchanged.
    let mut found: BTreeMap<String, Vec<(u64, String)>> = BTreeMap::new();
    for changed in relabeled {
        let name = &names[changed.table];
        let row = recordings[name].poses.rows[changed.row];
        let entry = found.entry(name.clone()).or_default();
        entry.push((row, changed.exchanged.join(" ↔ ")));
    }
    found
        .into_iter()
        .map(|(recording, rows)| finding(&recording, body, &rows))
        .collect()
}

/// Marker points by name, one for each row; `None` where it was not seen.
pub type Tracks = BTreeMap<String, Vec<Option<Point3<f64>>>>;

/// A row whose labels were put right.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Relabeled {
    /// The table, in the order given.
    pub table: usize,
    /// Its row, from 0.
    pub row: usize,
    /// The markers whose places changed, in the order of their names.
    pub exchanged: Vec<String>,
}

/// Puts the labels of one body's markers right in all tables, by the distances that most rows have. `stated`: σ of a marker coordinate, m.
pub fn put_right(
    tables: &mut [&mut Tracks],
    markers: &[String],
    stated: Option<f64>,
) -> Vec<Relabeled> {
    let length = |table: &Tracks| table.values().map(Vec::len).max().unwrap_or(0);
    let rows: Vec<(usize, usize)> = tables
        .iter()
        .enumerate()
        .flat_map(|(t, table)| (0..length(table)).map(move |row| (t, row)))
        .collect();
    let mut problem = Problem::new(rows.len());
    let (tracker, frame) = (problem.frame("tracker"), problem.frame("body"));
    let noise = problem.noise_group("marker", NoiseKind::Position, 1.0, false);
    let points: Vec<PointId> = markers
        .iter()
        .map(|marker| problem.known_point(marker, frame, Point3::origin()))
        .collect();
    let mut observations = Vec::new();
    // Marker of each observation, as the file has it.
    let mut labels = Vec::new();
    for (sample, (table, row)) in rows.iter().enumerate() {
        for (k, marker) in markers.iter().enumerate() {
            let track = tables[*table].get(marker);
            if let Some(position) = track.and_then(|track| *track.get(*row)?) {
                observations.push(MarkerObservation {
                    sample,
                    point: points[k],
                    position,
                    shape: None,
                });
                labels.push(k);
            }
        }
    }
    let Some(tolerance) = tolerance(&observations, &labels, markers.len(), stated) else {
        return Vec::new();
    };
    problem.markers("body", tracker, frame, noise, observations);
    let changed = calib_core::relabel(&mut problem, tolerance);
    let Some(MeasurementKind::Markers(measurement::Markers { observations, .. })) =
        problem.measurements().first().map(|h| &h.kind)
    else {
        return Vec::new();
    };
    let mut relabeled = Vec::new();
    for sample in changed {
        let (table, row) = rows[sample.sample];
        let mut exchanged: Vec<String> = Vec::new();
        for (item, point) in &sample.changes {
            if let Some(k) = points.iter().position(|p| p == point)
                && let Some(track) = tables[table].get_mut(&markers[k])
            {
                track[row] = Some(observations[*item].position);
                exchanged.push(markers[k].clone());
            }
        }
        exchanged.sort_unstable();
        relabeled.push(Relabeled {
            table,
            row,
            exchanged,
        });
    }
    relabeled
}

fn finding(recording: &str, body: &str, rows: &[(u64, String)]) -> Finding {
    let mut kinds: BTreeMap<&str, usize> = BTreeMap::new();
    for (_, exchanged) in rows {
        *kinds.entry(exchanged).or_default() += 1;
    }
    let exchanges = kinds.into_iter().map(|(which, count)| match count {
        1 => format!("{which} in 1 row"),
        count => format!("{which} in {count} rows"),
    });
    let subject = Subject::body(body).in_recording(recording);
    Finding::of_kind(catalog::MARKER_SWAP_REPAIRED, "rows", subject)
        .with("rows", Fact::count(rows.len()))
        .with("exchanges", Fact::names(exchanges))
        .at_rows(rows.iter().map(|(row, _)| *row))
}

/// Largest deviation of a distance that noise explains, m; `None` where no pair is seen often enough.
fn tolerance(
    observations: &[MarkerObservation],
    labels: &[usize],
    markers: usize,
    stated: Option<f64>,
) -> Option<f64> {
    /// Rows from which a median deviation is worth something.
    const ENOUGH: usize = 5;
    let mut distances: Vec<Vec<f64>> = vec![Vec::new(); markers * markers];
    let mut start = 0;
    for end in 1..=observations.len() {
        if end < observations.len() && observations[end].sample == observations[start].sample {
            continue;
        }
        for i in start..end {
            for j in i + 1..end {
                let distance = (observations[i].position - observations[j].position).norm();
                distances[labels[i] * markers + labels[j]].push(distance);
            }
        }
        start = end;
    }
    let mut sigmas: Vec<f64> = distances
        .iter_mut()
        .filter(|all| all.len() >= ENOUGH)
        .map(|all| {
            let middle = upper_median(all).unwrap_or(0.0);
            let mut off: Vec<f64> = all.iter().map(|d| (d - middle).abs()).collect();
            SIGMA_PER_MAD * upper_median(&mut off).unwrap_or(0.0)
        })
        .collect();
    if sigmas.is_empty() {
        return None;
    }
    sigmas.sort_by(f64::total_cmp);
    // The quieter pairs tell the noise, even when one marker is loose.
    let quiet = sigmas[(sigmas.len() - 1) / 4];
    let stated = stated.map_or(0.0, |sigma| sigma * std::f64::consts::SQRT_2);
    Some((SIGMAS * quiet.max(stated)).max(SMALLEST_FAULT))
}
