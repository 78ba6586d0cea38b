//! Hand–eye calibration: `A_i X = Z B_i` (robot–world) and `A X = X B`, with a certificate.
//!
//! ```text
//! f(X, Z) = Σ_i w_R ‖R_A R_X − R_Z R_B‖²_F + w_t ‖R_A t_X + t_A − R_Z t_B − t_Z‖²             (1)
//! ```
//!
//! With the translations eliminated f is a quadratic form `rᵀQr`, r = [vec R_X; vec R_Z; 1] ∈ R¹⁹, over
//! quadratic constraints C_k (orthonormal rows and columns, right-handedness). At a local optimum r* the
//! multipliers follow by least squares from
//!
//! ```text
//! H(λ) r* = 0,   H(λ) = Q + Σ_k λ_k C_k − γ E,   ‖r‖² = 7                                    (2)
//! f* − f_min ≤ 7·max(0, −λ_min(H)) + (f* − γ)                                               (3)
//! ```
//!
//! so a positive semidefinite H proves that no other pair of rotations is better. The closed form starts from
//! the linear problem and projects onto SO(3); Gauss–Newton on (1) finishes. Statistical weighting with
//! body-frame noise is the business of [`Problem`](crate::Problem) (one pose measurement kind per tracker); (1) is the
//! quadratic cost that can be certified.

use nalgebra::{
    DMatrix, DVector, Isometry3, Matrix3, Matrix6, Rotation3, SMatrix, SVector, Translation3,
    Vector3, Vector6,
};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use calib_geometry::{decompose, so3};

type Matrix19 = SMatrix<f64, 19, 19>;
type Vector19 = SVector<f64, 19>;

/// Why a hand–eye problem has no answer.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum HandEyeError {
    /// The two lists differ in length.
    #[error("{a} poses on one side and {b} on the other")]
    Lengths {
        /// Left.
        a: usize,
        /// Right.
        b: usize,
    },
    /// Three poses with two different rotation axes are the least.
    #[error("{found} poses are too few: {needed} are the least")]
    TooFew {
        /// Given.
        found: usize,
        /// Needed.
        needed: usize,
    },
    /// A pose is not finite.
    #[error("pose {index} is not finite")]
    NotFinite {
        /// Its index.
        index: usize,
    },
    /// All rotations are about one axis: the shift along it cannot be seen.
    #[error(
        "the rotations share one axis: σ ratio {ratio:.1e} is under {limit:.0e}; turn about a second axis"
    )]
    OneAxis {
        /// Second over first singular value of the relative rotation vectors.
        ratio: f64,
        /// The limit.
        limit: f64,
    },
}

/// Weights of (1): 1/σ² of orientation (per rad², the Frobenius norm counts it twice) and position.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HandEyeWeights {
    /// σ of orientation, rad.
    pub sigma_rotation: f64,
    /// σ of position, m.
    pub sigma_translation: f64,
}

impl Default for HandEyeWeights {
    /// 1 mm against 1 mrad: errors weigh alike on a lever of a metre.
    fn default() -> Self {
        Self {
            sigma_rotation: 1e-3,
            sigma_translation: 1e-3,
        }
    }
}

/// Solution of `A_i X = Z B_i`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
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

