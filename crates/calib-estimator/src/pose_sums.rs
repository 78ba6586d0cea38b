//! What the poses of one body say about their rotations, before any noise model.
//!
//! ```text
//! A = [ R_i  −I ],     A'A = [ nI  −n R̄ᵀ ; −n R̄  nI ]                                  (1)
//! singular values of A:   s = √( n (1 ± σ_k(R̄)) )                                       (2)
//! M = Σ (R_i − R̄)ᵀ(R_i − R̄),   λ_k(M) = n (1 − σ_k²)   ⇒   s₆² = λ_min / (1 + σ₁)       (3)
//! ```
//!
//! The weakest direction of M is the axis that all rotations share, seen from the body; `R̄` carries it to the world.

use calib_geometry::{
    decompose::{svd_small, symmetric_eigen_small},
    row_qr::RowQr,
};
use nalgebra::{Matrix3, Unit, Vector3};

use crate::{
    chance::{chi2_tail, f_tail},
    measured::{DataError, Pose, RowWeights},
    verdict::Verdict,
};

/// Relative singular value below which rounding decides.
const RANK: f64 = 1e-9;
/// Below this λ_min/n the sums (1) lose more than four digits, and a QR of the stacked rows takes over.
const SUMS_ENOUGH: f64 = 1e-4;
/// Orientation noise that is assumed where nothing limits it (a body whose origin lies in the center
/// shows none in its positions): 5°, the paper's worst case.
const WORST_SIGMA_R: f64 = 0.0873;

/// Sums over poses, and the linear solution.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct PoseSums {
    /// Poses.
    pub n: usize,
    /// Sum of their weights: `n` where all are alike. It stands for n in (1) to (3).
    pub total: f64,
    /// Mean rotation matrix (not a rotation).
    pub mean_r: Matrix3<f64>,
    /// Mean translation.
    pub mean_t: Vector3<f64>,
    /// Eigenvalues of M, ascending.
    pub lambda: Vector3<f64>,
    /// Their directions in the body.
    pub directions: Matrix3<f64>,
    /// `−Vᵀ Σ (R_i − R̄)ᵀ (t_i − t̄)`: right side of the normal equations in that basis.
    pub right: Vector3<f64>,
}

impl PoseSums {
    /// # Errors
    /// [`DataError`] for a pose that is not finite or not a rotation.
    pub fn of(poses: &[Option<Pose>]) -> Result<Self, DataError> {
        Self::weighted(poses, RowWeights::default())
    }

    /// The same with a weight for each row: sums and means are weighted.
    ///
    /// # Errors
    /// As [`Self::of`]; also for weights that are none.
    pub fn weighted(poses: &[Option<Pose>], weights: RowWeights<'_>) -> Result<Self, DataError> {
        weights.check(poses.len())?;
        let (mut n, mut total) = (0, 0.0);
        let (mut sum_r, mut sum_gram) = (Matrix3::zeros(), Matrix3::zeros());
        let (mut sum_t, mut sum_rt) = (Vector3::zeros(), Vector3::zeros());
        // Translations relative to the first: a far origin costs no digits.
        let first = poses
            .iter()
            .flatten()
            .next()
            .map_or(Vector3::zeros(), |p| p.translation);
        for (row, pose) in poses.iter().enumerate() {
            let Some(pose) = pose else { continue };
            let w = weights.of(row);
            if w == 0.0 {
                continue;
            }
            sum_gram += pose.check(row)? * w;
            let t = pose.translation - first;
            sum_r += pose.rotation * w;
            sum_t += t * w;
            sum_rt += pose.rotation.tr_mul(&t) * w;
            n += 1;
            total += w;
        }
        let count = if n == 0 { 1.0 } else { total };
        let (mean_r, mean_t) = (sum_r / count, sum_t / count);
        let m = sum_gram - mean_r.tr_mul(&sum_r);
        let eigen = symmetric_eigen_small(&m);
        let mut sums = Self {
            n,
            total: count,
            mean_r,
            mean_t: first + mean_t,
            lambda: eigen.values,
            directions: eigen.vectors,
            right: -eigen.vectors.tr_mul(&(sum_rt - sum_r.tr_mul(&mean_t))),
        };
        if eigen.values[0] < SUMS_ENOUGH * count {
            sums.refine(poses, weights);
        }
        Ok(sums)
    }

