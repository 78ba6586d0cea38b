//! Position and orientation errors on poses that were not fitted: nominal, registration only, calibrated.
//!
//! All measurements count: every marker of every body that a joint moves, the pose of a body that is measured as one, and
//! the orientation of every body whose markers define it. Gross outliers are screened by the rule of the fit
//! ([`calib_report::screen`]).

use std::collections::{BTreeMap, BTreeSet};

use calib_profile::{BodyKind, Usage};
use calib_report::{Distance, HeldOut, PoseError};

use crate::formulate::formulation::MlFit;
use crate::formulate::kinematics::Calibration;
use crate::formulate::row_levels::HeldOutLevels;
use crate::formulate::starts::rows_of_no_side;
use crate::prepare::inputs::Inputs;
use crate::prepare::tracks::BodyTrack;
use crate::verify::deviations::{Deviation, Key, deviations, joint_values};
use crate::verify::residuals::subject;

/// The robots whose errors stand side by side.
#[derive(Debug, Clone, Copy)]
pub struct Robots<'a> {
    /// As in the nominal URDF, bodies placed by closed forms.
    pub nominal: Option<&'a Calibration>,
    /// The same after the fit of tracker and bodies.
    pub registered: Option<&'a Calibration>,
    /// The calibrated robot.
    pub calibrated: &'a Calibration,
    /// The same without the effects that a URDF cannot hold, where there are any.
    pub urdf_alone: Option<&'a Calibration>,
    /// What was fitted to be used without effects, where there are any.
    pub refitted: Option<&'a Calibration>,
}

/// Errors in the validation recordings; `None` without validation rows.
#[must_use]
pub fn held_out(
    inputs: &Inputs,
    tracks: &BTreeMap<String, BodyTrack>,
    robots: &Robots<'_>,
    fit: Option<&MlFit>,
) -> Option<HeldOut> {
    let validation = |usage| usage == Usage::Validation;
    let of = |robot: Option<&Calibration>| {
        robot.map_or_else(BTreeMap::new, |r| {
            by_key(deviations(inputs, tracks, r, validation))
        })
    };
    let (nominal, registered) = (of(robots.nominal), of(robots.registered));
    let urdf_alone = of(robots.urdf_alone);
    let refitted = of(robots.refitted);
    let distances = fit.map(|fit| distances(inputs, fit)).unwrap_or_default();
    let best = deviations(inputs, tracks, robots.calibrated, validation);
    if best.is_empty() {
        return None;
    }
    let mut poses: Vec<PoseError> = best
        .iter()
        .map(|d| {
            let key = d.key();
            let length = |of: &BTreeMap<Key, Deviation>| of.get(&key).map(|d| d.vector.norm());
            let angle = |of: &BTreeMap<Key, Deviation>| of.get(&key).and_then(|d| d.angle);
            PoseError {
                nominal_m: length(&nominal),
                registration_only_m: length(&registered),
                calibrated_m: Some(d.vector.norm()),
                urdf_alone_m: length(&urdf_alone),
                urdf_refitted_m: length(&refitted),
                vector_m: Some(d.vector.into()),
                nominal_rad: angle(&nominal),
                registration_only_rad: angle(&registered),
                calibrated_rad: d.angle,
                distance: distances.get(&key).copied(),
                ..labeled(inputs, &key)
            }
        })
        .collect();
    calib_report::screen(&mut poses);
    if fit.is_some() {
        without_rows_of_no_side(inputs, &best, &mut poses);
    }
    without_spoiled_orientations(inputs, &mut poses);
    Some(HeldOut::from_poses(quantity(inputs, validation), poses))
}