/// Rotation vectors whose second direction is weaker than this fraction of the first are one axis: 0.1° of
/// noise on 10° of motion.
const ONE_AXIS: f64 = 1e-2;
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
    let (mut x, mut z) = closed_form(a, b, w);
    let mut iterations = 0;
    let mut system = linearise(a, b, &x, &z, w);
    for _ in 0..MAX_STEPS {
        iterations += 1;
        let Some(step) = solve12(&system) else { break };
        let (nx, nz) = (
            moved(&x, &step.fixed_rows::<6>(0).into_owned()),
            moved(&z, &step.fixed_rows::<6>(6).into_owned()),
        );
        let next = linearise(a, b, &nx, &nz, w);
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

fn check(a: &[Isometry3<f64>], b: &[Isometry3<f64>], needed: usize) -> Result<(), HandEyeError> {
    if a.len() != b.len() {
        return Err(HandEyeError::Lengths {
            a: a.len(),
            b: b.len(),
        });
    }
    if a.len() < needed {
        return Err(HandEyeError::TooFew {
            found: a.len(),
            needed,
        });
    }
    let finite = |x: &Isometry3<f64>| {
        x.translation.vector.iter().all(|v| v.is_finite())
            && x.rotation.coords.iter().all(|v| v.is_finite())
    };
    match a.iter().zip(b).position(|(a, b)| !finite(a) || !finite(b)) {
        Some(index) => Err(HandEyeError::NotFinite { index }),
        None => Ok(()),
    }
}

fn check_axes(a: &[Isometry3<f64>]) -> Result<(), HandEyeError> {
    let first = a[0].rotation.inverse();
    two_axes(a[1..].iter().map(|a| so3::log(&(first * a.rotation))))
}

fn two_axes(logs: impl Iterator<Item = Vector3<f64>>) -> Result<(), HandEyeError> {
    let moment: Matrix3<f64> = logs.map(|l| l * l.transpose()).sum();
    let s = decompose::svd_small(&moment).s;
    let ratio = if s[0] > 0.0 {
        (s[1] / s[0]).sqrt()
    } else {
        0.0
    };
    if ratio < ONE_AXIS {
        return Err(HandEyeError::OneAxis {
            ratio,
            limit: ONE_AXIS,
        });
    }
    Ok(())
}

#[derive(Clone, Copy)]
struct Weights {
    rotation: f64,
    translation: f64,
}

impl Weights {
    fn of(w: HandEyeWeights) -> Self {
        Self {
            // ‖ΔR‖²_F = 2 θ²
            rotation: 0.5 / (w.sigma_rotation * w.sigma_rotation),
            translation: 1.0 / (w.sigma_translation * w.sigma_translation),
        }
    }
}

fn rotation_of(x: &Isometry3<f64>) -> Matrix3<f64> {
    *x.rotation.to_rotation_matrix().matrix()
}

/// Rotations from the null vector of `R_A R_X − R_Z R_B = 0`, translations by least squares.
fn closed_form(
    a: &[Isometry3<f64>],
    b: &[Isometry3<f64>],
    w: Weights,
) -> (Isometry3<f64>, Isometry3<f64>) {
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
    let _ = w;
    (
        Isometry3::from_parts(Translation3::from(tx), rx),
        Isometry3::from_parts(Translation3::from(tz), rz),
    )
}

/// Minimises Σ ‖R_A t_X + t_A − R_Z t_B − t_Z‖² over the translations.
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

type System = (SMatrix<f64, 12, 12>, SVector<f64, 12>, f64);

/// Gauss–Newton system of (1) in right perturbations, and its value.
fn linearise(
    a: &[Isometry3<f64>],
    b: &[Isometry3<f64>],
    x: &Isometry3<f64>,
    z: &Isometry3<f64>,
    w: Weights,
) -> System {
    let mut h = SMatrix::<f64, 12, 12>::zeros();
    let mut g = SVector::<f64, 12>::zeros();
    let mut f = 0.0;
    let (rx, rz) = (rotation_of(x), rotation_of(z));
    for (a, b) in a.iter().zip(b) {
        let (ra, rb) = (rotation_of(a), rotation_of(b));
        // Translation: e = R_A t_X + t_A − R_Z t_B − t_Z; dt = R v; d(R_Z t_B) = −R_Z [t_B]ₓ ω
        let e = ra * x.translation.vector + a.translation.vector
            - rz * b.translation.vector
            - z.translation.vector;
        let mut j = SMatrix::<f64, 3, 12>::zeros();
        j.fixed_view_mut::<3, 3>(0, 3).copy_from(&(ra * rx));
        j.fixed_view_mut::<3, 3>(0, 6)
            .copy_from(&(rz * so3::skew(&b.translation.vector)));
        j.fixed_view_mut::<3, 3>(0, 9).copy_from(&-rz);
        h += j.transpose() * j * w.translation;
        g += j.transpose() * e * w.translation;
        f += w.translation * e.norm_squared();
        // Rotation, 9 rows: E = R_A R_X − R_Z R_B; dE = R_A R_X [ω_x]ₓ − R_Z [ω_z]ₓ R_B
        let left = ra * rx;
        let error = left - rz * rb;
        let mut j = SMatrix::<f64, 9, 12>::zeros();
        for c in 0..3 {
            let mut unit = Vector3::zeros();
            unit[c] = 1.0;
            let s = so3::skew(&unit);
            let dx = left * s;
            let dz = -(rz * s * rb);
            for i in 0..9 {
                j[(i, c)] = dx[i];
                j[(i, 6 + c)] = dz[i];
            }
        }
        let e = SVector::<f64, 9>::from_iterator(error.iter().copied());
        h += j.transpose() * j * w.rotation;
        g += j.transpose() * e * w.rotation;
        f += w.rotation * e.norm_squared();
    }
    (h, g, f)
}

fn solve12(system: &System) -> Option<SVector<f64, 12>> {
    nalgebra::Cholesky::new(system.0).map(|c| -c.solve(&system.1))
}

fn moved(x: &Isometry3<f64>, xi: &Vector6<f64>) -> Isometry3<f64> {
    let omega = Vector3::new(xi[0], xi[1], xi[2]);
    let v = Vector3::new(xi[3], xi[4], xi[5]);
    Isometry3::from_parts(
        Translation3::from(x.translation.vector + x.rotation * v),
        x.rotation * so3::exp(&omega),
    )
}

/// Q of the 19-dimensional form: rotations and 1, translations eliminated by their normal equations.
fn quadratic(a: &[Isometry3<f64>], b: &[Isometry3<f64>], w: Weights) -> Matrix19 {
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
fn certificate(
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
