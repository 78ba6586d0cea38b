//! `A_i X = Z B_i`: the closed-form start, Gauss–Newton, the certificate.

use nalgebra::Isometry3;
use serde::{Deserialize, Serialize};

use crate::{
    certificate::certificate,
    input::{HandEyeError, check, check_axes},
    problem::{HandEyeWeights, Weights, linearize, moved, solve12},
    start::start,
};

/// Solution of `A_i X = Z B_i`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct HandEye {
    /// X.
    pub x: Isometry3<f64>,
    /// Z.
    pub z: Isometry3<f64>,
    /// Covariance of the right perturbations `[ω_x; v_x; ω_z; v_z]` (12 × 12, row-major), scaled by the
    /// residuals; `None` when there are no degrees of freedom left.
    pub covariance: Option<Vec<f64>>,
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
    /// Gauss–Newton steps taken.
    pub iterations: usize,
}

/// A relative gap below this is rounding of the 19 × 19 eigenproblem.
const CERTIFIED: f64 = 1e-6;
const MAX_STEPS: usize = 50;

/// Solves `A_i X = Z B_i`.
///
/// # Errors
/// [`HandEyeError`] for unusable input and for motions about a single axis.
pub fn solve_ax_zb(
    a: &[Isometry3<f64>],
    b: &[Isometry3<f64>],
    weights: HandEyeWeights,
) -> Result<HandEye, HandEyeError> {
    check(a, b, 3)?;
    check_axes(a)?;
    let w = Weights::of(weights);
    let (mut x, mut z) = start(a, b, w);
    let mut iterations = 0;
    let mut system = linearize(a, b, &x, &z, w);
    for _ in 0..MAX_STEPS {
        iterations += 1;
        let Some(step) = solve12(&system) else { break };
        let (nx, nz) = (
            moved(&x, &step.fixed_rows::<6>(0).into_owned()),
            moved(&z, &step.fixed_rows::<6>(6).into_owned()),
        );
        let next = linearize(a, b, &nx, &nz, w);
        let decrement = -system.1.dot(&step);
        if next.2 > system.2 * (1.0 + 1e-12) {
            break;
        }
        (x, z, system) = (nx, nz, next);
        if decrement <= 1e-18 * (1.0 + system.2) {
            break;
        }
    }
    let (gap, least_eigenvalue) = certificate(a, b, &x, &z, w);
    let n = a.len() as f64;
    let (mut st, mut sr) = (0.0, 0.0);
    for (a, b) in a.iter().zip(b) {
        let (l, r) = (a * x, z * b);
        st += (l.translation.vector - r.translation.vector).norm_squared();
        sr += l.rotation.angle_to(&r.rotation).powi(2);
    }
    let freedom = 6.0 * n - 12.0;
    let covariance = (freedom > 0.0)
        .then(|| nalgebra::Cholesky::new(system.0))
        .flatten()
        .map(|c| {
            let c = c.inverse() * (system.2 / freedom);
            c.transpose().as_slice().to_vec()
        });
    Ok(HandEye {
        x,
        z,
        covariance,
        rms_translation: (st / n).sqrt(),
        rms_rotation: (sr / n).sqrt(),
        certified: gap <= CERTIFIED,
        gap,
        least_eigenvalue,
        iterations,
    })
}
