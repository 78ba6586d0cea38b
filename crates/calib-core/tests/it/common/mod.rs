//! Chains with known truth: the forward kinematics here is written a second time, with plain
//! isometries, so that it cannot share a mistake with the crate.
#![allow(dead_code, reason = "the benchmark uses a part")]
use calib_core::{
    Axis, Chart, EdgeId, EffectKind, FrameId, GroupId, MarkerObservation, NoiseKind, PointId,
    PoseNoise, PoseObservation, Problem, Role,
};
use nalgebra::{Isometry3, Point3, Translation3, Unit, UnitQuaternion, Vector3};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

pub fn rng(seed: u64) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(seed)
}

pub fn normal(rng: &mut impl Rng) -> f64 {
    StandardNormal.sample(rng)
}

pub fn normal3(rng: &mut impl Rng) -> Vector3<f64> {
    Vector3::new(normal(rng), normal(rng), normal(rng))
}

pub fn pose(x: f64, y: f64, z: f64, roll: f64, pitch: f64, yaw: f64) -> Isometry3<f64> {
    Isometry3::from_parts(
        Translation3::new(x, y, z),
        UnitQuaternion::from_euler_angles(roll, pitch, yaw),
    )
}

pub fn axis(x: f64, y: f64, z: f64) -> Unit<Vector3<f64>> {
    Unit::new_normalize(Vector3::new(x, y, z))
}

/// A displacement with rotation σ (rad) and translation σ (m) per component.
pub fn jitter(rng: &mut impl Rng, rotation: f64, translation: f64) -> Isometry3<f64> {
    Isometry3::from_parts(
        Translation3::from(normal3(rng) * translation),
        UnitQuaternion::from_scaled_axis(normal3(rng) * rotation),
    )
}

/// One joint: nominal origin in the link before, axis in the joint frame.
#[derive(Clone)]
pub struct Link {
    pub origin: Isometry3<f64>,
    pub axis: Axis,
}

pub fn revolute(origin: Isometry3<f64>, a: Unit<Vector3<f64>>) -> Link {
    Link {
        origin,
        axis: Axis::Revolute(a),
    }
}

pub fn prismatic(origin: Isometry3<f64>, a: Unit<Vector3<f64>>) -> Link {
    Link {
        origin,
        axis: Axis::Prismatic(a),
    }
}

pub fn motion(axis: &Axis, q: f64) -> Isometry3<f64> {
    match axis {
        Axis::Revolute(a) => Isometry3::from_parts(
            Translation3::identity(),
            UnitQuaternion::from_axis_angle(a, q),
        ),
        Axis::Prismatic(a) => Isometry3::from_parts(
            Translation3::from(a.into_inner() * q),
            UnitQuaternion::identity(),
        ),
    }
}

/// A 6R arm with the proportions of a UR10-like robot but no parallel axes.
pub fn six_r() -> Vec<Link> {
    vec![
        revolute(pose(0.0, 0.0, 0.13, 0.0, 0.0, 0.0), axis(0.0, 0.0, 1.0)),
        revolute(pose(0.02, 0.12, 0.05, 0.1, 0.0, 0.2), axis(0.0, 1.0, 0.0)),
        revolute(pose(0.03, -0.1, 0.45, 0.0, 0.3, 0.0), axis(0.0, 1.0, 0.2)),
        revolute(pose(0.05, 0.02, 0.40, 0.0, 0.0, 0.0), axis(1.0, 0.1, 0.0)),
        revolute(pose(0.08, 0.05, 0.10, 0.2, 0.0, 0.0), axis(0.0, 0.0, 1.0)),
        revolute(pose(0.02, 0.06, 0.09, 0.0, 0.0, 0.1), axis(0.0, 1.0, 0.0)),
    ]
}

/// What is free in a chain problem.
#[derive(Clone)]
pub struct Free {
    pub world: Chart,
    pub origins: Vec<Chart>,
    pub offsets: Vec<bool>,
    pub mount: Chart,
    pub points: bool,
    /// (rotation, translation) prior σ of origins, and σ of offsets.
    pub prior: Option<(f64, f64)>,
}

impl Free {
    pub fn nothing(n: usize) -> Self {
        Self {
            world: Chart::none(),
            origins: vec![Chart::none(); n],
            offsets: vec![false; n],
            mount: Chart::none(),
            points: false,
            prior: None,
        }
    }

    pub fn frames_and_offsets(n: usize) -> Self {
        Self {
            world: Chart::full(),
            offsets: (0..n).map(|i| i > 0 && i + 1 < n).collect(),
            mount: Chart::full(),
            ..Self::nothing(n)
        }
    }

    pub fn everything(n: usize) -> Self {
        Self {
            world: Chart::full(),
            origins: vec![Chart::full(); n],
            offsets: vec![true; n],
            mount: Chart::full(),
            points: false,
            prior: Some((0.02, 0.01)),
        }
    }
}

