//! The decompositions that estimation trusts: one-sided Jacobi SVD behind a Householder QR, cyclic
//! Jacobi for symmetric matrices, and the pencil `DᵀD u = λ C u`.
//!
//! A general-purpose SVD that iterates on a bidiagonal form can return wrong factors for repeated or
//! vanishing singular values, which is what an exact hinge or a one-axis sweep produces. Jacobi methods
//! are slower and have no such case: each rotation is orthogonal to rounding, and small singular
//! values keep their relative accuracy (Demmel & Veselić 1992).

use nalgebra::{DMatrix, DVector, SMatrix, SVector};

/// Sweeps after which Jacobi has converged for every matrix met (typically 6–10); a bound, not a tuning.
const MAX_SWEEPS: usize = 60;

/// Thin singular value decomposition `A = U diag(s) Vᵀ`, singular values descending.
#[derive(Debug, Clone, PartialEq)]
pub struct Svd {
    /// m × k, orthonormal columns, k = min(m, n).
    pub u: DMatrix<f64>,
    /// k singular values, descending, ≥ 0.
    pub s: DVector<f64>,
    /// n × k, orthonormal columns.
    pub v: DMatrix<f64>,
}

/// SVD of a small square matrix, on the stack.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SvdSmall<const N: usize> {
    /// Left singular vectors, orthogonal.
    pub u: SMatrix<f64, N, N>,
    /// Singular values, descending.
    pub s: SVector<f64, N>,
    /// Right singular vectors, orthogonal.
    pub v: SMatrix<f64, N, N>,
}

/// Eigenvalues ascending with their orthonormal eigenvectors as columns.
#[derive(Debug, Clone, PartialEq)]
pub struct SymmetricEigen {
    /// Eigenvalues, ascending.
    pub values: DVector<f64>,
    /// Column i belongs to value i.
    pub vectors: DMatrix<f64>,
}

/// Eigen decomposition of a small symmetric matrix, on the stack.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SymmetricEigenSmall<const N: usize> {
    /// Eigenvalues, ascending.
    pub values: SVector<f64, N>,
    /// Column i belongs to value i.
    pub vectors: SMatrix<f64, N, N>,
}

/// One eigenpair of the pencil `DᵀD u = λ C u`.
#[derive(Debug, Clone, PartialEq)]
pub struct PencilPair {
    /// λ; infinite where `u'Cu` vanishes.
    pub lambda: f64,
    /// The eigenvector, scaled to `‖D u‖ = 1` (or to unit length where `D u` vanishes).
    pub u: DVector<f64>,
    /// `u' C u`.
    pub c_norm: f64,
}

/// Minimum-norm least-squares solution and the rank it used.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct LeastSquares {
    /// x of least ‖x‖ among the minimizers of ‖Ax − b‖.
    pub x: DVector<f64>,
    /// Singular values that counted.
    pub rank: usize,
    /// All singular values of A, descending.
    pub singular_values: DVector<f64>,
}

/// Thin SVD of any real matrix with finite entries.
///
/// Householder QR first when A is tall, then one-sided Jacobi on the small factor.
#[must_use]
pub fn svd(a: &DMatrix<f64>) -> Svd {
    let (m, n) = a.shape();
    if m < n {
        let t = svd(&a.transpose());
        return Svd {
            u: t.v,
            s: t.s,
            v: t.u,
        };
    }
    if n == 0 {
        return Svd {
            u: DMatrix::zeros(m, 0),
            s: DVector::zeros(0),
            v: DMatrix::zeros(0, 0),
        };
    }
    let (q, mut work) = if m > n {
        let qr = a.clone().qr();
        (Some(qr.q()), qr.r())
    } else {
        (None, a.clone())
    };
    let mut v = DMatrix::identity(n, n);
    let mut s = DVector::zeros(n);
    one_sided_jacobi(work.as_mut_slice(), v.as_mut_slice(), s.as_mut_slice(), n);
    let u = match q {
        Some(q) => q * work,
        None => work,
    };
    Svd { u, s, v }
}

/// Singular values only, descending; as accurate as [`svd`], without the m × n factor.
#[must_use]
pub fn singular_values(a: &DMatrix<f64>) -> DVector<f64> {
    let (m, n) = a.shape();
    if m < n {
        return singular_values(&a.transpose());
    }
    let mut r = if m > n { a.clone().qr().r() } else { a.clone() };
    let mut v = DMatrix::identity(n, n);
    let mut s = DVector::zeros(n);
    one_sided_jacobi(r.as_mut_slice(), v.as_mut_slice(), s.as_mut_slice(), n);
    s
}

