//! Simulated joints with a fixed seed: the paper's grids, noise of markers and poses.

use calib_cor::{EstimatorError, Input, Options, Outcome, Pose, estimator};
use nalgebra::{Matrix3, Point3, UnitQuaternion, Vector3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// Runs an estimator with those of the options that it uses.
pub fn fit(id: &str, input: &Input<'_>, options: &Options) -> Result<Outcome, EstimatorError> {
    let info = estimator(id)?;
    info.run(input, &options.only(info.options))
}

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
        // The normal's own probability integral would need erf; bits are enough here.
        rand::RngExt::random::<f64>(&mut self.0)
    }
}

/// Rz(β)·Rx(α) over a grid, degrees, `[from, to]` with n steps each.
pub fn grid(z: [f64; 2], nz: usize, x: [f64; 2], nx: usize) -> Vec<UnitQuaternion<f64>> {
    let steps = |[from, to]: [f64; 2], n: usize| {
        (0..n).map(move |k| (from + (to - from) * k as f64 / (n - 1).max(1) as f64).to_radians())
    };
    steps(z, nz)
        .flat_map(|b| {
            steps(x, nx).map(move |a| {
                UnitQuaternion::from_axis_angle(&Vector3::z_axis(), b)
                    * UnitQuaternion::from_axis_angle(&Vector3::x_axis(), a)
            })
        })
        .collect()
}

/// The hand: z −45..135°, x −45..80°, at the paper's 63, 36, 16 and 9 poses.
pub fn hand(n: usize) -> Vec<UnitQuaternion<f64>> {
    let (nz, nx) = match n {
        63 => (9, 7),
        36 => (6, 6),
        16 => (4, 4),
        _ => (3, 3),
    };
    grid([-45.0, 135.0], nz, [-45.0, 80.0], nx)
}

/// The head: pan ±90°, tilt −20..40°.
pub fn head(n: usize) -> Vec<UnitQuaternion<f64>> {
    let (nz, nx) = match n {
        63 => (9, 7),
        36 => (6, 6),
        16 => (4, 4),
        _ => (3, 3),
    };
    grid([-90.0, 90.0], nz, [-20.0, 40.0], nx)
}

/// Marker at `p_body` on a ball joint at `center`.
pub fn marker(
    turns: &[UnitQuaternion<f64>],
    center: &Vector3<f64>,
    p_body: &Vector3<f64>,
    sigma: f64,
    noise: &mut Noise,
) -> Vec<Option<Point3<f64>>> {
    turns
        .iter()
        .map(|r| Some(Point3::from(center + r * p_body + noise.vector(sigma))))
        .collect()
}

/// Body whose center sits at `p_body` in it.
pub fn poses(
    turns: &[UnitQuaternion<f64>],
    center: &Vector3<f64>,
    p_body: &Vector3<f64>,
    sigma_t: f64,
    sigma_r: f64,
    noise: &mut Noise,
) -> Vec<Option<Pose>> {
    turns
        .iter()
        .map(|r| {
            let error = noise.vector(sigma_r);
            let measured = r * UnitQuaternion::from_scaled_axis(error);
            Some(Pose {
                rotation: measured.to_rotation_matrix().into_inner(),
                translation: center - r * p_body + noise.vector(sigma_t),
            })
        })
        .collect()
}

/// One-axis sweep about n through n samples of `degrees`.
pub fn sweep(axis: Vector3<f64>, degrees: f64, n: usize) -> Vec<UnitQuaternion<f64>> {
    let axis = nalgebra::Unit::new_normalize(axis);
    (0..n)
        .map(|k| {
            let angle = (degrees * k as f64 / (n - 1).max(1) as f64).to_radians();
            UnitQuaternion::from_axis_angle(&axis, angle)
        })
        .collect()
}

/// Sums of squared errors and of what a covariance predicts.
#[derive(Default)]
pub struct Tally {
    pub n: f64,
    pub error2: f64,
    pub error4: f64,
    pub mean: Vector3<f64>,
    pub predicted: f64,
    /// Mahalanobis squares of the errors.
    pub mahalanobis: f64,
    pub inside95: f64,
}

impl Tally {
    pub fn add(&mut self, error: Vector3<f64>, covariance: &Matrix3<f64>) {
        /// χ²(0.95) of three degrees of freedom.
        const CHI2_3_95: f64 = 7.815;
        let e2 = error.norm_squared();
        self.n += 1.0;
        self.error2 += e2;
        self.error4 += e2 * e2;
        self.mean += error;
        self.predicted += covariance.trace();
        if let Some(c) = covariance.cholesky() {
            let d = error.dot(&c.solve(&error));
            self.mahalanobis += d;
            self.inside95 += f64::from(u8::from(d <= CHI2_3_95));
        }
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

    pub fn bias(&self) -> f64 {
        self.mean.norm() / self.n
    }
}
