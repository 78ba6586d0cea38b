//! What a hand-eye estimator answers: both transforms, their uncertainty, and what speaks against them.

use calib_estimator::{Estimate, Verdict};
use nalgebra::{Isometry3, SMatrix};
use serde::Serialize;

use crate::{correction::Explanation, direction::OpenDirection};

/// Covariance of the right perturbations `[ω_x; v_x; ω_z; v_z]`, rad and m.
pub type Covariance = SMatrix<f64, 12, 12>;

/// Noise of one measured pose against its prediction.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[non_exhaustive]
pub struct HandEyeNoise {
    /// Position, one coordinate, m.
    pub sigma_t: f64,
    /// Orientation, about one axis, rad.
    pub sigma_r: f64,
    /// Degrees of freedom behind both, the smaller of the two; `None` where both were stated.
    pub degrees_of_freedom: Option<f64>,
}

/// Solution of `A_i X = Z B_i`.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct HandEye {
    /// Id of the estimator.
    pub estimator: &'static str,
    /// X.
    pub x: Isometry3<f64>,
    /// Z.
    pub z: Isometry3<f64>,
    /// Mean square error from the noise below; `None` where the poses do not fix both transforms.
    pub covariance: Option<Covariance>,
    /// Noise that the covariance rests on.
    pub noise: HandEyeNoise,
    /// rms over poses of |R_A t_X + t_A − R_Z t_B − t_Z|, m.
    pub rms_translation: f64,
    /// rms over poses of the angle between R_A R_X and R_Z R_B, rad.
    pub rms_rotation: f64,
    /// Bound (3) on how far f is above the global minimum, relative to f (absolute where f vanishes).
    pub gap: f64,
    /// Smallest eigenvalue of H in (2), relative to the largest of Q.
    pub least_eigenvalue: f64,
    /// The gap proves the global optimum.
    pub certified: bool,
    /// Poses used.
    pub used: usize,
    /// Rows with gross errors, which were not used.
    pub rejected: Vec<usize>,
    /// A structural mistake in the tables that explains the residuals.
    pub explanation: Option<Explanation>,
    /// The direction of the measured poses is not observable; `None` where it is, where a mistake explains them, and where it was not asked.
    pub open_direction: Option<OpenDirection>,
    /// [`Verdict::Ok`], or [`Verdict::Weak`] with the reason beside it.
    pub verdict: Verdict,
    /// Why the verdict is not `ok`, with numbers.
    pub reason: Option<String>,
    /// Gauss–Newton steps taken; 0 for closed forms.
    pub iterations: usize,
}

impl HandEye {
    /// Standard deviations of `[ω_x; v_x; ω_z; v_z]`, rad and m.
    #[must_use]
    pub fn sigmas(&self) -> Option<[f64; 12]> {
        let variances = self.covariance.as_ref()?.diagonal();
        Some(variances.map(|v| v.max(0.0).sqrt()).into())
    }
}

impl Estimate for HandEye {
    type Known = ();

    const NOTHING: () = ();

    calib_estimator::estimate_fields!();

    fn is_finite(&self) -> bool {
        let finite = |t: &Isometry3<f64>| t.to_homogeneous().iter().all(|v| v.is_finite());
        finite(&self.x)
            && finite(&self.z)
            && self
                .covariance
                .iter()
                .all(|c| c.iter().all(|v| v.is_finite()))
            && [
                self.noise.sigma_t,
                self.noise.sigma_r,
                self.rms_translation,
                self.rms_rotation,
                self.gap,
                self.least_eigenvalue,
            ]
            .iter()
            .all(|v| v.is_finite())
    }
}
