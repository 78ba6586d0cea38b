//! Simulated hinges and two-axis joints with a fixed seed.

use calib_aor::{FrameAxes, FrameSample, Pose};
use nalgebra::{Isometry3, Point3, Unit, UnitQuaternion, Vector3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

pub type Track = Vec<Option<Point3<f64>>>;

pub struct Noise(ChaCha8Rng);

impl Noise {
    pub fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    pub fn normal(&mut self) -> f64 {
        StandardNormal.sample(&mut self.0)
    }

    pub fn vector(&mut self, sigma: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| sigma * self.normal())
    }

    pub fn uniform(&mut self) -> f64 {
        rand::RngExt::random::<f64>(&mut self.0)
    }

    pub fn turn(&mut self, sigma: f64) -> UnitQuaternion<f64> {
        UnitQuaternion::from_scaled_axis(self.vector(sigma))
    }
}

/// A hinge through `point` along `axis`.
#[derive(Debug, Clone, Copy)]
pub struct Hinge {
    pub point: Point3<f64>,
    pub axis: Unit<Vector3<f64>>,
}

impl Hinge {
    pub fn slanted() -> Self {
        Self {
            point: Point3::new(1.2, -0.8, 0.9),
            axis: Unit::new_normalize(Vector3::new(-0.18, -0.83, 0.53)),
        }
    }

    pub fn turn(&self, angle: f64) -> Isometry3<f64> {
        let turn = UnitQuaternion::from_axis_angle(&self.axis, angle);
        Isometry3::from_parts((self.point.coords - turn * self.point.coords).into(), turn)
    }

    /// Markers spread around the axis at a radius: places at angle zero.
    pub fn layout(&self, markers: usize, radius: f64) -> Vec<Point3<f64>> {
        let e1 = self.axis.cross(&Vector3::x()).normalize();
        let e2 = self.axis.cross(&e1);
        (0..markers)
            .map(|p| {
                let phi = 0.6 * p as f64;
                let r = radius * (1.0 + 0.15 * (1.7 * p as f64).sin());
                let h = 0.3 * radius * (2.3 * p as f64).cos();
                self.point + (e1 * phi.cos() + e2 * phi.sin()) * r + self.axis.into_inner() * h
            })
            .collect()
    }

    /// marker × frame
    pub fn tracks(
        &self,
        places: &[Point3<f64>],
        angles: &[f64],
        sigma: f64,
        noise: &mut Noise,
    ) -> Vec<Track> {
        places
            .iter()
            .map(|p| {
                angles
                    .iter()
                    .map(|a| Some(self.turn(*a) * p + noise.vector(sigma)))
                    .collect()
            })
            .collect()
    }

    pub fn poses(
        &self,
        body: &Isometry3<f64>,
        angles: &[f64],
        st: f64,
        sr: f64,
        noise: &mut Noise,
    ) -> Vec<Option<Pose>> {
        angles
            .iter()
            .map(|a| {
                let truth = self.turn(*a) * body;
                let measured = truth.rotation * noise.turn(sr);
                Some(Pose {
                    rotation: measured.to_rotation_matrix().into_inner(),
                    translation: truth.translation.vector + noise.vector(st),
                })
            })
            .collect()
    }
}

pub fn steps(from_deg: f64, to_deg: f64, n: usize) -> Vec<f64> {
    (0..n)
        .map(|k| (from_deg + (to_deg - from_deg) * k as f64 / (n - 1).max(1) as f64).to_radians())
        .collect()
}

/// A two-axis joint and its grid recording.
#[derive(Debug, Clone, Copy)]
pub struct Joint {
    pub world_from_joint: Isometry3<f64>,
    pub body_from_joint: Isometry3<f64>,
    pub axes: FrameAxes,
}

impl Joint {
    pub fn hand() -> Self {
        Self {
            world_from_joint: Isometry3::new(
                Vector3::new(1.2, -0.8, 0.9),
                Vector3::new(0.4, -0.7, 1.1),
            ),
            body_from_joint: Isometry3::new(
                Vector3::new(0.0, -0.1, 0.0),
                Vector3::new(-0.9, 0.3, 0.5),
            ),
            axes: FrameAxes::default(),
        }
    }

    pub fn sample(
        &self,
        proximal: f64,
        distal: f64,
        st: f64,
        sr: f64,
        noise: &mut Noise,
    ) -> FrameSample {
        let truth = self.world_from_joint
            * self.axes.turned(proximal, distal)
            * self.body_from_joint.inverse();
        let measured = truth.rotation * noise.turn(sr);
        FrameSample {
            world_from_body: Some(Pose {
                rotation: measured.to_rotation_matrix().into_inner(),
                translation: truth.translation.vector + noise.vector(st),
            }),
            proximal,
            distal,
            weight: 1.0,
        }
    }

    /// The paper's hand: z −45..135° proximal, x −45..80° distal.
    pub fn grid(&self, n: usize, st: f64, sr: f64, noise: &mut Noise) -> Vec<FrameSample> {
        let mut out = Vec::new();
        for p in steps(-45.0, 135.0, n) {
            for d in steps(-45.0, 80.0, n) {
                out.push(self.sample(p, d, st, sr, noise));
            }
        }
        out
    }
}

/// Mean of squares and of predictions.
#[derive(Default)]
pub struct Tally {
    pub n: f64,
    pub error2: f64,
    pub error4: f64,
    pub predicted: f64,
}

impl Tally {
    pub fn add(&mut self, error2: f64, predicted: f64) {
        self.n += 1.0;
        self.error2 += error2;
        self.error4 += error2 * error2;
        self.predicted += predicted;
    }

    pub fn mse(&self) -> f64 {
        self.error2 / self.n
    }

    /// bound / MSE with its Monte-Carlo error.
    pub fn efficiency(&self, bound: f64) -> (f64, f64) {
        let mse = self.mse();
        let spread = (self.error4 / self.n - mse * mse).max(0.0).sqrt() / self.n.sqrt();
        (bound / mse, bound / mse * spread / mse)
    }
}
