//! `A_i X = X B_i` for relative motions.

use calib_geometry::{decompose, so3};
use nalgebra::{DMatrix, DVector, Isometry3, Matrix3, Translation3, Vector3};

use crate::input::{HandEyeError, ONE_AXIS, check, two_axes};

/// Solves `A_i X = X B_i` for relative motions A, B (Park & Martin 1994, then least squares for the
/// translation). Returns X.
///
/// # Errors
/// [`HandEyeError`] for unusable input and for motions about a single axis.
pub fn solve_ax_xb(
    a: &[Isometry3<f64>],
    b: &[Isometry3<f64>],
) -> Result<Isometry3<f64>, HandEyeError> {
    check(a, b, 2)?;
    let logs: Vec<(Vector3<f64>, Vector3<f64>)> = a
        .iter()
        .zip(b)
        .map(|(a, b)| (so3::log(&a.rotation), so3::log(&b.rotation)))
        .collect();
    two_axes(logs.iter().map(|l| l.0))?;
    // log R_A = R_X log R_B
    let m: Matrix3<f64> = logs.iter().map(|(a, b)| a * b.transpose()).sum();
    let rotation = so3::nearest_rotation(&m).ok_or(HandEyeError::OneAxis {
        ratio: 0.0,
        limit: ONE_AXIS,
    })?;
    // (R_A − I) t_X = R_X t_B − t_A
    let mut lhs = DMatrix::zeros(3 * a.len(), 3);
    let mut rhs = DVector::zeros(3 * a.len());
    for (i, (a, b)) in a.iter().zip(b).enumerate() {
        let ra = *a.rotation.to_rotation_matrix().matrix();
        lhs.fixed_view_mut::<3, 3>(3 * i, 0)
            .copy_from(&(ra - Matrix3::identity()));
        rhs.fixed_rows_mut::<3>(3 * i)
            .copy_from(&(rotation * b.translation.vector - a.translation.vector));
    }
    let t = decompose::solve_least_squares(&lhs, &rhs, 1e-12).x;
    Ok(Isometry3::from_parts(
        Translation3::new(t[0], t[1], t[2]),
        rotation,
    ))
}

/// Relative motions of a list of poses: consecutive `T_i⁻¹ T_{i+1}`, the input of [`solve_ax_xb`].
#[must_use]
pub fn relative_motions(poses: &[Isometry3<f64>]) -> Vec<Isometry3<f64>> {
    poses.windows(2).map(|w| w[0].inverse() * w[1]).collect()
}