    /// The same from a QR of the centered rows: for nearly single-axis motion.
    fn refine(&mut self, poses: &[Option<Pose>], weights: RowWeights<'_>) {
        let mut qr = RowQr::<4>::default();
        for (row, pose) in poses.iter().enumerate() {
            let Some(pose) = pose else { continue };
            let root = weights.of(row).sqrt();
            let d = (pose.rotation - self.mean_r) * root;
            let t = (pose.translation - self.mean_t) * root;
            for k in 0..3 {
                qr.push([d[(k, 0)], d[(k, 1)], d[(k, 2)], t[k]]);
            }
        }
        let r = qr.factor();
        let svd = svd_small(&r.fixed_view::<3, 3>(0, 0).into_owned());
        let c = svd.u.tr_mul(&r.fixed_view::<3, 1>(0, 3));
        // Ascending, as the eigenvalues are.
        for k in 0..3 {
            let s = svd.s[2 - k];
            self.lambda[k] = s * s;
            self.directions.set_column(k, &svd.v.column(2 - k));
            self.right[k] = -s * c[2 - k];
        }
    }

    /// Body point of least squares over the strongest directions; `skip` leaves that many weakest ones out.
    #[must_use]
    pub fn body_point(&self, skip: usize) -> Vector3<f64> {
        (skip..3)
            .map(|k| self.directions.column(k) * (self.right[k] / self.lambda[k]))
            .sum()
    }

    /// Center that belongs to a body point: `o = R̄ p + t̄`.
    #[must_use]
    pub fn center(&self, body_point: &Vector3<f64>) -> Vector3<f64> {
        self.mean_r * body_point + self.mean_t
    }

    /// Largest and smallest singular values of `[R_i, −I]`.
    #[must_use]
    pub fn extreme_singular_values(&self) -> (f64, f64) {
        let n = self.total;
        let largest = (1.0 - self.lambda[0] / n).clamp(0.0, 1.0).sqrt();
        (
            (n * (1.0 + largest)).sqrt(),
            (self.lambda[0].max(0.0) / (1.0 + largest)).sqrt(),
        )
    }

    /// The shared axis, in the body and in the world.
    #[must_use]
    pub fn axis(&self) -> (Unit<Vector3<f64>>, Unit<Vector3<f64>>) {
        let body = Unit::new_normalize(self.directions.column(0).into_owned());
        (body, Unit::new_normalize(self.mean_r * body.into_inner()))
    }

    /// Verdict by rank alone: exact data, or too few.
    #[must_use]
    pub fn rank_verdict(&self) -> Option<Verdict> {
        let n = self.total;
        if self.n < 2 {
            Some(Verdict::TooFew)
        } else if self.lambda[2] <= (RANK * RANK) * n {
            Some(Verdict::NoRotation)
        } else {
            let (s1, s6) = self.extreme_singular_values();
            (self.n < 3 || s6 <= RANK * s1).then_some(Verdict::SingleAxis)
        }
    }

    /// Tests: is the spread of the rotations about a second axis, or at all, more than noise?
    ///
    /// `stated` is the tracker's σ_r (rad) and `spread` multiplies its square (2 where both bodies of a joint
    /// are measured); `bound` is the largest σ_r that the residuals allow, for trackers that do not state theirs.
    #[must_use]
    pub fn noise_verdict(
        &self,
        stated: Option<f64>,
        bound: f64,
        spread: f64,
        significance: f64,
    ) -> Option<(Verdict, String)> {
        let n = self.n as f64;
        let (_, s6) = self.extreme_singular_values();
        let dof = 2.0 * n - 4.0;
        let (sigma_r, stated) = match stated {
            Some(sigma_r) => (sigma_r * spread.sqrt(), true),
            None => (bound.min(WORST_SIGMA_R), false),
        };
        let tail = |x: f64, dof: f64| {
            if stated {
                chi2_tail(x, dof)
            } else {
                f_tail(x / dof, dof, dof)
            }
        };
        let source = if stated { "stated" } else { "largest possible" };
        // Σ ‖R_i − R̄‖² = 2 Σ |δ_i|²
        let turning = self.lambda.sum() / 2.0 / (sigma_r * sigma_r);
        let chance = tail(turning, 3.0 * n - 3.0);
        if chance > significance {
            return Some((
                Verdict::NoRotation,
                format!(
                    "the body turns by {:.3}° rms, which {} poses do not distinguish from the {source} orientation noise of {:.3}° \
                     (chance {chance:.1e})",
                    (self.lambda.sum() / 2.0 / self.total).sqrt().to_degrees(),
                    self.n,
                    sigma_r.to_degrees()
                ),
            ));
        }
        let second = 2.0 * s6 * s6 / (sigma_r * sigma_r);
        let chance = tail(second, dof);
        if chance > significance {
            return Some((
                Verdict::SingleAxis,
                format!(
                    "no second axis shows: the spread about other axes than the first is {:.2} times the {source} orientation \
                     noise of {:.3}°, which {} poses do not distinguish from noise (chance {chance:.1e}, accepted \
                     below {:.0e}); every point of the axis fits equally well",
                    (second / dof).sqrt(),
                    sigma_r.to_degrees(),
                    self.n,
                    significance
                ),
            ));
        }
        None
    }
}