/// SVD of a small square matrix without allocation.
#[must_use]
pub fn svd_small<const N: usize>(a: &SMatrix<f64, N, N>) -> SvdSmall<N> {
    let mut u = *a;
    let mut v = SMatrix::<f64, N, N>::identity();
    let mut s = SVector::<f64, N>::zeros();
    one_sided_jacobi(u.as_mut_slice(), v.as_mut_slice(), s.as_mut_slice(), N);
    SvdSmall { u, s, v }
}

/// Eigen decomposition of a symmetric matrix; only the lower triangle is read.
#[must_use]
pub fn symmetric_eigen(a: &DMatrix<f64>) -> SymmetricEigen {
    let n = a.nrows();
    let mut work = a.clone();
    let mut vectors = DMatrix::identity(n, n);
    let mut values = DVector::zeros(n);
    cyclic_jacobi(
        work.as_mut_slice(),
        vectors.as_mut_slice(),
        values.as_mut_slice(),
        n,
    );
    SymmetricEigen { values, vectors }
}

/// Eigen decomposition of a small symmetric matrix without allocation.
#[must_use]
pub fn symmetric_eigen_small<const N: usize>(a: &SMatrix<f64, N, N>) -> SymmetricEigenSmall<N> {
    let mut work = *a;
    let mut vectors = SMatrix::<f64, N, N>::identity();
    let mut values = SVector::<f64, N>::zeros();
    cyclic_jacobi(
        work.as_mut_slice(),
        vectors.as_mut_slice(),
        values.as_mut_slice(),
        N,
    );
    SymmetricEigenSmall { values, vectors }
}

/// All eigenpairs of `DᵀD u = λ C u` for a tall D (m × n) and a symmetric, possibly indefinite C (n × n).
///
/// With `D = U Σ Vᵀ` and `y = Σ Vᵀ u` the pencil becomes the symmetric problem
/// `Σ⁻¹ Vᵀ C V Σ⁻¹ y = (1/λ) y`: it never forms `DᵀD`, and a vanishing singular value (exact data)
/// is raised to rounding level instead of failing. Ascending in 1/λ.
#[must_use]
pub fn pencil_eigen(d: &DMatrix<f64>, c: &DMatrix<f64>) -> Vec<PencilPair> {
    let Svd { s, v, .. } = svd(d);
    let n = s.len();
    let floor = s[0].max(f64::MIN_POSITIVE) * f64::EPSILON;
    // columns of V Σ⁻¹
    let mut w = v;
    for i in 0..n {
        w.column_mut(i).unscale_mut(s[i].max(floor));
    }
    let reduced = w.transpose() * c * &w;
    let eigen = symmetric_eigen(&reduced);
    (0..n)
        .map(|i| {
            let u = &w * eigen.vectors.column(i);
            let c_norm = (u.transpose() * c * &u)[(0, 0)];
            PencilPair {
                lambda: 1.0 / eigen.values[i],
                u,
                c_norm,
            }
        })
        .collect()
}

/// Rows Z with `ZᵀZ = AᵀA`, no more than the rank of A: those of R of a Householder QR decomposition with column pivoting, columns in their
/// places. What remains below `relative_tolerance` times the longest column counts as nothing.
#[must_use]
pub fn row_factor(a: &DMatrix<f64>, relative_tolerance: f64) -> DMatrix<f64> {
    let (m, n) = a.shape();
    let mut work = a.clone();
    let data = work.as_mut_slice();
    // Columns that were not taken as pivots yet, in their order.
    let mut left: Vec<usize> = (0..n).collect();
    let mut longest = 0.0;
    let mut reflector = vec![0.0; m];
    let mut rank = 0;
    while rank < m && !left.is_empty() {
        let tail = |data: &[f64], c: usize| {
            let tail = &data[c * m + rank..(c + 1) * m];
            dot(tail, tail)
        };
        let (mut place, mut norm2) = (0, -1.0);
        for (i, &c) in left.iter().enumerate() {
            let of_column = tail(data, c);
            if of_column > norm2 {
                (place, norm2) = (i, of_column);
            }
        }
        let norm = norm2.sqrt();
        if rank == 0 {
            longest = norm;
        }
        if norm <= relative_tolerance * longest || !norm.is_finite() {
            break;
        }
        let pivot = left.remove(place);
        // v = x ± ‖x‖ e₁,  x ← x − v (2 vᵀx / vᵀv)
        let v = &mut reflector[rank..];
        v.copy_from_slice(&data[pivot * m + rank..(pivot + 1) * m]);
        let first = v[0];
        let reflected = if first > 0.0 { -norm } else { norm };
        v[0] -= reflected;
        let half = norm * (norm + first.abs());
        for &c in &left {
            let x = &mut data[c * m + rank..(c + 1) * m];
            let factor = dot(v, x) / half;
            x.iter_mut().zip(&*v).for_each(|(x, v)| *x -= factor * v);
        }
        let column = &mut data[pivot * m + rank..(pivot + 1) * m];
        column.fill(0.0);
        column[0] = reflected;
        rank += 1;
    }
    work.rows(0, rank).into_owned()
}

