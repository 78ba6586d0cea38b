//! Residuals of a sphere that are a pattern, not noise.
//!
//! ```text
//! e = |x − m| − r = r₀ + u·c + Σ_h a_h Y_h(u) + noise,   Y_h: the five harmonics of the second degree       (1)
//! F = ((RSS₀ − RSS₁)/5) / (RSS₁/(ν − 5))  ~  F(5, ν − 5)    if there are none                             (2)
//! ```
//!
//! A tracker whose scale differs by direction, a marker that is seen from one side only, or a joint that is no ball bend a sphere into an
//! ellipsoid: the second degree. On a part of the sphere the pattern looks like a translation of the center: c changes when the a_h are free.

use calib_estimator::{chance::f_tail, measured::Cloud};
use nalgebra::{SMatrix, SVector, Vector3};

/// Degrees of freedom that the noise must keep beside the five harmonics.
const ENOUGH: usize = 6;
/// Columns of (1) without r₀.
const ALL: usize = 8;
/// Directions of the columns, relative to the strongest, that the samples do not see.
const UNSEEN: f64 = 1e-9;

/// The pattern, where (2) finds one.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Systematic {
    /// How far it moves the center.
    pub shift: Vector3<f64>,
    /// Root mean square of the pattern.
    amplitude: f64,
    /// Noise beside it.
    noise: f64,
    chance: f64,
}

impl Systematic {
    /// Tests the residuals about `center`, whose fit left `dof` degrees of freedom.
    pub fn of(
        cloud: &Cloud,
        center: &Vector3<f64>,
        weights: &[f64],
        dof: usize,
        significance: f64,
    ) -> Option<Self> {
        let free = dof.checked_sub(5).filter(|free| *free >= ENOUGH)? as f64;
        let sums = Sums::of(cloud, center, weights);
        let (without, rss) = sums.solve::<3>();
        let (with, left) = sums.solve::<ALL>();
        let noise2 = left.max(0.0) / free;
        let gain = (rss - left).max(0.0);
        let chance = f_tail(gain / 5.0 / noise2, 5.0, free);
        // e grows by u·c where the center is c too far back.
        let shift = without - with.fixed_rows::<3>(0);
        (chance < significance && shift.iter().all(|x| x.is_finite())).then(|| Self {
            shift,
            amplitude: (gain / sums.total).sqrt(),
            noise: (noise2 * cloud.points.len() as f64 / sums.total).sqrt(),
            chance,
        })
    }

    /// Why the residuals are not noise; `None` where the pattern is smaller than the noise and only widens the covariance.
    pub fn reason(&self) -> Option<String> {
        (self.amplitude > self.noise).then(|| {
            format!(
                "the residuals are systematic (second harmonics on the sphere, chance {:.1e}): their pattern of {:.3e} rms exceeds the \
                 noise of {:.3e} and moves the center by {:.3e}",
                self.chance,
                self.amplitude,
                self.noise,
                self.shift.norm()
            )
        })
    }
}

/// Normal equations of (1), each marker's mean taken off.
struct Sums {
    matrix: SMatrix<f64, ALL, ALL>,
    right: SVector<f64, ALL>,
    square: f64,
    total: f64,
}

impl Sums {
    fn of(cloud: &Cloud, center: &Vector3<f64>, weights: &[f64]) -> Self {
        let mut sums = Self {
            matrix: SMatrix::zeros(),
            right: SVector::zeros(),
            square: 0.0,
            total: 0.0,
        };
        for p in 0..cloud.markers() {
            let (mut mean, mut mean_e, mut total) = (SVector::<f64, ALL>::zeros(), 0.0, 0.0);
            let reference = (cloud.points[cloud.starts[p]] - center).norm();
            for k in cloud.range(p) {
                let w = cloud.weight(k) * weights.get(k).copied().unwrap_or(1.0);
                let d = cloud.points[k] - center;
                let length = d.norm();
                let u = d.try_normalize(0.0).unwrap_or_default();
                let e = length - reference;
                let row = SVector::<f64, ALL>::from([
                    u.x,
                    u.y,
                    u.z,
                    u.x * u.y,
                    u.y * u.z,
                    u.z * u.x,
                    u.x * u.x - u.y * u.y,
                    2.0 * u.z * u.z - u.x * u.x - u.y * u.y,
                ]);
                sums.matrix.ger(w, &row, &row, 1.0);
                sums.right += row * (w * e);
                sums.square += w * e * e;
                mean += row * w;
                mean_e += w * e;
                total += w;
            }
            sums.matrix.ger(-1.0 / total, &mean, &mean, 1.0);
            sums.right -= mean * (mean_e / total);
            sums.square -= mean_e * mean_e / total;
            sums.total += total;
        }
        sums
    }

    /// Coefficients of the first N columns (of these the first three), and what they leave of the square.
    fn solve<const N: usize>(&self) -> (Vector3<f64>, f64) {
        let matrix: SMatrix<f64, N, N> = self.matrix.fixed_view::<N, N>(0, 0).into_owned();
        let right: SVector<f64, N> = self.right.fixed_rows::<N>(0).into_owned();
        let eigen = calib_geometry::decompose::symmetric_eigen_small(&matrix);
        let mut found = SVector::<f64, N>::zeros();
        for k in 0..N {
            if eigen.values[k] > UNSEEN * eigen.values[N - 1] {
                let v = eigen.vectors.column(k);
                found += v * (v.dot(&right) / eigen.values[k]);
            }
        }
        (
            found.fixed_rows::<3>(0).into_owned(),
            self.square - right.dot(&found),
        )
    }
}
