//! Position and orientation errors on poses that were not fitted: nominal, registration only, calibrated.

use std::collections::BTreeMap;

use calib_profile::{BodyKind, Usage};
use calib_report::{HeldOut, JointValue, PoseError, Unit};
use nalgebra::{Isometry3, Vector3};

use crate::formulate::contacts::miss;
use crate::formulate::kinematics::Calibration;
use crate::prepare::conditions::conditions;
use crate::prepare::inputs::Inputs;
use crate::prepare::tracks::BodyTrack;

/// Predicted minus measured position of one body or marker in one row, tracker frame, m.
#[derive(Debug, Clone, PartialEq)]
pub struct Deviation {
    /// Recording.
    pub recording: String,
    /// Row in its table, from 0.
    pub row: usize,
    /// Body, marker or contact.
    pub subject: String,
    /// Predicted − measured, m.
    pub vector: Vector3<f64>,
    /// Angle between predicted and measured orientation, rad; `None` for a marker.
    pub angle: Option<f64>,
}

/// Deviations of a robot from what the tracker saw of every body that a joint moves, in recordings of one use.
///
/// A body with a frame counts once, by its origin; a body without one counts once per marker.
#[must_use]
pub fn deviations(
    inputs: &Inputs,
    tracks: &BTreeMap<String, BodyTrack>,
    robot: &Calibration,
    usage: impl Fn(Usage) -> bool,
) -> Vec<Deviation> {
    let model = &inputs.robot.model;
    let mut out = Vec::new();
    for (name, loaded) in inputs
        .recordings
        .iter()
        .filter(|(_, r)| usage(r.spec.usage))
    {
        let under = conditions(loaded, model, inputs.robot.profile.solve.load);
        for (row, q) in loaded.q.iter().enumerate() {
            let Some(q) = q else { continue };
            let root_from_link = robot.root_from_link_under(q, &under[row]);
            for (contact_name, contact) in &inputs.robot.profile.contacts {
                if contact.recordings.contains(name)
                    && let Some(off) = miss(inputs, contact_name, robot, &root_from_link)
                {
                    out.push(Deviation {
                        recording: name.clone(),
                        row,
                        subject: contact_name.clone(),
                        vector: off,
                        angle: None,
                    });
                }
            }
            for (body_name, body) in &inputs.robot.profile.bodies {
                if model
                    .chain(model.root(), body.link)
                    .iter()
                    .all(|s| model.joint(s.joint).kind.axis().is_none())
                {
                    continue;
                }
                let tracker_from_link = robot.tracker_from_root * root_from_link[body.link.index()];
                let mut push = |subject: &str, vector: Vector3<f64>, angle: Option<f64>| {
                    out.push(Deviation {
                        recording: name.clone(),
                        row,
                        subject: subject.to_owned(),
                        vector,
                        angle,
                    });
                };
                let track = &tracks[body_name];
                let seen: Option<Isometry3<f64>> =
                    track.in_recording(name).get(row).copied().flatten();
                if let (Some(mount), Some(seen)) = (robot.mounts.get(body_name), seen) {
                    let predicted = tracker_from_link * mount;
                    push(
                        body_name,
                        predicted.translation.vector - seen.translation.vector,
                        Some(predicted.rotation.angle_to(&seen.rotation)),
                    );
                } else if let (BodyKind::Markers { names, .. }, None) =
                    (&body.kind, &track.template)
                {
                    for marker in names {
                        let on_link = robot.points.get(body_name).and_then(|p| p.get(marker));
                        let seen = loaded.poses.markers.get(marker).and_then(|t| t[row]);
                        if let (Some(on_link), Some(seen)) = (on_link, seen) {
                            push(marker, tracker_from_link * on_link - seen, None);
                        }
                    }
                }
            }
        }
    }
    out
}

/// Held-out errors of up to three robots side by side; `None` without validation rows.
#[must_use]
pub fn held_out(
    inputs: &Inputs,
    tracks: &BTreeMap<String, BodyTrack>,
    nominal: Option<&Calibration>,
    registration_only: Option<&Calibration>,
    calibrated: &Calibration,
) -> Option<HeldOut> {
    let validation = |usage| usage == Usage::Validation;
    let of = |robot: Option<&Calibration>| {
        robot.map_or_else(Vec::new, |r| deviations(inputs, tracks, r, validation))
    };
    let (nominal, registered) = (of(nominal), of(registration_only));
    let length = |d: &[Deviation], i: usize| d.get(i).map(|d| d.vector.norm());
    let angle = |d: &[Deviation], i: usize| d.get(i).and_then(|d| d.angle);
    let best = deviations(inputs, tracks, calibrated, validation);
    if best.is_empty() {
        return None;
    }
    let poses = best
        .iter()
        .enumerate()
        .map(|(i, d)| {
            let loaded = &inputs.recordings[&d.recording];
            let group = loaded
                .spec
                .group
                .as_ref()
                .and_then(|g| loaded.poses.labels.get(g));
            PoseError {
                pose: format!("{}:{}", d.recording, loaded.poses.rows[d.row]),
                subject: d.subject.clone(),
                group: group.map_or_else(String::new, |g| g[d.row].clone()),
                joints: joint_values(inputs, &d.recording, d.row),
                nominal_m: length(&nominal, i),
                registration_only_m: length(&registered, i),
                calibrated_m: Some(d.vector.norm()),
                vector_m: Some(d.vector.into()),
                nominal_rad: angle(&nominal, i),
                registration_only_rad: angle(&registered, i),
                calibrated_rad: d.angle,
            }
        })
        .collect();
    let touched = |contact: &calib_profile::Contact| {
        let mut used = contact.recordings.iter();
        used.any(|r| validation(inputs.recordings[r].spec.usage))
    };
    let touches = inputs.robot.profile.contacts.values().any(touched);
    Some(HeldOut::from_poses(
        if touches {
            "position of the tracked bodies, and how far touches miss"
        } else {
            "position of the tracked bodies"
        },
        poses,
    ))
}

/// Recorded joint positions of a row.
#[must_use]
pub fn joint_values(inputs: &Inputs, recording: &str, row: usize) -> Vec<JointValue> {
    let model = &inputs.robot.model;
    let Some(loaded) = inputs.recordings.get(recording) else {
        return Vec::new();
    };
    let Some(q) = loaded.q.get(row).and_then(Option::as_ref) else {
        return Vec::new();
    };
    model
        .independent_joints()
        .filter(|id| loaded.poses.joints.contains_key(&model.joint(*id).name))
        .map(|id| {
            let joint = model.joint(id);
            let unit = if joint.kind.turns() {
                Unit::Radian
            } else {
                Unit::Meter
            };
            JointValue {
                joint: joint.name.clone(),
                value: q[id.index()],
                unit,
            }
        })
        .collect()
}