/// Number of singular values above `relative_tolerance` times the largest.
#[must_use]
pub fn rank(singular_values: &DVector<f64>, relative_tolerance: f64) -> usize {
    let largest = singular_values.iter().copied().fold(0.0, f64::max);
    singular_values
        .iter()
        .filter(|&&s| s > relative_tolerance * largest)
        .count()
}

/// Minimum-norm least squares by the pseudo-inverse: singular values at or below
/// `relative_tolerance` times the largest are treated as zero.
#[must_use]
pub fn solve_least_squares(
    a: &DMatrix<f64>,
    b: &DVector<f64>,
    relative_tolerance: f64,
) -> LeastSquares {
    let Svd { u, s, v } = svd(a);
    let rank = rank(&s, relative_tolerance);
    let mut y = u.tr_mul(b);
    for i in 0..y.len() {
        y[i] = if i < rank { y[i] / s[i] } else { 0.0 };
    }
    LeastSquares {
        x: v * y,
        rank,
        singular_values: s,
    }
}

/// One-sided Jacobi (Hestenes) on an n × n column-major matrix `a`: on return `a` holds U, `v` V.
fn one_sided_jacobi(a: &mut [f64], v: &mut [f64], s: &mut [f64], n: usize) {
    // Scale to avoid overflow and underflow of the squared norms.
    let scale = a.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    if scale == 0.0 || !scale.is_finite() {
        complete_basis(a, n, 0);
        s.fill(if scale == 0.0 { 0.0 } else { f64::NAN });
        return;
    }
    a.iter_mut().for_each(|x| *x /= scale);
    let threshold = f64::EPSILON;
    for _ in 0..MAX_SWEEPS {
        // Squared norms of the columns: kept up to date within a sweep, and new with each.
        for j in 0..n {
            let column = &a[j * n..(j + 1) * n];
            s[j] = dot(column, column);
        }
        let mut rotated = false;
        for p in 0..n {
            for q in p + 1..n {
                let (x, y) = pair(a, p, q, n);
                let gamma = dot(x, y);
                let product = s[p] * s[q];
                // Underflowing columns are zero columns.
                if gamma == 0.0 || gamma.abs() <= threshold * product.sqrt() || product == 0.0 {
                    continue;
                }
                rotated = true;
                let (t, c) = rotation((s[q] - s[p]) / (2.0 * gamma));
                rotate(x, y, c, c * t);
                (s[p], s[q]) = match 16.0 * t.abs() * gamma.abs() < s[p].min(s[q]) {
                    true => (s[p] - t * gamma, s[q] + t * gamma),
                    // What is left of a column after most of it went has too few digits as a difference.
                    false => (dot(x, x), dot(y, y)),
                };
                let (x, y) = pair(v, p, q, n);
                rotate(x, y, c, c * t);
            }
        }
        if !rotated {
            break;
        }
    }
    for j in 0..n {
        s[j] = (0..n)
            .map(|k| a[j * n + k] * a[j * n + k])
            .sum::<f64>()
            .sqrt();
    }
    sort_descending(a, v, s, n);
    let smallest_meaningful = s[0] * f64::EPSILON * n as f64;
    let mut independent = n;
    for j in 0..n {
        if s[j] <= smallest_meaningful {
            independent = j;
            break;
        }
        for k in 0..n {
            a[j * n + k] /= s[j];
        }
    }
    complete_basis(a, n, independent);
    s.iter_mut().for_each(|x| *x *= scale);
}

/// Columns `p < q` of an n × n column-major matrix.
#[inline]
fn pair(a: &mut [f64], p: usize, q: usize, n: usize) -> (&mut [f64], &mut [f64]) {
    let (before, from_q) = a.split_at_mut(q * n);
    (&mut before[p * n..(p + 1) * n], &mut from_q[..n])
}

/// `x'y` in four sums that run beside each other: one sum would wait for each of its additions.
#[inline]
fn dot(x: &[f64], y: &[f64]) -> f64 {
    let (fours_x, rest_x) = x.as_chunks::<4>();
    let (fours_y, rest_y) = y.as_chunks::<4>();
    let mut sums = [0.0; 4];
    for (x, y) in fours_x.iter().zip(fours_y) {
        for i in 0..4 {
            sums[i] += x[i] * y[i];
        }
    }
    let rest: f64 = rest_x.iter().zip(rest_y).map(|(x, y)| x * y).sum();
    (sums[0] + sums[1]) + (sums[2] + sums[3]) + rest
}

