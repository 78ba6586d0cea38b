//! Hand and eye by dual quaternions: rotation and translation in one linear system.
//!
//! ```text
//! A_ij X = X B_ij,   A_ij = A_i⁻¹ A_j,   B_ij = B_i⁻¹ B_j                                   (1)
//! S = [a − b   [a + b]ₓ   0       0      ]      a, b: vector parts of the real,
//!     [a' − b' [a' + b']ₓ  a − b   [a + b]ₓ]      a', b' of the dual quaternions              (2)
//! S [q; q'] = 0,   |q| = 1,   q·q' = 0:   the two weakest right singular vectors of all S      (3)
//! Z = mean of A_i X B_i⁻¹
//! ```
//!
//! K. Daniilidis 1999, Int. J. Robotics Research 18(3), 286–298. A closed form without a start and without weights: a check of
//! the least-squares estimate that shares no code with it. It is the less precise of the two where the motions are small, and has a bias: its covariance
//! is that of its own answers to simulated noise (9).

use calib_estimator::{EstimatorError, Input, InputKind, Options, Outcome};
use calib_geometry::{decompose::symmetric_eigen_small, so3};
use nalgebra::{
    Isometry3, Matrix3, Quaternion, SMatrix, SVector, Translation3, UnitQuaternion, Vector3,
};

use crate::{
    by_input::{self, Uncertainty},
    input::HandEyeError,
    minimum::Minimum,
    options::{COMMON, HandEyeInfo},
    outcome::HandEye,
    problem::Weights,
};

/// What `dual_quaternion` is and needs.
pub(crate) const INFO: HandEyeInfo = HandEyeInfo {
    id: "dual_quaternion",
    name: "hand-eye by dual quaternions",
    input: InputKind::PosePairs,
    options: COMMON,
    summary: "X in closed form from relative motions, Z as the mean; no weights and no start",
    source: "Daniilidis 1999",
    fit,
};

type Eight = SMatrix<f64, 8, 8>;

/// Pairs of poses whose relative motions are used: all of thirty poses; more add little.
const PAIRS: usize = 435;

/// Both transforms by (1) to (3).
pub(crate) fn fit(
    input: &Input<'_>,
    options: &Options,
) -> Result<Outcome<HandEye>, EstimatorError> {
    by_input::run(
        "dual_quaternion",
        input,
        options,
        Uncertainty::Simulated,
        solve,
    )
}

fn solve(a: &[Isometry3<f64>], b: &[Isometry3<f64>], _: Weights) -> Result<Minimum, HandEyeError> {
    let x = hand_eye(a, b).ok_or(HandEyeError::OneAxis {
        ratio: 0.0,
        limit: crate::input::ONE_AXIS,
    })?;
    let z = mean(a.iter().zip(b).map(|(a, b)| a * x * b.inverse()));
    Ok(Minimum {
        x,
        z,
        iterations: 0,
    })
}

/// X of (3); `None` where the motions do not fix it.
fn hand_eye(a: &[Isometry3<f64>], b: &[Isometry3<f64>]) -> Option<Isometry3<f64>> {
    let n = a.len();
    let stride = (n * (n - 1) / 2).div_ceil(PAIRS).max(1);
    let mut sum = Eight::zeros();
    let pairs = (0..n).flat_map(|i| (i + 1..n).map(move |j| (i, j)));
    for (i, j) in pairs.step_by(stride) {
        sum += system(&(a[i].inverse() * a[j]), &(b[i].inverse() * b[j]));
    }
    let eigen = symmetric_eigen_small(&sum);
    let (v7, v8) = (eigen.vectors.column(0), eigen.vectors.column(1));
    let part = |v: &nalgebra::DVectorView<'_, f64>, at: usize| -> SVector<f64, 4> {
        SVector::from_fn(|k, _| v[at + k])
    };
    let (u1, w1) = (part(&v7.as_view(), 0), part(&v7.as_view(), 4));
    let (u2, w2) = (part(&v8.as_view(), 0), part(&v8.as_view(), 4));
    // q·q' = 0 for q = s u₁ + u₂ (up to length):  s² u₁·w₁ + s (u₁·w₂ + u₂·w₁) + u₂·w₂ = 0
    let (p, q, r) = (u1.dot(&w1), u1.dot(&w2) + u2.dot(&w1), u2.dot(&w2));
    let root = (q * q - 4.0 * p * r).max(0.0).sqrt();
    let roots = if p.abs() > 1e-14 {
        [(-q + root) / (2.0 * p), (-q - root) / (2.0 * p)]
    } else {
        [-r / q, -r / q]
    };
    // Of the two the one with the larger |q|: the other is nearly a pure translation.
    let length = |s: &f64| (u1 * *s + u2).norm_squared() / (s * s + 1.0);
    let s = roots
        .into_iter()
        .filter(|s| s.is_finite())
        .max_by(|x, y| length(x).total_cmp(&length(y)))?;
    let (real, dual) = (u1 * s + u2, w1 * s + w2);
    let norm = real.norm();
    if norm <= 1e-9 {
        return None;
    }
    let quaternion = |v: SVector<f64, 4>| Quaternion::new(v[0], v[1], v[2], v[3]);
    let (real, dual) = (quaternion(real / norm), quaternion(dual / norm));
    // t = 2 q' q*
    let t = (dual * real.conjugate()).imag() * 2.0;
    Some(Isometry3::from_parts(
        Translation3::from(t),
        UnitQuaternion::new_normalize(real),
    ))
}

