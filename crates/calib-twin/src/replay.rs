//! The recordings of a session as another robot would have given them: the same postures, the same markers in sight.
//!
//! ```text
//! q' = q + N(0, σ_q²)                                              once for each posture             (1)
//! marker  = tracker_from_root · FK(q') · link_from_body · exp(ξ_b) · p + N(0, σ_m² Σ)                (2)
//! body    = tracker_from_root · FK(q') · link_from_body · exp(ξ)                                     (3)
//! ```
//!
//! FK is [`Calibration::root_from_link_under`], with all effects of the joints: the forward model of the pipeline, not its linearization. ξ_b is the
//! noise of a body's pose on its link, Σ the shape of a marker's covariance where one is known.

use calib_core::EffectKind;
use calib_core::measurement::error_of_sight;
use calib_geometry::{Twist, se3};
use calib_pipeline::formulate::kinematics::Calibration;
use calib_pipeline::prepare::conditions::conditions;
use calib_pipeline::prepare::inputs::{Inputs, Loaded};
use calib_pipeline::prepare::mixed::Mixed;
use calib_pipeline::prepare::tracks::BodyTrack;
use calib_profile::{Body, BodyKind};
use nalgebra::{Cholesky, Isometry3, Matrix3, Point3, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha12Rng;
use rand_distr::StandardNormal;
use std::collections::BTreeMap;

use crate::fault::Fault;
use crate::noise::Noise;

/// Joint values that agree to this are one posture, as in the pipeline, rad or m.
const EQUAL: f64 = 1e-7;

/// A robot before the tracker, with its noise and what is wrong with it.
#[derive(Debug, Clone, Copy)]
pub struct Replay<'a> {
    /// Recordings whose postures and gaps are taken.
    pub inputs: &'a Inputs,
    /// Templates of bodies, for markers whose places the robot does not hold.
    pub tracks: &'a BTreeMap<String, BodyTrack>,
    /// The true robot.
    pub robot: &'a Calibration,
    /// Its noise.
    pub noise: &'a Noise,
    /// What is wrong.
    pub fault: Option<&'a Fault>,
}

