//! Points of the bodies in a held-out recording: where they were seen, and where a robot predicts them.

use calib_profile::{Body, BodyKind};
use calib_urdf::JointId;
use nalgebra::{Isometry3, Point3, Vector3};

use std::collections::BTreeMap;

use crate::formulate::kinematics::Calibration;
use crate::prepare::conditions::Conditions;
use crate::prepare::inputs::{Inputs, Loaded};
use crate::prepare::tracks::BodyTrack;

/// Arms that stand for the orientation of a body that is measured as a pose, m: of the size of a tracking body.
const ARM: f64 = 0.1;

/// One point of a body, as it was seen and as it should have been.
pub(super) struct Seen<'a> {
    pub(super) row: usize,
    pub(super) body: &'a str,
    /// Number of the point on its body.
    pub(super) point: usize,
    pub(super) tracker_from_link: Isometry3<f64>,
    pub(super) predicted: Point3<f64>,
    pub(super) seen: Point3<f64>,
}

/// One held-out recording, and the robot that predicts it.
pub(super) struct View<'a> {
    pub(super) inputs: &'a Inputs,
    pub(super) tracks: &'a BTreeMap<String, BodyTrack>,
    pub(super) robot: &'a Calibration,
    pub(super) loaded: &'a Loaded,
    pub(super) under: &'a [Conditions],
}

impl<'a> View<'a> {
    /// All points, in the order of the rows; with joints moved by so much, rad or m.
    pub(super) fn points(&self, moved: &[(JointId, f64)]) -> Vec<Seen<'a>> {
        let mut out = Vec::new();
        for (row, q) in self.loaded.q.iter().enumerate() {
            let Some(mut q) = q.clone() else { continue };
            for (joint, by) in moved {
                q[joint.index()] += by;
            }
            let root_from_link = self.robot.root_from_link_under(&q, &self.under[row]);
            for (name, body) in &self.inputs.robot.profile.bodies {
                let tracker_from_link =
                    self.robot.tracker_from_root * root_from_link[body.link.index()];
                for (point, on_link, seen) in self.of_body(name, body, row) {
                    out.push(Seen {
                        row,
                        body: name,
                        point,
                        tracker_from_link,
                        predicted: tracker_from_link * on_link,
                        seen,
                    });
                }
            }
        }
        out
    }

    /// Points of a body in a row: number, place on the link, where it was seen.
    fn of_body(
        &self,
        name: &str,
        body: &Body,
        row: usize,
    ) -> Vec<(usize, Point3<f64>, Point3<f64>)> {
        let track = &self.tracks[name];
        match &body.kind {
            BodyKind::Markers { names, .. } if !track.is_computed => {
                let fitted = self.robot.points.get(name);
                let of_marker = |(k, marker): (usize, &String)| {
                    let known = fitted.and_then(|p| p.get(marker)).copied();
                    let on_link = known.or_else(|| {
                        let template = track.template.as_ref()?;
                        Some(self.robot.mounts.get(name)? * template.points.get(k)?)
                    });
                    let seen = self.loaded.poses.markers.get(marker)?[row]?;
                    Some((k, on_link?, seen))
                };
                names.iter().enumerate().filter_map(of_marker).collect()
            }
            _ => {
                let seen = track.in_recording(&self.loaded.name).get(row);
                let Some((mount, seen)) = self.robot.mounts.get(name).zip(seen.copied().flatten())
                else {
                    return Vec::new();
                };
                let arms = [Vector3::zeros(), Vector3::x(), Vector3::y(), Vector3::z()];
                let arms = arms.map(|arm| Point3::from(arm * ARM));
                let of_arm = |(k, arm): (usize, &Point3<f64>)| (k, mount * arm, seen * arm);
                arms.iter().enumerate().map(of_arm).collect()
            }
        }
    }
}