/// A serial chain seen by a tracker, and the truth behind its measurements.
pub struct Chain {
    pub links: Vec<Link>,
    pub world: Isometry3<f64>,
    pub mount: Isometry3<f64>,
    pub markers: Vec<Point3<f64>>,
    /// True origins and offsets.
    pub true_origins: Vec<Isometry3<f64>>,
    pub true_offsets: Vec<f64>,
    pub true_world: Isometry3<f64>,
    pub true_mount: Isometry3<f64>,
    pub q: Vec<Vec<f64>>,
}

/// Handles into the problem that was built from a [`Chain`].
pub struct Handles {
    pub problem: Problem,
    pub tracker: FrameId,
    pub base: FrameId,
    pub body: FrameId,
    pub world: EdgeId,
    pub mount: EdgeId,
    pub origins: Vec<EdgeId>,
    pub joints: Vec<EdgeId>,
    pub points: Vec<PointId>,
    pub markers: GroupId,
}

impl Handles {
    /// Joints that deviate from their readings in each pose by a σ that is estimated, rad to begin with.
    pub fn scattering_joints(&mut self, sigma: f64) {
        let noise = self
            .problem
            .noise_group("joints", NoiseKind::Joint, sigma, true);
        for joint in &self.joints {
            self.problem.joint_noise(*joint, noise);
        }
    }
}

pub fn square_markers() -> Vec<Point3<f64>> {
    vec![
        Point3::new(0.06, 0.01, 0.0),
        Point3::new(-0.03, 0.055, 0.01),
        Point3::new(-0.04, -0.035, 0.02),
        Point3::new(0.02, -0.06, 0.045),
    ]
}

impl Chain {
    /// Truth equal to nominal, no poses yet.
    pub fn nominal(links: Vec<Link>) -> Self {
        let n = links.len();
        let true_origins = links.iter().map(|l| l.origin).collect();
        let world = pose(1.2, -0.7, 0.3, 0.3, -0.2, 1.1);
        let mount = pose(0.03, -0.02, 0.08, 0.4, 0.1, -0.6);
        Self {
            links,
            world,
            mount,
            markers: square_markers(),
            true_origins,
            true_offsets: vec![0.0; n],
            true_world: world,
            true_mount: mount,
            q: Vec::new(),
        }
    }

    pub fn posed(mut self, rng: &mut impl Rng, poses: usize, range: f64) -> Self {
        self.q = (0..poses)
            .map(|_| {
                self.links
                    .iter()
                    .map(|l| match l.axis {
                        Axis::Revolute(_) => rng.random_range(-range..range),
                        Axis::Prismatic(_) => rng.random_range(-0.2..0.2),
                    })
                    .collect()
            })
            .collect();
        self
    }

    /// Moves the truth away from nominal.
    pub fn deviate(
        mut self,
        rng: &mut impl Rng,
        free: &Free,
        rotation: f64,
        translation: f64,
    ) -> Self {
        let within = |chart: &Chart, d: Isometry3<f64>| {
            let c = chart.coordinates(&d);
            let mut kept = nalgebra::Vector6::zeros();
            for i in 0..6 {
                if chart.free()[i] {
                    kept[i] = c[i];
                }
            }
            chart.displacement(&kept)
        };
        self.true_world = self.world * within(&free.world, jitter(rng, rotation, translation));
        self.true_mount = self.mount * within(&free.mount, jitter(rng, rotation, translation));
        for (i, l) in self.links.iter().enumerate() {
            self.true_origins[i] =
                l.origin * within(&free.origins[i], jitter(rng, rotation, translation));
            if free.offsets[i] {
                self.true_offsets[i] = normal(rng)
                    * match l.axis {
                        Axis::Revolute(_) => rotation,
                        Axis::Prismatic(_) => translation,
                    };
            }
        }
        self
    }

    /// True `tracker_from_body` at given readings plus extra joint motion.
    pub fn tracker_from_body(&self, q: &[f64], extra: &[f64]) -> Isometry3<f64> {
        let mut x = self.true_world;
        for (i, l) in self.links.iter().enumerate() {
            x = x
                * self.true_origins[i]
                * motion(
                    &l.axis,
                    q[i] + self.true_offsets[i] + extra.get(i).copied().unwrap_or(0.0),
                );
        }
        x * self.true_mount
    }

