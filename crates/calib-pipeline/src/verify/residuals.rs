//! Residuals of the fit, one row per marker or body and pose, for the report and `residuals.csv`.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use calib_core::{MeasurementId, MeasurementKind};
use calib_geometry::so3;
use calib_profile::{BodyKind, Contact, Usage};
use calib_report::ResidualRow;
use nalgebra::{Isometry3, Vector3};

use crate::formulate::contacts::miss;
use crate::formulate::formulation::MlFit;
use crate::formulate::kinematics::Calibration;
use crate::prepare::conditions::conditions;
use crate::prepare::inputs::{Inputs, Loaded};
use crate::prepare::tracks::BodyTrack;
use crate::verify::deviations::joint_values;

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
    if fit.formulation.contacts.contains_key(&measurement.name) {
        return measurement.name.clone();
    }
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
    let mut rows = Vec::new();
    let mut subjects: BTreeMap<String, Arc<str>> = BTreeMap::new();
    for (name, loaded) in inputs
        .recordings
        .iter()
        .filter(|(_, r)| r.spec.usage != Usage::Validation)
    {
        let solve = &inputs.robot.profile.solve;
        let under = conditions(loaded, &inputs.robot, solve.load);
        let recording: Arc<str> = name.as_str().into();
        for (row, q) in loaded.q.iter().enumerate() {
            let Some(q) = q else { continue };
            let root_from_link = robot.root_from_link_under(q, &under[row]);
            let sample = Sample {
                inputs,
                tracks,
                robot,
                loaded,
                row,
                tracker_from_link: root_from_link
                    .iter()
                    .map(|link| robot.tracker_from_root * link)
                    .collect(),
            };
            let joints: Arc<[_]> = joint_values(inputs, name, row).into();
            let differences = sample.contacts(&root_from_link).into_iter();
            let differences = differences.chain(sample.bodies());
            rows.extend(differences.map(|d| {
                ResidualRow {
                    recording: Arc::clone(&recording),
                    row: loaded.poses.rows[row],
                    time_s: loaded.poses.t.as_ref().map(|t| t[row]),
                    used: !sample.is_out(&left_out, &d.subject),
                    subject: Arc::clone(
                        subjects
                            .entry(d.subject)
                            .or_insert_with_key(|s| s.as_str().into()),
                    ),
                    residual_m: d.position.into(),
                    rotation_rad: d.rotation,
                    normalized: None,
                    joints: joints.clone(),
                }
            }));
        }
    }
    rows
}

/// One row of a recording, and where the robot's links are then.
struct Sample<'a> {
    inputs: &'a Inputs,
    tracks: &'a BTreeMap<String, BodyTrack>,
    robot: &'a Calibration,
    loaded: &'a Loaded,
    row: usize,
    tracker_from_link: Vec<Isometry3<f64>>,
}

/// Predicted − measured.
struct Difference {
    /// The marker, body or contact.
    subject: String,
    /// m, in the tracker's frame.
    position: Vector3<f64>,
    /// rad, for a body's pose.
    rotation: Option<f64>,
}

impl Sample<'_> {
    /// Whether the solver left the marker, body or contact out.
    fn is_out(&self, left_out: &BTreeSet<(String, usize, String)>, subject: &str) -> bool {
        let key = |subject: &str| (self.loaded.name.clone(), self.row, subject.to_owned());
        // Points computed from one body are one measurement: it is left out under the body's name.
        let holds = |body: &&String| match &self.inputs.robot.profile.bodies[*body].kind {
            BodyKind::Markers { names, .. } => names.iter().any(|m| m == subject),
            BodyKind::Pose => false,
        };
        left_out.contains(&key(subject))
            || (self.inputs.robot.profile.bodies.keys())
                .find(holds)
                .is_some_and(|body| left_out.contains(&key(body)))
    }

    /// How far each touch misses.
    fn contacts(&self, root_from_link: &[Isometry3<f64>]) -> Vec<Difference> {
        let contacts = self.inputs.robot.profile.contacts.iter();
        let touched = contacts.filter(|(_, c)| c.recordings.contains(&self.loaded.name));
        let missed = |(name, _): (&String, &Contact)| {
            Some(Difference {
                subject: name.clone(),
                position: miss(
                    self.inputs,
                    name,
                    self.robot,
                    root_from_link,
                    (self.loaded, self.row),
                )?,
                rotation: None,
            })
        };
        touched.filter_map(missed).collect()
    }

    fn bodies(&self) -> Vec<Difference> {
        let bodies = self.inputs.robot.profile.bodies.iter();
        bodies
            .flat_map(|(name, body)| {
                let tracker_from_link = &self.tracker_from_link[body.link.index()];
                match &body.kind {
                    BodyKind::Pose => Vec::from_iter(self.body_pose(name, tracker_from_link)),
                    BodyKind::Markers { names, .. } => self.markers(name, names, tracker_from_link),
                }
            })
            .collect()
    }

    fn body_pose(&self, name: &str, tracker_from_link: &Isometry3<f64>) -> Option<Difference> {
        let track = &self.tracks[name];
        let poses = track.in_recording(&self.loaded.name);
        let seen = poses.get(self.row).copied().flatten()?;
        let predicted = tracker_from_link * self.robot.mounts.get(name)?;
        let rotation = so3::log(&(seen.rotation.inverse() * predicted.rotation));
        Some(Difference {
            subject: name.to_owned(),
            position: track.off(&self.loaded.name, &predicted, &seen),
            rotation: Some(rotation.norm()),
        })
    }

    fn markers(
        &self,
        body: &str,
        names: &[String],
        tracker_from_link: &Isometry3<f64>,
    ) -> Vec<Difference> {
        let points = self.robot.points.get(body);
        let difference = |(i, marker): (usize, &String)| {
            let seen = self.loaded.poses.markers.get(marker)?[self.row]?;
            let from_points = points.and_then(|p| p.get(marker)).copied();
            let from_template = || {
                let template = self.tracks[body].template.as_ref()?;
                Some(self.robot.mounts.get(body)? * template.points.get(i)?)
            };
            let on_link = from_points.or_else(from_template)?;
            Some(Difference {
                subject: marker.clone(),
                position: (tracker_from_link * on_link).coords - seen.coords,
                rotation: None,
            })
        };
        names.iter().enumerate().filter_map(difference).collect()
    }
}
