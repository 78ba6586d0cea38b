//! Where the iteration starts: closed forms, the better of two under the weighted cost.

use calib_geometry::{decompose, so3};
use nalgebra::{DMatrix, DVector, Isometry3, Matrix3, Translation3, Vector3};

use crate::{
    certificate::quadratic,
    problem::{Weights, linearize, rotation_of},
};

/// The start with the lower cost under the weights.
pub(crate) fn start(
    a: &[Isometry3<f64>],
    b: &[Isometry3<f64>],
    w: Weights,
) -> (Isometry3<f64>, Isometry3<f64>) {
    let separate = by_rotations(a, b);
    let Some(joint) = jointly(a, b, w) else {
        return separate;
    };
    let cost = |(x, z): &(Isometry3<f64>, Isometry3<f64>)| linearize(a, b, x, z, w).2;
    if cost(&joint) < cost(&separate) {
        joint
    } else {
        separate
    }
}

/// All 18 entries of both rotations at once, by the weights: good where the orientations are poor and the positions tell the
/// rotation of Z. `None` where the entries are not near any rotation.
fn jointly(
    a: &[Isometry3<f64>],
    b: &[Isometry3<f64>],
    w: Weights,
) -> Option<(Isometry3<f64>, Isometry3<f64>)> {
    let q = quadratic(a, b, w);
    // Q_rr r = −q,   r = [vec R_X; vec R_Z]
    let lhs = DMatrix::from_fn(18, 18, |i, j| q[(i, j)]);
    let rhs = DVector::from_fn(18, |i, _| -q[(i, 18)]);
    let r = decompose::solve_least_squares(&lhs, &rhs, 1e-12).x;
    let rotation = |at: usize| so3::nearest_rotation(&Matrix3::from_fn(|i, j| r[at + 3 * j + i]));
    let (rx, rz) = (rotation(0)?, rotation(9)?);
    let (tx, tz) = translations(a, b, rz.to_rotation_matrix().matrix());
    Some((
        Isometry3::from_parts(Translation3::from(tx), rx),
        Isometry3::from_parts(Translation3::from(tz), rz),
    ))
}

/// Rotations from the null vector of `R_A R_X − R_Z R_B = 0`, translations by least squares.
fn by_rotations(a: &[Isometry3<f64>], b: &[Isometry3<f64>]) -> (Isometry3<f64>, Isometry3<f64>) {
    // Σ R_Aᵀ R_Z R_B = n R_X: K maps vec R_Z to vec R_X; its top singular pair solves both.
    let mut k = DMatrix::<f64>::zeros(9, 9);
    for (a, b) in a.iter().zip(b) {
        let (ra, rb) = (rotation_of(a), rotation_of(b));
        // vec(R_Aᵀ Z R_B) = (R_Bᵀ ⊗ R_Aᵀ) vec Z, column-major
        for j in 0..3 {
            for jz in 0..3 {
                for i in 0..3 {
                    for iz in 0..3 {
                        k[(3 * j + i, 3 * jz + iz)] += rb[(jz, j)] * ra[(iz, i)];
                    }
                }
            }
        }
    }
    let svd = decompose::svd(&k);
    let shape = |v: DVector<f64>| {
        let m = Matrix3::from_iterator(v.iter().copied());
        let m = if m.determinant() < 0.0 { -m } else { m };
        so3::nearest_rotation(&m).unwrap_or_else(nalgebra::UnitQuaternion::identity)
    };
    let rz = shape(svd.v.column(0).into_owned());
    // R_X from R_Z, so that both carry the same sign.
    let rz_m = *rz.to_rotation_matrix().matrix();
    let sum: Matrix3<f64> = a
        .iter()
        .zip(b)
        .map(|(a, b)| rotation_of(a).transpose() * rz_m * rotation_of(b))
        .sum();
    let rx = so3::nearest_rotation(&sum).unwrap_or_else(nalgebra::UnitQuaternion::identity);
    let (tx, tz) = translations(a, b, &rz_m);
    (
        Isometry3::from_parts(Translation3::from(tx), rx),
        Isometry3::from_parts(Translation3::from(tz), rz),
    )
}

/// Minimizes Σ ‖R_A t_X + t_A − R_Z t_B − t_Z‖² over the translations.
fn translations(
    a: &[Isometry3<f64>],
    b: &[Isometry3<f64>],
    rz: &Matrix3<f64>,
) -> (Vector3<f64>, Vector3<f64>) {
    let n = a.len();
    let mut lhs = DMatrix::zeros(3 * n, 6);
    let mut rhs = DVector::zeros(3 * n);
    for (i, (a, b)) in a.iter().zip(b).enumerate() {
        lhs.fixed_view_mut::<3, 3>(3 * i, 0)
            .copy_from(&rotation_of(a));
        lhs.fixed_view_mut::<3, 3>(3 * i, 3)
            .copy_from(&-Matrix3::identity());
        rhs.fixed_rows_mut::<3>(3 * i)
            .copy_from(&(rz * b.translation.vector - a.translation.vector));
    }
    let t = decompose::solve_least_squares(&lhs, &rhs, 1e-12).x;
    (
        Vector3::new(t[0], t[1], t[2]),
        Vector3::new(t[3], t[4], t[5]),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::problem::HandEyeWeights;

    #[test]
    fn the_start_honors_the_weights() {
        // The orientations of B are useless, its positions exact: only a start that weighs them finds Z.
        let x = Isometry3::new(Vector3::new(0.05, 0.02, 0.1), Vector3::new(0.1, 0.3, -0.2));
        let z = Isometry3::new(Vector3::new(1.0, -0.5, 0.2), Vector3::new(0.1, 0.4, 1.2));
        let a: Vec<_> = (0..12)
            .map(f64::from)
            .map(|i| {
                Isometry3::new(
                    Vector3::new(0.1 * i, (1.3 * i).sin(), (2.1 * i).cos()),
                    Vector3::new((0.7 * i).sin(), (1.1 * i).cos(), (1.9 * i).sin()),
                )
            })
            .collect();
        let b: Vec<_> = a
            .iter()
            .zip(0..)
            .map(|(a, i)| {
                let wrong = Vector3::new(2.0, 0.0, 3.0) * (1.7 * f64::from(i)).sin();
                z.inverse() * a * x * Isometry3::new(Vector3::zeros(), wrong)
            })
            .collect();
        let weights = Weights::of(HandEyeWeights {
            sigma_rotation: 1.0,
            sigma_translation: 1e-4,
        });
        let found = start(&a, &b, weights).1;
        assert!(found.rotation.angle_to(&z.rotation) < 0.02, "{found} {z}");
        let unweighted = by_rotations(&a, &b).1;
        assert!(unweighted.rotation.angle_to(&z.rotation) > 0.1);
    }
}
