//! Rotations: exponential, logarithm, Jacobians, and the check that a matrix is one.
//!
//! Formulas after Solà, Deray & Atchuthan, "A micro Lie theory for state estimation in robotics"
//! (2018), eqs. 143–147; the small-angle branches are their Taylor series.

use nalgebra::{Matrix3, Quaternion, Rotation3, UnitQuaternion, Vector3};

use crate::decompose::svd_small;

/// Below this angle (rad) the coefficients come from their Taylor series: the truncation error of
/// the series is under 1e-14 here, and the closed forms lose digits to cancellation below it.
pub(crate) const SERIES_BELOW: f64 = 0.25;

/// A 3×3 matrix was given as a rotation and is none.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error(
    "not a rotation: |RᵀR − I| is {orthogonality_defect:.2e} (limit {limit:.0e}) and det R is {determinant:.6}"
)]
pub struct NotRotation {
    /// Largest entry of |RᵀR − I|.
    pub orthogonality_defect: f64,
    /// det R; +1 for a rotation, −1 for a reflection.
    pub determinant: f64,
    /// The defect that was allowed.
    pub limit: f64,
}

/// `[v]ₓ`, the matrix of the cross product: `[v]ₓ w = v × w`.
#[must_use]
pub fn skew(v: &Vector3<f64>) -> Matrix3<f64> {
    v.cross_matrix()
}

/// Rotation of angle ‖φ‖ (rad) about φ.
#[must_use]
pub fn exp(phi: &Vector3<f64>) -> UnitQuaternion<f64> {
    let half = 0.5 * phi.norm();
    // q = (cos θ/2, ½ sinc(θ/2) φ)
    let sinc_half = if half < 1e-4 {
        1.0 - half * half / 6.0
    } else {
        half.sin() / half
    };
    UnitQuaternion::new_normalize(Quaternion::from_parts(half.cos(), phi * (0.5 * sinc_half)))
}

/// Rotation vector φ with `exp(φ) = r`, ‖φ‖ ≤ π (rad).
#[must_use]
pub fn log(r: &UnitQuaternion<f64>) -> Vector3<f64> {
    let (w, v) = if r.w < 0.0 {
        (-r.w, -r.imag())
    } else {
        (r.w, r.imag())
    };
    let sin_half = v.norm();
    // θ = 2 atan2(|v|, w); φ = θ v/|v|
    if sin_half < 1e-10 {
        return v * (2.0 / w);
    }
    v * (2.0 * sin_half.atan2(w) / sin_half)
}

/// `(1 − cos θ)/θ²`, `(θ − sin θ)/θ³`: the two coefficients of the SO(3) Jacobian.
pub(crate) fn jacobian_coefficients(theta: f64) -> (f64, f64) {
    let t2 = theta * theta;
    if theta < SERIES_BELOW {
        let b =
            0.5 - t2 * (1.0 / 24.0 - t2 * (1.0 / 720.0 - t2 * (1.0 / 40_320.0 - t2 / 3_628_800.0)));
        let c = 1.0 / 6.0
            - t2 * (1.0 / 120.0
                - t2 * (1.0 / 5_040.0 - t2 * (1.0 / 362_880.0 - t2 / 39_916_800.0)));
        (b, c)
    } else {
        let s = (0.5 * theta).sin();
        (2.0 * s * s / t2, (theta - theta.sin()) / (t2 * theta))
    }
}

/// Right Jacobian: `exp(φ + δ) ≈ exp(φ) · exp(J_r(φ) δ)`.
#[must_use]
pub fn right_jacobian(phi: &Vector3<f64>) -> Matrix3<f64> {
    let (b, c) = jacobian_coefficients(phi.norm());
    let s = skew(phi);
    Matrix3::identity() - s * b + s * s * c
}

/// Left Jacobian `J_l(φ) = J_r(−φ)`; the `V` of the SE(3) exponential.
#[must_use]
pub fn left_jacobian(phi: &Vector3<f64>) -> Matrix3<f64> {
    right_jacobian(&-phi)
}

/// Inverse of [`right_jacobian`]; finite for ‖φ‖ < 2π.
#[must_use]
pub fn right_jacobian_inverse(phi: &Vector3<f64>) -> Matrix3<f64> {
    let theta = phi.norm();
    let t2 = theta * theta;
    // 1/θ² − cot(θ/2)/(2θ)
    let d = if theta < SERIES_BELOW {
        1.0 / 12.0
            + t2 * (1.0 / 720.0
                + t2 * (1.0 / 30_240.0 + t2 * (1.0 / 1_209_600.0 + t2 * (1.0 / 47_900_160.0))))
    } else {
        let half = 0.5 * theta;
        1.0 / t2 - half.cos() / (2.0 * theta * half.sin())
    };
    let s = skew(phi);
    Matrix3::identity() + s * 0.5 + s * s * d
}

/// Inverse of [`left_jacobian`].
#[must_use]
pub fn left_jacobian_inverse(phi: &Vector3<f64>) -> Matrix3<f64> {
    right_jacobian_inverse(&-phi)
}

/// The quaternion of a matrix that is a rotation to within `limit` per entry of RᵀR.
///
/// # Errors
/// [`NotRotation`] for scaled, sheared, reflected or non-finite matrices.
pub fn check_rotation(r: &Matrix3<f64>, limit: f64) -> Result<UnitQuaternion<f64>, NotRotation> {
    let defect = (r.transpose() * r - Matrix3::identity()).amax();
    let determinant = r.determinant();
    let ok = defect.is_finite() && defect <= limit && determinant > 0.0;
    match nearest_rotation(r) {
        Some(rotation) if ok => Ok(rotation),
        _ => Err(NotRotation {
            orthogonality_defect: defect,
            determinant,
            limit,
        }),
    }
}