impl Replay<'_> {
    /// The recordings.
    #[must_use]
    pub fn recordings(&self, rng: &mut ChaCha12Rng) -> Inputs {
        let mut inputs = self.inputs.clone();
        let load = inputs.robot.profile.solve.load;
        let mut robot = self.robot.clone();
        if let Some(fault) = self.fault {
            fault.put_into(&mut robot);
        }
        for loaded in inputs.recordings.values_mut() {
            let under = conditions(loaded, &inputs.robot, load);
            let mut last: Option<Vec<f64>> = None;
            for row in 0..loaded.q.len() {
                let Some(q) = loaded.q[row].clone() else {
                    continue;
                };
                let same = |last: &Vec<f64>| {
                    let mut pairs = last.iter().zip(&q);
                    pairs.all(|(a, b)| (a - b).abs() <= EQUAL)
                };
                if !last.as_ref().is_some_and(same) {
                    let noisy = self.noise.joints.iter().filter(|(_, sigma)| **sigma > 0.0);
                    let drawn = noisy.map(|(joint, sigma)| {
                        (*joint, *sigma * rng.sample::<f64, _>(StandardNormal))
                    });
                    let drawn: Vec<_> = drawn.collect();
                    set_noise(&mut robot, self.robot, self.fault, &drawn);
                }
                let links = robot.root_from_link_under(&q, &under[row]);
                self.observe(&robot, loaded, row, &links, rng);
                last = Some(q);
            }
        }
        inputs
    }

    /// Equations (2) and (3) for everything that was seen in a row.
    fn observe(
        &self,
        robot: &Calibration,
        loaded: &mut Loaded,
        row: usize,
        root_from_link: &[Isometry3<f64>],
        rng: &mut ChaCha12Rng,
    ) {
        for (name, body) in &self.inputs.robot.profile.bodies {
            let slip = self.fault.and_then(|f| f.slip(name, &loaded.name, row));
            let slip = slip.unwrap_or_else(Isometry3::identity);
            let link = robot.tracker_from_root * root_from_link[body.link.index()];
            let mount = robot.mounts.get(name).copied();
            match &body.kind {
                BodyKind::Pose => {
                    let inverse = loaded.meta.inverse_bodies.contains(name);
                    let seen = loaded.poses.bodies.get_mut(name);
                    let seen = seen.and_then(|track| track.get_mut(row)?.as_mut());
                    if let (Some(seen), Some(mount)) = (seen, mount) {
                        let levels = self.noise.bodies.get(name).copied();
                        let there = link * mount * slip;
                        let at = there.translation.vector;
                        let line = match inverse {
                            false => there.rotation.inverse() * at,
                            true => at,
                        };
                        let error = match self.noise.sights.get(name).zip(levels) {
                            None => drawn(levels, rng),
                            Some((sight, levels)) => {
                                let [turn, shift] = sight.levels(levels, line.norm());
                                let turn = error_of_sight(&vector(rng), &line, turn);
                                let shift = error_of_sight(&vector(rng), &line, shift);
                                se3::exp(&Twist::new(turn, shift))
                            }
                        };
                        *seen = match inverse {
                            false => there * error,
                            true => error.inverse() * there,
                        };
                    }
                }
                BodyKind::Markers { names, .. } => {
                    let frame = mount.unwrap_or_else(Isometry3::identity);
                    // Of markers that were computed from a fitted body, the noise is the body's.
                    let levels = self.noise.poses.get(name).or(self.noise.bodies.get(name));
                    let moved = frame * slip * drawn(levels.copied(), rng) * frame.inverse();
                    let mixed = loaded.mixed.get(name).and_then(|m| m.get(row)?.as_ref());
                    let errors = mixed.and_then(|m| self.of_mixed(m, names, rng));
                    for (i, marker) in names.iter().enumerate() {
                        let shape = shape(loaded, marker, row);
                        let track = loaded.poses.markers.get_mut(marker);
                        let seen = track.and_then(|track| track.get_mut(row)?.as_mut());
                        let at = self.on_link(robot, (name, body), (i, marker));
                        if let (Some(seen), Some(at)) = (seen, at) {
                            let sigma = self.noise.markers.get(marker).copied();
                            let sigma = sigma.unwrap_or(0.0);
                            let there = link * (moved * at);
                            let sight = self.noise.sights.get(name);
                            let own = || match (shape, sight) {
                                (Some(shape), _) => shape * vector(rng) * sigma,
                                (None, None) => vector(rng) * sigma,
                                (None, Some(sight)) => {
                                    let line = there.coords;
                                    let [_, shift] = sight.levels([0.0, sigma], line.norm());
                                    error_of_sight(&vector(rng), &line, shift)
                                }
                            };
                            let error = errors.as_ref().map_or_else(own, |all| all[i]);
                            *seen = there + error;
                        }
                    }
                }
            }
        }
    }

    /// Errors of the points of a body of very many markers in a row that shows some of them.
    fn of_mixed(
        &self,
        mixed: &Mixed,
        names: &[String],
        rng: &mut ChaCha12Rng,
    ) -> Option<Vec<Vector3<f64>>> {
        let root = Cholesky::new(mixed.shape)?.l();
        let drawn = names.iter().map(|marker| {
            let sigma = self.noise.markers.get(marker).copied();
            root * vector(rng) * sigma.unwrap_or(0.0)
        });
        mixed.back(&drawn.collect::<Vec<_>>())
    }

    /// A marker in the frame of its link.
    fn on_link(
        &self,
        robot: &Calibration,
        (name, body): (&String, &Body),
        (i, marker): (usize, &String),
    ) -> Option<Point3<f64>> {
        let known = robot.points.get(name).and_then(|p| p.get(marker));
        known.copied().or_else(|| {
            let template = self.tracks.get(name)?.template.as_ref()?;
            let mount = robot.mounts.get(name).copied().or(body.mount)?;
            Some(mount * template.points.get(i)?)
        })
    }
}

/// Equation (1): the noise of readings acts as zero offsets of one posture.
fn set_noise(
    robot: &mut Calibration,
    quiet: &Calibration,
    fault: Option<&Fault>,
    drawn: &[(calib_urdf::JointId, f64)],
) {
    robot.effects.clone_from(&quiet.effects);
    if let Some(fault) = fault {
        fault.put_into(robot);
    }
    for (joint, by) in drawn {
        let own = &mut robot.effects[joint.index()].coefficients;
        *own.entry(EffectKind::ZeroOffset).or_insert(0.0) += by;
    }
}

/// A factor of the shape of a marker's covariance.
fn shape(loaded: &Loaded, marker: &str, row: usize) -> Option<Matrix3<f64>> {
    let shape = loaded.shapes.get(marker).and_then(|s| *s.get(row)?);
    shape.and_then(Cholesky::new).map(|root| root.l())
}

fn vector(rng: &mut ChaCha12Rng) -> Vector3<f64> {
    Vector3::from_fn(|_, _| rng.sample::<f64, _>(StandardNormal))
}

/// exp(ξ), ξ ~ N(0, diag(turn², shift²)); the identity without levels.
fn drawn(levels: Option<[f64; 2]>, rng: &mut ChaCha12Rng) -> Isometry3<f64> {
    levels.map_or_else(Isometry3::identity, |[turn, shift]| {
        se3::exp(&Twist::new(vector(rng) * turn, vector(rng) * shift))
    })
}