/// Tangent and cosine of the rotation that makes two columns orthogonal, the smaller of the two angles, from the cotangent of twice the angle.
///
/// Square roots only, which every machine rounds alike.
#[inline]
fn rotation(cotangent: f64) -> (f64, f64) {
    let size = cotangent.abs();
    // Above 1e8 the root is `size` to the last digit, and its square might overflow.
    let root = if size < 1e8 {
        (size * size + 1.0).sqrt()
    } else {
        size
    };
    let t = cotangent.signum() / (size + root);
    (t, 1.0 / (t * t + 1.0).sqrt())
}

/// Columns x and y ← (c x − s y, s x + c y).
#[inline]
fn rotate(x: &mut [f64], y: &mut [f64], c: f64, s: f64) {
    for (x, y) in x.iter_mut().zip(y) {
        (*x, *y) = (c * *x - s * *y, s * *x + c * *y);
    }
}

fn sort_descending(a: &mut [f64], v: &mut [f64], s: &mut [f64], n: usize) {
    for i in 0..n {
        let largest = (i..n).fold(i, |best, j| if s[j] > s[best] { j } else { best });
        if largest != i {
            s.swap(i, largest);
            for k in 0..n {
                a.swap(i * n + k, largest * n + k);
                v.swap(i * n + k, largest * n + k);
            }
        }
    }
}

/// Replaces columns `from..n` of `a` by unit vectors orthogonal to all others (Gram–Schmidt, twice).
fn complete_basis(a: &mut [f64], n: usize, from: usize) {
    for j in from..n {
        let mut best = (0.0, 0);
        for axis in 0..n {
            // Squared norm of e_axis outside the span of the columns before j.
            let inside: f64 = (0..j).map(|c| a[c * n + axis] * a[c * n + axis]).sum();
            if 1.0 - inside > best.0 {
                best = (1.0 - inside, axis);
            }
        }
        for k in 0..n {
            a[j * n + k] = if k == best.1 { 1.0 } else { 0.0 };
        }
        for _ in 0..2 {
            for c in 0..j {
                let dot: f64 = (0..n).map(|k| a[c * n + k] * a[j * n + k]).sum();
                for k in 0..n {
                    a[j * n + k] -= dot * a[c * n + k];
                }
            }
            let norm = (0..n)
                .map(|k| a[j * n + k] * a[j * n + k])
                .sum::<f64>()
                .sqrt();
            for k in 0..n {
                a[j * n + k] /= norm;
            }
        }
    }
}

/// Cyclic Jacobi on a symmetric column-major matrix; eigenvalues ascending into `values`.
fn cyclic_jacobi(a: &mut [f64], v: &mut [f64], values: &mut [f64], n: usize) {
    // The lower triangle is authoritative.
    for j in 0..n {
        for i in 0..j {
            a[j * n + i] = a[i * n + j];
        }
    }
    for _ in 0..MAX_SWEEPS {
        let mut rotated = false;
        for p in 0..n {
            for q in p + 1..n {
                let off = a[p * n + q];
                let (app, aqq) = (a[p * n + p], a[q * n + q]);
                // Relative to both diagonal entries: keeps small eigenvalues of graded matrices.
                if off == 0.0 || off.abs() <= f64::EPSILON * 0.5 * (app * aqq).abs().sqrt() {
                    continue;
                }
                if off.abs() < f64::MIN_POSITIVE / f64::EPSILON {
                    continue;
                }
                rotated = true;
                let (t, c) = rotation((aqq - app) / (2.0 * off));
                let (x, y) = pair(a, p, q, n);
                rotate(x, y, c, c * t);
                // The rows are the columns of a symmetric matrix, but for the four entries where both meet.
                (x[p], x[q], y[p], y[q]) = (app - t * off, 0.0, 0.0, aqq + t * off);
                for k in 0..n {
                    (a[k * n + p], a[k * n + q]) = (a[p * n + k], a[q * n + k]);
                }
                let (x, y) = pair(v, p, q, n);
                rotate(x, y, c, c * t);
            }
        }
        if !rotated {
            break;
        }
    }
    for i in 0..n {
        values[i] = a[i * n + i];
    }
    for i in 0..n {
        let smallest = (i..n).fold(i, |best, j| if values[j] < values[best] { j } else { best });
        if smallest != i {
            values.swap(i, smallest);
            for k in 0..n {
                v.swap(i * n + k, smallest * n + k);
            }
        }
    }
}