/// Projection onto SO(3): the rotation that maximizes tr(RᵀM) (the chordally nearest one).
///
/// `None` when it is not unique (`s₂ + sign(det) s₃` vanishes against `s₁`) or M is not finite.
#[must_use]
pub fn nearest_rotation(m: &Matrix3<f64>) -> Option<UnitQuaternion<f64>> {
    /// Relative gap below which rounding, not the data, would choose the rotation.
    const UNIQUE: f64 = 1e-9;
    if !m.iter().all(|x| x.is_finite()) {
        return None;
    }
    let svd = svd_small(m);
    let sign = if (svd.u * svd.v.transpose()).determinant() < 0.0 {
        -1.0
    } else {
        1.0
    };
    if svd.s[1] + sign * svd.s[2] <= UNIQUE * svd.s[0] {
        return None;
    }
    // R = U diag(1, 1, ±1) Vᵀ
    let mut u = svd.u;
    u.column_mut(2).scale_mut(sign);
    let r = Rotation3::from_matrix_unchecked(u * svd.v.transpose());
    Some(quaternion_of(&r))
}

/// Roll, pitch and yaw (rad) for a reader, R = Rz(y) Ry(p) Rx(r). Within 1e-7 rad of pitch ±90°, where rounding would divide one turn among roll and
/// yaw at will, roll is 0: what is read may be off by twice that.
#[must_use]
pub fn rpy_to_read(rotation: &UnitQuaternion<f64>) -> [f64; 3] {
    /// cos p
    const LOCKED: f64 = 1e-7;
    let m = rotation.to_rotation_matrix().into_inner();
    let cos_pitch = m[(0, 0)].hypot(m[(1, 0)]);
    let pitch = (-m[(2, 0)]).atan2(cos_pitch);
    if cos_pitch < LOCKED {
        // + 0: no −0 is shown.
        return [0.0, pitch, (-m[(0, 1)]).atan2(m[(1, 1)]) + 0.0];
    }
    let roll = m[(2, 1)].atan2(m[(2, 2)]);
    [roll, pitch, m[(1, 0)].atan2(m[(0, 0)])]
}

/// Quaternion of a rotation matrix by Shepperd's branch on the largest component (no iteration).
#[must_use]
pub fn quaternion_of(r: &Rotation3<f64>) -> UnitQuaternion<f64> {
    let m = r.matrix();
    let (m00, m11, m22) = (m[(0, 0)], m[(1, 1)], m[(2, 2)]);
    let q = if m00 + m11 + m22 > 0.0 {
        let s = 2.0 * (1.0 + m00 + m11 + m22).sqrt();
        Quaternion::new(
            0.25 * s,
            (m[(2, 1)] - m[(1, 2)]) / s,
            (m[(0, 2)] - m[(2, 0)]) / s,
            (m[(1, 0)] - m[(0, 1)]) / s,
        )
    } else if m00 >= m11 && m00 >= m22 {
        let s = 2.0 * (1.0 + m00 - m11 - m22).sqrt();
        Quaternion::new(
            (m[(2, 1)] - m[(1, 2)]) / s,
            0.25 * s,
            (m[(0, 1)] + m[(1, 0)]) / s,
            (m[(0, 2)] + m[(2, 0)]) / s,
        )
    } else if m11 >= m22 {
        let s = 2.0 * (1.0 + m11 - m00 - m22).sqrt();
        Quaternion::new(
            (m[(0, 2)] - m[(2, 0)]) / s,
            (m[(0, 1)] + m[(1, 0)]) / s,
            0.25 * s,
            (m[(1, 2)] + m[(2, 1)]) / s,
        )
    } else {
        let s = 2.0 * (1.0 + m22 - m00 - m11).sqrt();
        Quaternion::new(
            (m[(1, 0)] - m[(0, 1)]) / s,
            (m[(0, 2)] + m[(2, 0)]) / s,
            (m[(1, 2)] + m[(2, 1)]) / s,
            0.25 * s,
        )
    };
    UnitQuaternion::new_normalize(q)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use super::*;

    fn rotation([roll, pitch, yaw]: [f64; 3]) -> UnitQuaternion<f64> {
        UnitQuaternion::from_euler_angles(roll, pitch, yaw)
    }

    #[test]
    fn angles_to_read_are_those_of_the_rotation() {
        for rpy in [
            [0.0; 3],
            [0.3, -0.7, 2.9],
            [-3.1, 1.5, -0.2],
            [1.0, FRAC_PI_2 - 1e-6, 2.0],
        ] {
            let read = rpy_to_read(&rotation(rpy));
            assert!(
                (0..3).all(|i| (read[i] - rpy[i]).abs() < 1e-9),
                "{rpy:?} {read:?}"
            );
        }
    }

    /// A turn by less than a tracker sees changes what is read by as much, and no more.
    #[test]
    fn angles_to_read_do_not_jump_at_the_lock() {
        for pitch in [FRAC_PI_2, -FRAC_PI_2] {
            let exact = rotation([0.0, pitch, 0.4]);
            let expected = rpy_to_read(&exact);
            for k in 0..50 {
                let turn = Vector3::new((1.3 * k as f64).sin(), (2.9 * k as f64).cos(), 0.5);
                let read = rpy_to_read(&(exact * exp(&(turn * 1e-9))));
                assert!(
                    (0..3).all(|i| (read[i] - expected[i]).abs() < 1e-8),
                    "{read:?}"
                );
                let off = rotation(read).angle_to(&exact);
                assert!(off < 2e-7, "{off}");
            }
        }
    }
}
