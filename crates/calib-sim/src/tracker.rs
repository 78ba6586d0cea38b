//! What the tracker sees of the bodies in one pose of the robot: eqs. (3) and (4) of the crate's page.

use calib_geometry::{Twist, se3};
use calib_profile::{BodyKind, Profile, Simulation};
use calib_recording::Poses;
use nalgebra::Isometry3;
use rand::RngExt;
use rand_chacha::ChaCha12Rng;

use crate::{normal3, robot::TrueRobot};

/// A tracker before the true robot.
pub(crate) struct Tracker<'a> {
    pub(crate) profile: &'a Profile,
    pub(crate) plan: &'a Simulation,
    pub(crate) robot: &'a TrueRobot,
}

impl Tracker<'_> {
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
            // tracker_from_body = tracker_from_root · FK'(q_true) · link_from_body'
            let tracker_from_body = self.robot.tracker_from_root
                * root_from_link[body.link.index()]
                * self.robot.mounts[name];
            match &body.kind {
                BodyKind::Pose => {
                    let error = Twist::new(
                        normal3(rng, noise.body.angle * noise_times),
                        normal3(rng, noise.body.position * noise_times),
                    );
                    let seen = rng.random::<f64>() >= noise.occluded;
                    let sample = seen.then(|| tracker_from_body * se3::exp(&error));
                    poses.bodies.entry(name.clone()).or_default().push(sample);
                }
                BodyKind::Markers { names, .. } => {
                    for marker in names {
                        let p_body = self.plan.mounts[name].markers[marker];
                        let error = normal3(rng, noise.marker * noise_times);
                        let seen = rng.random::<f64>() >= noise.occluded;
                        let sample = seen.then(|| tracker_from_body * p_body + error);
                        let track = poses.markers.entry(marker.clone()).or_default();
                        track.push(sample);
                    }
                }
            }
        }
    }
}
