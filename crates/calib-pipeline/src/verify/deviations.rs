//! Predicted against measured, one vector per marker or measured pose.

use std::collections::BTreeMap;

use calib_geometry::registration::rigid_registration;
use calib_profile::{Body, BodyKind, Usage};
use calib_report::{JointValue, Unit};
use nalgebra::{Isometry3, Point3, Vector3};

use crate::formulate::contacts::miss;
use crate::formulate::kinematics::Calibration;
use crate::prepare::conditions::conditions;
use crate::prepare::inputs::{Inputs, Loaded};
use crate::prepare::tracks::BodyTrack;

/// Recording, row from 0, and marker, body or contact.
pub(crate) type Key = (String, usize, String);

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
    /// Angle between predicted and measured orientation of the body, rad; `None` where it is not measured.
    pub angle: Option<f64>,
}

impl Deviation {
    pub(crate) fn key(&self) -> Key {
        (self.recording.clone(), self.row, self.subject.clone())
    }
}

/// Deviations of a robot from what the tracker saw of every body that a joint moves, in recordings of one use.
#[must_use]
pub fn deviations(
    inputs: &Inputs,
    tracks: &BTreeMap<String, BodyTrack>,
    robot: &Calibration,
    usage: impl Fn(Usage) -> bool,
) -> Vec<Deviation> {
    let profile = &inputs.robot.profile;
    let recordings = inputs.recordings.iter();
    let moved: Vec<(&String, &Body)> = profile
        .bodies
        .iter()
        .filter(|(_, body)| is_moved(inputs, body))
        .collect();
    let mounts: BTreeMap<&String, Isometry3<f64>> = moved
        .iter()
        .filter_map(|(name, body)| Some((*name, mount(robot, name, body, &tracks[*name])?)))
        .collect();
    let mut out = Vec::new();
    for (name, loaded) in recordings.filter(|(_, r)| usage(r.spec.usage)) {
        let under = conditions(loaded, &inputs.robot, profile.solve.load);
        for (row, q) in loaded.q.iter().enumerate() {
            let Some(q) = q else { continue };
            let root_from_link = robot.root_from_link_under(q, &under[row]);
            let mut push = |subject: &str, vector: Vector3<f64>, angle: Option<f64>| {
                out.push(Deviation {
                    recording: name.clone(),
                    row,
                    subject: subject.to_owned(),
                    vector,
                    angle,
                });
            };
            for (contact_name, contact) in &profile.contacts {
                if contact.recordings.contains(name)
                    && let Some(off) =
                        miss(inputs, contact_name, robot, &root_from_link, (loaded, row))
                {
                    push(contact_name, off, None);
                }
            }
            for (body_name, body) in &moved {
                let seen = OfBody {
                    name: body_name,
                    body,
                    track: &tracks[*body_name],
                    mount: mounts.get(body_name).copied(),
                    tracker_from_link: robot.tracker_from_root * root_from_link[body.link.index()],
                };
                seen.deviations(robot, loaded, row, &mut push);
            }
        }
    }
    out
}

/// `link_from_body`, body as its template has it. Three markers nearly on a line hardly determine a frame, and that of the fitted markers then
/// turns against that of the template: all markers together say how the body is mounted.
fn mount(
    robot: &Calibration,
    name: &str,
    body: &Body,
    track: &BodyTrack,
) -> Option<Isometry3<f64>> {
    let by_pattern = || {
        let BodyKind::Markers { names, .. } = &body.kind else {
            return None;
        };
        let template = track.template.as_ref()?;
        let fitted = robot.points.get(name)?;
        let on_link: Option<Vec<Point3<f64>>> =
            names.iter().map(|m| fitted.get(m).copied()).collect();
        let found = rigid_registration(&template.points, &on_link?, None).ok()?;
        Some(found.b_from_a)
    };
    by_pattern().or_else(|| robot.mounts.get(name).copied())
}

/// Whether a joint moves the body against the root.
pub(crate) fn is_moved(inputs: &Inputs, body: &Body) -> bool {
    let model = &inputs.robot.model;
    let chain = model.chain(model.root(), body.link);
    chain
        .iter()
        .any(|s| model.joint(s.joint).kind.axis().is_some())
}

/// Takes the name, the vector and the angle of a deviation.
type Push<'a> = dyn FnMut(&str, Vector3<f64>, Option<f64>) + 'a;

struct OfBody<'a> {
    name: &'a str,
    body: &'a Body,
    track: &'a BodyTrack,
    /// `link_from_body`, where the body has a frame.
    mount: Option<Isometry3<f64>>,
    tracker_from_link: Isometry3<f64>,
}

impl OfBody<'_> {
    fn deviations(&self, robot: &Calibration, loaded: &Loaded, row: usize, push: &mut Push<'_>) {
        let seen = self.track.in_recording(&loaded.name).get(row);
        let seen = seen.copied().flatten();
        let predicted = self.mount.map(|mount| self.tracker_from_link * mount);
        let pair = predicted.zip(seen);
        let angle = pair.map(|(predicted, seen)| predicted.rotation.angle_to(&seen.rotation));
        match &self.body.kind {
            // Points computed from one pose are one measurement.
            BodyKind::Markers { names, .. } if !self.track.is_computed => {
                for (i, marker) in names.iter().enumerate() {
                    let seen = loaded.poses.markers.get(marker).and_then(|t| t[row]);
                    if let Some((on_link, seen)) = self.on_link(robot, i, marker).zip(seen) {
                        push(marker, self.tracker_from_link * on_link - seen, angle);
                    }
                }
            }
            _ => {
                if let Some((predicted, seen)) = pair {
                    let off = self.track.off(&loaded.name, &predicted, &seen);
                    push(self.name, off, angle);
                }
            }
        }
    }

    /// Where a marker is on its link, by the fit or by the body's template.
    fn on_link(&self, robot: &Calibration, i: usize, marker: &str) -> Option<Point3<f64>> {
        let fitted = robot.points.get(self.name).and_then(|p| p.get(marker));
        fitted.copied().or_else(|| {
            let template = self.track.template.as_ref()?;
            Some(robot.mounts.get(self.name)? * template.points.get(i)?)
        })
    }
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