    /// The problem without observations.
    pub fn problem(&self, free: &Free, sigma: f64) -> Handles {
        let n = self.links.len();
        let mut p = Problem::new(self.q.len());
        let tracker = p.frame("tracker");
        let base = p.frame("base");
        let world = p.unknown(
            "tracker_from_base",
            tracker,
            base,
            self.world,
            free.world.clone(),
        );
        p.set_role(world, Role::World, None);
        let mut last = base;
        let (mut origins, mut joints) = (Vec::new(), Vec::new());
        for i in 0..n {
            let name = format!("j{}", i + 1);
            let at = p.frame(&format!("{name}_origin"));
            let link = p.frame(&format!("link{}", i + 1));
            let origin = p.unknown(
                &format!("{name}.origin"),
                last,
                at,
                self.links[i].origin,
                free.origins[i].clone(),
            );
            p.set_role(origin, Role::JointOrigin, Some(&name));
            if let Some((r, t)) = free.prior {
                p.set_prior(origin, Some(r), Some(t));
            }
            let q = self.q.iter().map(|row| row[i]).collect();
            let joint = p.joint(&name, at, link, self.links[i].axis, q);
            if free.offsets[i] {
                let prior = free.prior.map(|(r, t)| match self.links[i].axis {
                    Axis::Revolute(_) => r,
                    Axis::Prismatic(_) => t,
                });
                p.free_effect(joint, EffectKind::ZeroOffset, prior);
            }
            origins.push(origin);
            joints.push(joint);
            last = link;
        }
        let body = p.frame("body");
        let mount = p.unknown("body_mount", last, body, self.mount, free.mount.clone());
        p.set_role(mount, Role::Mount, None);
        let points = self
            .markers
            .iter()
            .enumerate()
            .map(|(i, m)| {
                let name = format!("m{}", i + 1);
                if free.points {
                    p.unknown_point(&name, body, *m, None)
                } else {
                    p.known_point(&name, body, *m)
                }
            })
            .collect();
        let markers = p.noise_group("markers", NoiseKind::Position, sigma, false);
        Handles {
            problem: p,
            tracker,
            base,
            body,
            world,
            mount,
            origins,
            joints,
            points,
            markers,
        }
    }

    /// Marker observations with noise; `joint_noise` moves each joint by its own draw.
    pub fn observe(&self, rng: &mut impl Rng, h: &mut Handles, sigma: f64, joint_noise: f64) {
        let mut seen = Vec::new();
        for (s, q) in self.q.iter().enumerate() {
            let extra: Vec<f64> = q.iter().map(|_| normal(rng) * joint_noise).collect();
            let x = self.tracker_from_body(q, &extra);
            for (m, p) in self.markers.iter().enumerate() {
                seen.push(MarkerObservation {
                    sample: s,
                    point: h.points[m],
                    position: x * p + normal3(rng) * sigma,
                    shape: None,
                });
            }
        }
        h.problem
            .markers("body", h.tracker, h.body, h.markers, seen);
    }

    /// Marker observations where the joints move by more than their readings: `extra(sample)`.
    pub fn observe_moved(
        &self,
        rng: &mut impl Rng,
        h: &mut Handles,
        sigma: f64,
        extra: impl Fn(usize) -> Vec<f64>,
    ) {
        let mut seen = Vec::new();
        for (s, q) in self.q.iter().enumerate() {
            let x = self.tracker_from_body(q, &extra(s));
            for (m, p) in self.markers.iter().enumerate() {
                seen.push(MarkerObservation {
                    sample: s,
                    point: h.points[m],
                    position: x * p + normal3(rng) * sigma,
                    shape: None,
                });
            }
        }
        h.problem
            .markers("body", h.tracker, h.body, h.markers, seen);
    }

    /// Body poses with noise.
    pub fn observe_poses(
        &self,
        rng: &mut impl Rng,
        h: &mut Handles,
        orientation: f64,
        position: f64,
        joint_noise: f64,
    ) {
        let o = h.problem.noise_group(
            "orientation",
            NoiseKind::Orientation,
            orientation.max(1e-9),
            false,
        );
        let t = h
            .problem
            .noise_group("position", NoiseKind::Position, position.max(1e-9), false);
        let seen = self
            .q
            .iter()
            .enumerate()
            .map(|(s, q)| {
                let extra: Vec<f64> = q.iter().map(|_| normal(rng) * joint_noise).collect();
                PoseObservation {
                    sample: s,
                    pose: self.tracker_from_body(q, &extra) * jitter(rng, orientation, position),
                    inverse: false,
                }
            })
            .collect();
        h.problem.poses(
            "body pose",
            h.tracker,
            h.body,
            PoseNoise::Split {
                orientation: o,
                position: t,
            },
            seen,
        );
    }
}

/// Central differences of `f` by coordinates, step h.
pub fn central(
    f: impl Fn(&calib_core::Values) -> nalgebra::DVector<f64>,
    at: &calib_core::Values,
    parameters: &[usize],
    h: f64,
) -> nalgebra::DMatrix<f64> {
    let columns: Vec<nalgebra::DVector<f64>> = parameters
        .iter()
        .map(|&p| {
            let mut up = at.clone();
            let mut down = at.clone();
            up.0[p] += h;
            down.0[p] -= h;
            (f(&up) - f(&down)) / (2.0 * h)
        })
        .collect();
    nalgebra::DMatrix::from_columns(&columns)
}