/// SᵀS of (2).
fn system(a: &Isometry3<f64>, b: &Isometry3<f64>) -> Eight {
    let (qa, mut qb) = (a.rotation.into_inner(), b.rotation.into_inner());
    let qa = if qa.w < 0.0 { -qa } else { qa };
    if qb.w < 0.0 {
        qb = -qb;
    }
    let dual = |t: &Vector3<f64>, q: &Quaternion<f64>| (Quaternion::from_imag(*t) * q * 0.5).imag();
    let (va, vb) = (qa.imag(), qb.imag());
    let (da, db) = (
        dual(&a.translation.vector, &qa),
        dual(&b.translation.vector, &qb),
    );
    let mut s = SMatrix::<f64, 6, 8>::zeros();
    let mut put = |row: usize, column: usize, difference: Vector3<f64>, sum: Vector3<f64>| {
        let cross: Matrix3<f64> = so3::skew(&sum);
        s.fixed_view_mut::<3, 1>(row, column).copy_from(&difference);
        s.fixed_view_mut::<3, 3>(row, column + 1).copy_from(&cross);
    };
    put(0, 0, va - vb, va + vb);
    put(3, 0, da - db, da + db);
    put(3, 4, va - vb, va + vb);
    s.transpose() * s
}

/// Mean of poses that differ by noise.
fn mean(poses: impl Iterator<Item = Isometry3<f64>> + Clone) -> Isometry3<f64> {
    let n = poses.clone().count().max(1) as f64;
    let sum: Vector3<f64> = poses.clone().map(|p| p.translation.vector).sum();
    let rotations: Matrix3<f64> = poses
        .map(|p| p.rotation.to_rotation_matrix().into_inner())
        .sum();
    Isometry3::from_parts(
        Translation3::from(sum / n),
        so3::nearest_rotation(&rotations).unwrap_or_else(UnitQuaternion::identity),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_motions_give_the_transforms() {
        for k in 0..20 {
            let s = f64::from(k);
            let x = Isometry3::new(
                Vector3::new(0.05, 0.1 * s.sin(), 0.1),
                Vector3::new((1.3 * s).sin(), 0.3, -0.9 * s.cos()),
            );
            let z = Isometry3::new(
                Vector3::new(1.0, -0.5, 0.2),
                Vector3::new(0.1, s.cos(), 1.2),
            );
            let a: Vec<_> = (0..7)
                .map(|i| {
                    let t = s + 1.7 * f64::from(i);
                    Isometry3::new(
                        Vector3::new((0.9 * t).sin(), (1.3 * t).cos(), 0.3 * t.sin()),
                        Vector3::new((0.7 * t).sin(), (1.1 * t).cos(), (1.9 * t).sin()),
                    )
                })
                .collect();
            let b: Vec<_> = a.iter().map(|a| z.inverse() * a * x).collect();
            let found = hand_eye(&a, &b).expect("two axes");
            let off = found.inverse() * x;
            assert!(
                off.translation.vector.norm() < 1e-9 && off.rotation.angle() < 1e-9,
                "{k}: {off}"
            );
        }
    }
}
