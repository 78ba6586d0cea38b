//! Where no recording is held out: each fitted pose predicted from all others, without refitting (equation C23 of the book).

use std::collections::{BTreeMap, BTreeSet};

use calib_core::{MeasurementId, MeasurementKind, VectorError};
use calib_geometry::registration::rigid_registration;
use calib_profile::Usage;
use calib_report::{Distance, HeldOut, PoseError};
use nalgebra::{Point3, Vector3};

use crate::formulate::formulation::MlFit;
use crate::prepare::inputs::Inputs;
use crate::prepare::tracks::BodyTrack;
use crate::verify::deviations::{Deviation, Key, deviations};
use crate::verify::held_out::{Robots, by_key, labeled, quantity};
use crate::verify::residuals::{left_out as rejected_by_fit, subject};

/// Poses that are left out in turn at most, evenly over all of them: their errors are known well enough.
const POSES: usize = 500;

/// Errors of the fitted poses, each left out in turn. What the fit rejected took no part anyway: its errors are shown as
/// screened. `None` where nothing can be left out.
#[must_use]
pub fn left_out(
    inputs: &Inputs,
    tracks: &BTreeMap<String, BodyTrack>,
    robots: &Robots<'_>,
    fit: &MlFit,
    registration: Option<&MlFit>,
) -> Option<HeldOut> {
    let fitted = |usage| usage != Usage::Validation;
    let step = fit.formulation.samples.len().div_ceil(POSES).max(1);
    let predicted = fit.solution.leave_out(|sample| sample % step == 0)?;
    let of = |robot| by_key(deviations(inputs, tracks, robot, fitted));
    let calibrated = of(robots.calibrated);
    let registered = robots.registered.map(of).unwrap_or_default();
    let urdf_alone = robots.urdf_alone.map(of).unwrap_or_default();
    let refitted = robots.refitted.map(of).unwrap_or_default();
    // The registration has its unknowns too: compared with its fitted errors, a calibration of a few poses would look worse than it is.
    let without = registration
        .map(|fit| each_left_out(fit, step))
        .unwrap_or_default();
    let mut poses = Vec::new();
    // Squares that are expected: of what is left out, and with all poses.
    let (mut squares, mut with_all) = (0.0, 0.0);
    for sample in &predicted.samples {
        let (recording, row) = &fit.formulation.samples[sample.sample];
        let angles = angles(fit, sample.sample, &sample.vectors);
        for v in &sample.vectors {
            let key = (recording.clone(), *row, subject(fit, v.measurement, v.item));
            squares += v.expected.unwrap_or(0.0).powi(2);
            with_all += v.expected_with_all.unwrap_or(0.0).powi(2);
            // Bodies that no joint moves say nothing about the robot.
            if !calibrated.contains_key(&key) {
                continue;
            }
            let before = registered.get(&key);
            let alone = without.get(&key);
            let vector = <[f64; 3]>::try_from(v.error.as_slice()).ok();
            poses.push(PoseError {
                registration_only_m: alone.and_then(|a| a.0).or(before.map(|d| d.vector.norm())),
                registration_only_rad: alone.and_then(|a| a.1).or(before.and_then(|d| d.angle)),
                calibrated_m: v.position.or(calibrated.get(&key).map(|d| d.vector.norm())),
                // Fitted with this pose, too: what is left are the effects.
                urdf_alone_m: urdf_alone.get(&key).map(|d| d.vector.norm()),
                urdf_refitted_m: refitted.get(&key).map(|d| d.vector.norm()),
                calibrated_rad: v.rotation.or(angles.get(&v.measurement).copied()),
                vector_m: vector,
                distance: v.z.is_finite().then_some(Distance {
                    z: v.z,
                    rows: v.error.len(),
                }),
                ..labeled(inputs, &key)
            });
        }
    }
    if poses.is_empty() {
        return None;
    }
    let kept: BTreeSet<(&String, usize)> = fit
        .formulation
        .samples
        .iter()
        .step_by(step)
        .map(|(recording, row)| (recording, *row))
        .collect();
    let rejected = rejected_by_fit(fit);
    let outside = calibrated
        .iter()
        .filter(|(key, _)| kept.contains(&(&key.0, key.1)) && rejected.contains(*key));
    poses.extend(outside.map(|(key, d)| of_rejected(inputs, key, d, registered.get(key))));
    Some(HeldOut {
        left_out: true,
        left_out_over_all: (with_all > 0.0).then(|| (squares / with_all).sqrt()),
        ..HeldOut::from_poses(quantity(inputs, fitted), poses)
    })
}

/// Errors of position (m) and orientation (rad) of a fit whose poses are left out in turn.
fn each_left_out(fit: &MlFit, step: usize) -> BTreeMap<Key, (Option<f64>, Option<f64>)> {
    let mut out = BTreeMap::new();
    let Some(predicted) = fit.solution.leave_out(|sample| sample % step == 0) else {
        return out;
    };
    for sample in &predicted.samples {
        let (recording, row) = &fit.formulation.samples[sample.sample];
        let angles = angles(fit, sample.sample, &sample.vectors);
        for v in &sample.vectors {
            let key = (recording.clone(), *row, subject(fit, v.measurement, v.item));
            out.insert(
                key,
                (
                    v.position,
                    v.rotation.or(angles.get(&v.measurement).copied()),
                ),
            );
        }
    }
    out
}

/// A rejected measurement took no part: its residual is its prediction error.
fn of_rejected(
    inputs: &Inputs,
    key: &Key,
    found: &Deviation,
    registered: Option<&Deviation>,
) -> PoseError {
    PoseError {
        registration_only_m: registered.map(|d| d.vector.norm()),
        registration_only_rad: registered.and_then(|d| d.angle),
        calibrated_m: Some(found.vector.norm()),
        calibrated_rad: found.angle,
        vector_m: Some(found.vector.into()),
        screened: true,
        ..labeled(inputs, key)
    }
}

/// Where markers were seen, and where they should be.
type Pairs = (Vec<Point3<f64>>, Vec<Point3<f64>>);

/// Orientation errors of the bodies whose markers were predicted: the rotation from where they were seen to where they
/// should be, rad.
fn angles(fit: &MlFit, sample: usize, vectors: &[VectorError]) -> BTreeMap<MeasurementId, f64> {
    let mut points: BTreeMap<MeasurementId, Pairs> = BTreeMap::new();
    let measurements = fit.formulation.problem.measurements();
    for v in vectors {
        let MeasurementKind::Markers(markers) = &measurements[v.measurement.index()].kind else {
            continue;
        };
        let seen = markers.observations.get(v.item);
        let Some(seen) = seen.filter(|s| s.sample == sample) else {
            continue;
        };
        // e = predicted − seen, in axes of the tracker.
        let of_body = points.entry(v.measurement).or_default();
        of_body.0.push(seen.position);
        of_body
            .1
            .push(seen.position + Vector3::from_column_slice(&v.error));
    }
    points
        .into_iter()
        .filter_map(|(body, (seen, predicted))| {
            let found = rigid_registration(&seen, &predicted, None).ok()?;
            Some((body, found.b_from_a.rotation.angle()))
        })
        .collect()
}
