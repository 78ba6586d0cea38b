//! What the tracker sees of the bodies in one pose of the robot: eqs. (3) and (4) of the crate's page.

use std::collections::BTreeSet;

use calib_core::measurement::error_of_sight;
use calib_geometry::{Twist, se3};
use calib_profile::{Body, BodyKind, Profile, RecordingSpec, Simulation};
use calib_recording::Poses;
use nalgebra::{Cholesky, Isometry3, Matrix3, Point3, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha12Rng;

use crate::{normal3, robot::TrueRobot};

/// A tracker before the true robot.
#[derive(Clone)]
pub(crate) struct Tracker<'a> {
    pub(crate) profile: &'a Profile,
    pub(crate) plan: &'a Simulation,
    pub(crate) robot: &'a TrueRobot,
    /// Factor of the covariances that the cameras cause: 1 per coordinate on average.
    scale: f64,
    /// Bodies that see the tracker: the noise is of that pose.
    inverse: BTreeSet<String>,
}

impl<'a> Tracker<'a> {
    /// Before the robot in these postures (indicated joint positions by joint index), over which the marker noise is on average what the profile
    /// states: with cameras it differs by place and direction.
    pub(crate) fn before<'q>(
        profile: &'a Profile,
        plan: &'a Simulation,
        robot: &'a TrueRobot,
        postures: impl Iterator<Item = &'q Vec<f64>>,
    ) -> Self {
        let mut tracker = Self {
            profile,
            plan,
            robot,
            scale: 1.0,
            inverse: BTreeSet::new(),
        };
        if profile.plan.cameras.is_empty() {
            return tracker;
        }
        let (mut sum, mut count) = (0.0, 0_u32);
        for q in postures {
            let root_from_link = robot.model.forward_kinematics(q);
            for (name, body) in &profile.bodies {
                let BodyKind::Markers { names, .. } = &body.kind else {
                    continue;
                };
                let Some(mount) = plan.mounts.get(name) else {
                    continue;
                };
                let tracker_from_body = tracker.tracker_from_body(name, body, &root_from_link);
                for marker in names {
                    let at = tracker_from_body * mount.markers[marker];
                    if let Some(shape) = profile.plan.covariance(&at) {
                        sum += shape.trace();
                        count += 1;
                    }
                }
            }
        }
        if sum > 0.0 {
            tracker.scale = 3.0 * f64::from(count) / sum;
        }
        tracker
    }

    /// The same for the bodies of a recording, as its columns say what is measured.
    pub(crate) fn in_recording(mut self, name: &str) -> Self {
        let recording = self.profile.recordings.get(name);
        self.inverse = recording.map_or_else(BTreeSet::new, RecordingSpec::inverse_bodies);
        self
    }

    /// `tracker_from_root · FK'(q_true) · link_from_body'`.
    fn tracker_from_body(
        &self,
        name: &str,
        body: &Body,
        root_from_link: &[Isometry3<f64>],
    ) -> Isometry3<f64> {
        self.robot.tracker_from_root * root_from_link[body.link.index()] * self.robot.mounts[name]
    }

    /// A factor of the covariance of a marker at a place, by the cameras, in units of σ²; `None` without cameras.
    fn factor(&self, at: &Point3<f64>) -> Option<Matrix3<f64>> {
        let shape = self.profile.plan.covariance(at)? * self.scale;
        Some(Cholesky::new(shape)?.l())
    }

    /// Appends one sample of each body to `poses`; `root_from_link` by link, and what the noise of bodies and markers is multiplied by.
    pub(crate) fn observe(
        &self,
        bodies: &[String],
        root_from_link: &[Isometry3<f64>],
        noise_times: f64,
        poses: &mut Poses,
        rng: &mut ChaCha12Rng,
    ) {
        let noise = &self.plan.noise;
        for name in bodies {
            let Some(body) = self.profile.bodies.get(name) else {
                continue;
            };
            let tracker_from_body = self.tracker_from_body(name, body, root_from_link);
            match &body.kind {
                BodyKind::Pose => {
                    let inverse = self.inverse.contains(name);
                    // The instrument's line of sight in the axes of the error.
                    let there = tracker_from_body.translation.vector;
                    let line = match inverse {
                        false => tracker_from_body.rotation.inverse() * there,
                        true => there,
                    };
                    let [angle, position] = [noise.body.angle, noise.body.position];
                    let mut drawn =
                        |across: f64, along| drawn_error(rng, (across, along), &line, noise_times);
                    let error = Twist::new(
                        drawn(angle, noise.body_sight_rad),
                        drawn(position, noise.body_sight),
                    );
                    let seen = rng.random::<f64>() >= noise.occluded;
                    let error = se3::exp(&error);
                    let sample = seen.then(|| match inverse {
                        false => tracker_from_body * error,
                        true => error.inverse() * tracker_from_body,
                    });
                    poses.bodies.entry(name.clone()).or_default().push(sample);
                }
                BodyKind::Markers { names, .. } => {
                    for marker in names {
                        let p_body = self.plan.mounts[name].markers[marker];
                        let at = tracker_from_body * p_body;
                        let levels = (noise.marker, noise.marker_sight);
                        let error = drawn_error(rng, levels, &at.coords, noise_times);
                        let seen = rng.random::<f64>() >= noise.occluded;
                        let error = self.factor(&at).map_or(error, |factor| factor * error);
                        let sample = seen.then(|| at + error);
                        let track = poses.markers.entry(marker.clone()).or_default();
                        track.push(sample);
                    }
                }
            }
        }
    }
}

/// Three components with σ across a line and, where that differs, along it.
fn drawn_error(
    rng: &mut ChaCha12Rng,
    (across, along): (f64, Option<f64>),
    line: &Vector3<f64>,
    times: f64,
) -> Vector3<f64> {
    match along {
        None => normal3(rng, across * times),
        Some(along) => error_of_sight(&normal3(rng, 1.0), line, [across * times, along * times]),
    }
}
