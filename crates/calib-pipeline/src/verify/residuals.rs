//! Residuals of the fit, one row per marker or body and pose, for the report and `residuals.csv`.

use std::collections::{BTreeMap, BTreeSet};

use calib_core::{MeasurementId, MeasurementKind};
use calib_geometry::so3;
use calib_profile::{BodyKind, Usage};
use calib_report::ResidualRow;

use crate::formulate::contacts::miss;
use crate::formulate::formulation::MlFit;
use crate::formulate::kinematics::Calibration;
use crate::prepare::conditions::conditions;
use crate::prepare::inputs::Inputs;
use crate::prepare::tracks::BodyTrack;
use crate::verify::held_out::joint_values;

/// What the solver left out: recording, row and marker or body.
#[must_use]
pub fn left_out(fit: &MlFit) -> BTreeSet<(String, usize, String)> {
    fit.solution
        .rejected
        .iter()
        .map(|r| {
            let (recording, row) = &fit.formulation.samples[r.sample];
            (recording.clone(), *row, subject(fit, r.measurement, r.item))
        })
        .collect()
}

/// The marker of an observation, or its body where poses are observed.
#[must_use]
pub fn subject(fit: &MlFit, measurement: MeasurementId, item: usize) -> String {
    let problem = &fit.formulation.problem;
    let measurement = &problem.measurements()[measurement.index()];
    let marker = match &measurement.kind {
        MeasurementKind::Markers(calib_core::measurement::Markers { observations, .. }) => {
            observations.get(item)
        }
        _ => None,
    };
    let point = marker.and_then(|o| problem.points().get(o.point.index()));
    point.map_or(&measurement.name, |p| &p.name).clone()
}

/// Predicted − measured for every sample of every fitted recording.
#[must_use]
pub fn residual_rows(
    inputs: &Inputs,
    tracks: &BTreeMap<String, BodyTrack>,
    robot: &Calibration,
    fit: Option<&MlFit>,
) -> Vec<ResidualRow> {
    let left_out = fit.map(left_out).unwrap_or_default();
    // Points computed from one body are one measurement: it is left out under the body's name.
    let body_of = |subject: &str| {
        let holds = |body: &&String| match &inputs.robot.profile.bodies[*body].kind {
            BodyKind::Markers { names, .. } => names.iter().any(|m| m == subject),
            BodyKind::Pose => false,
        };
        inputs.robot.profile.bodies.keys().find(holds).cloned()
    };
    let mut rows = Vec::new();
    for (name, loaded) in inputs
        .recordings
        .iter()
        .filter(|(_, r)| r.spec.usage != Usage::Validation)
    {
        let solve = &inputs.robot.profile.solve;
        let under = conditions(loaded, &inputs.robot.model, solve.load);
        for (row, q) in loaded.q.iter().enumerate() {
            let Some(q) = q else { continue };
            let root_from_link = robot.root_from_link_under(q, &under[row]);
            let joints = joint_values(inputs, name, row);
            let is_out = |row: usize, subject: &str| {
                let key = |subject: &str| (name.clone(), row, subject.to_owned());
                left_out.contains(&key(subject))
                    || body_of(subject).is_some_and(|body| left_out.contains(&key(&body)))
            };
            let mut push =
                |subject: &str, residual: nalgebra::Vector3<f64>, rotation_rad: Option<f64>| {
                    rows.push(ResidualRow {
                        recording: name.clone(),
                        row: loaded.poses.rows[row],
                        time_s: loaded.poses.t.as_ref().map(|t| t[row]),
                        subject: subject.to_owned(),
                        residual_m: residual.into(),
                        rotation_rad,
                        normalized: None,
                        used: !is_out(row, subject),
                        joints: joints.clone(),
                    });
                };
            for (contact_name, contact) in &inputs.robot.profile.contacts {
                if contact.recordings.contains(name)
                    && let Some(off) = miss(inputs, contact_name, robot, &root_from_link)
                {
                    push(contact_name, off, None);
                }
            }
            for (body_name, body) in &inputs.robot.profile.bodies {
                let tracker_from_link = robot.tracker_from_root * root_from_link[body.link.index()];
                match &body.kind {
                    BodyKind::Pose => {
                        let seen = tracks[body_name]
                            .in_recording(name)
                            .get(row)
                            .copied()
                            .flatten();
                        if let (Some(mount), Some(seen)) = (robot.mounts.get(body_name), seen) {
                            let predicted = tracker_from_link * mount;
                            let turn =
                                so3::log(&(seen.rotation.inverse() * predicted.rotation)).norm();
                            push(
                                body_name,
                                predicted.translation.vector - seen.translation.vector,
                                Some(turn),
                            );
                        }
                    }
                    BodyKind::Markers { names, .. } => {
                        for (i, marker) in names.iter().enumerate() {
                            let seen = loaded.poses.markers.get(marker).and_then(|t| t[row]);
                            let from_points = robot
                                .points
                                .get(body_name)
                                .and_then(|p| p.get(marker))
                                .copied();
                            let from_template = || {
                                let template = tracks[body_name].template.as_ref()?;
                                Some(robot.mounts.get(body_name)? * template.points.get(i)?)
                            };
                            if let (Some(on_link), Some(seen)) =
                                (from_points.or_else(from_template), seen)
                            {
                                push(
                                    marker,
                                    (tracker_from_link * on_link).coords - seen.coords,
                                    None,
                                );
                            }
                        }
                    }
                }
            }
        }
    }
    rows
}