/// Of joints that came from a side which nothing tells, the fit predicts the middle, with an uncertainty that it does not state: these rows
/// are screened, where they are not most of all.
fn without_rows_of_no_side(inputs: &Inputs, found: &[Deviation], poses: &mut [PoseError]) {
    let of_no_side = rows_of_no_side(inputs);
    let of_none = |found: &Deviation| {
        let (recording, row, _) = found.key();
        of_no_side.contains(&(recording, row))
    };
    let flags: Vec<bool> = found.iter().map(of_none).collect();
    if 2 * flags.iter().filter(|flag| **flag).count() > flags.len() {
        return;
    }
    for (pose, flag) in poses.iter_mut().zip(flags) {
        pose.screened |= flag;
    }
}

/// A marker that was screened out spoils the orientation of its body in that posture: it is not counted either.
fn without_spoiled_orientations(inputs: &Inputs, poses: &mut [PoseError]) {
    let bodies = inputs.robot.profile.bodies.values();
    let bodies: Vec<&Vec<String>> = bodies
        .filter_map(|body| match &body.kind {
            BodyKind::Markers { names, .. } => Some(names),
            BodyKind::Pose => None,
        })
        .collect();
    let of_body = |subject: &String| bodies.iter().position(|names| names.contains(subject));
    let screened = poses.iter().filter(|pose| pose.screened);
    let spoiled: BTreeSet<(String, usize)> = screened
        .filter_map(|pose| Some((pose.pose.clone(), of_body(&pose.subject)?)))
        .collect();
    for pose in poses.iter_mut().filter(|pose| !pose.screened) {
        let body = of_body(&pose.subject);
        if body.is_some_and(|body| spoiled.contains(&(pose.pose.clone(), body))) {
            pose.nominal_rad = None;
            pose.registration_only_rad = None;
            pose.calibrated_rad = None;
        }
    }
}

/// An error without numbers: where it was seen.
pub(crate) fn labeled(inputs: &Inputs, (recording, row, subject): &Key) -> PoseError {
    let loaded = &inputs.recordings[recording];
    let group = loaded.spec.group.as_ref();
    let group = group.and_then(|g| loaded.poses.labels.get(g));
    PoseError {
        pose: format!("{recording}:{}", loaded.poses.rows[*row]),
        subject: subject.clone(),
        group: group.map_or_else(String::new, |g| g[*row].clone()),
        joints: joint_values(inputs, recording, *row),
        ..PoseError::default()
    }
}

pub(crate) fn by_key(deviations: Vec<Deviation>) -> BTreeMap<Key, Deviation> {
    deviations.into_iter().map(|d| (d.key(), d)).collect()
}

/// Errors of the held-out samples in units of what the fit predicts: noise and parameters.
fn distances(inputs: &Inputs, fit: &MlFit) -> BTreeMap<Key, Distance> {
    let samples = &fit.formulation.samples;
    let rows = HeldOutLevels::of(inputs, samples);
    let recording = |sample: usize| &inputs.recordings[&samples[sample].0];
    let level = |sample, kind, found| rows.level(recording(sample), kind, found);
    let predicted = fit.solution.held_out_at(&level).into_iter();
    let samples = predicted.flat_map(|p| p.samples);
    let mut out = BTreeMap::new();
    for sample in samples {
        let (recording, row) = &fit.formulation.samples[sample.sample];
        for v in sample.vectors {
            let key = (recording.clone(), *row, subject(fit, v.measurement, v.item));
            let distance = Distance {
                z: v.z,
                rows: v.error.len(),
            };
            out.insert(key, distance);
        }
    }
    // A distance that is not finite has no JSON form, and no prediction.
    out.retain(|_, distance| distance.z.is_finite());
    out
}

/// What is measured in recordings of one use.
pub(crate) fn quantity(inputs: &Inputs, usage: impl Fn(Usage) -> bool) -> &'static str {
    let touched = |contact: &calib_profile::Contact| {
        let mut used = contact.recordings.iter();
        used.any(|r| usage(inputs.recordings[r].spec.usage))
    };
    let touches = inputs.robot.profile.contacts.values().any(touched);
    HeldOut::quantity_of(!inputs.robot.profile.bodies.is_empty(), touches)
}
