//! The certificate of optimality (2), (3).

use calib_geometry::decompose;
use nalgebra::{DMatrix, DVector, Isometry3, Matrix6, Rotation3, SMatrix, SVector};

use crate::problem::{Weights, rotation_of};

pub(crate) type Matrix19 = SMatrix<f64, 19, 19>;
pub(crate) type Vector19 = SVector<f64, 19>;

/// Q of the 19-dimensional form: rotations and 1, translations eliminated by their normal equations.
pub(crate) fn quadratic(a: &[Isometry3<f64>], b: &[Isometry3<f64>], w: Weights) -> Matrix19 {
    // Unknowns [vec R_X; vec R_Z; 1 | t_X; t_Z], column-major vec.
    let mut full = SMatrix::<f64, 25, 25>::zeros();
    for (a, b) in a.iter().zip(b) {
        let (ra, rb) = (rotation_of(a), rotation_of(b));
        for i in 0..3 {
            for j in 0..3 {
                // (R_A R_X − R_Z R_B)_ij
                let mut row = SVector::<f64, 25>::zeros();
                for k in 0..3 {
                    row[3 * j + k] += ra[(i, k)];
                    row[9 + 3 * k + i] -= rb[(k, j)];
                }
                full.ger(w.rotation, &row, &row, 1.0);
            }
            // (R_A t_X + t_A − R_Z t_B − t_Z)_i
            let mut row = SVector::<f64, 25>::zeros();
            for k in 0..3 {
                row[19 + k] += ra[(i, k)];
                row[9 + 3 * k + i] -= b.translation.vector[k];
            }
            row[18] += a.translation.vector[i];
            row[22 + i] -= 1.0;
            full.ger(w.translation, &row, &row, 1.0);
        }
    }
    let tt: Matrix6<f64> = full.fixed_view::<6, 6>(19, 19).into_owned();
    let tr = full.fixed_view::<6, 19>(19, 0).into_owned();
    let rr = full.fixed_view::<19, 19>(0, 0).into_owned();
    match nalgebra::Cholesky::new(tt) {
        Some(c) => rr - tr.transpose() * c.solve(&tr),
        None => rr,
    }
}

/// Symmetric matrices C_k with rᵀC_k r = 0 on every pair of rotations (with r₁₉ = 1).
fn constraints() -> Vec<Matrix19> {
    let mut out = Vec::new();
    for offset in [0, 9] {
        let at = |i: usize, j: usize| offset + 3 * j + i;
        // RᵀR = I and RRᵀ = I
        for p in 0..3 {
            for q in p..3 {
                for columns in [true, false] {
                    let mut c = Matrix19::zeros();
                    for k in 0..3 {
                        let (i, j) = if columns {
                            (at(k, p), at(k, q))
                        } else {
                            (at(p, k), at(q, k))
                        };
                        c[(i, j)] += 0.5;
                        c[(j, i)] += 0.5;
                    }
                    if p == q {
                        c[(18, 18)] -= 1.0;
                    }
                    out.push(c);
                }
            }
        }
        // column_p × column_q = column_s for the three cyclic choices
        for p in 0..3 {
            let (q, s) = ((p + 1) % 3, (p + 2) % 3);
            for i in 0..3 {
                let (j, k) = ((i + 1) % 3, (i + 2) % 3);
                let mut c = Matrix19::zeros();
                for (sign, x, y) in [(1.0, at(j, p), at(k, q)), (-1.0, at(k, p), at(j, q))] {
                    c[(x, y)] += 0.5 * sign;
                    c[(y, x)] += 0.5 * sign;
                }
                c[(at(i, s), 18)] -= 0.5;
                c[(18, at(i, s))] -= 0.5;
                out.push(c);
            }
        }
    }
    out
}

/// Bound (3) relative to f*, and λ_min(H) relative to the largest eigenvalue of Q.
pub(crate) fn certificate(
    a: &[Isometry3<f64>],
    b: &[Isometry3<f64>],
    x: &Isometry3<f64>,
    z: &Isometry3<f64>,
    w: Weights,
) -> (f64, f64) {
    let q = quadratic(a, b, w);
    let largest = decompose::symmetric_eigen_small(&q).values[18].max(f64::MIN_POSITIVE);
    let q = q / largest;
    let mut r = Vector19::zeros();
    let clean = |x: &Isometry3<f64>| *Rotation3::from(x.rotation).matrix();
    r.fixed_rows_mut::<9>(0)
        .copy_from_slice(clean(x).as_slice());
    r.fixed_rows_mut::<9>(9)
        .copy_from_slice(clean(z).as_slice());
    r[18] = 1.0;
    let constraints = constraints();
    // Columns C_k r and −E r against −Q r.
    let mut lhs = DMatrix::zeros(19, constraints.len() + 1);
    for (k, c) in constraints.iter().enumerate() {
        lhs.column_mut(k).copy_from(&(c * r));
    }
    lhs[(18, constraints.len())] = -1.0;
    let rhs = DVector::from_iterator(19, (q * r).iter().map(|v| -v));
    let multipliers = decompose::solve_least_squares(&lhs, &rhs, 1e-12).x;
    let mut h = q;
    for (k, c) in constraints.iter().enumerate() {
        h += c * multipliers[k];
    }
    let gamma = multipliers[constraints.len()];
    h[(18, 18)] -= gamma;
    let least = decompose::symmetric_eigen_small(&h).values[0];
    let f = (q * r).dot(&r);
    let gap = 7.0 * (-least).max(0.0) + (f - gamma).abs();
    // Relative to f where it is more than rounding, in units of the largest eigenvalue else.
    (gap / f.max(1e-9), least)
}
