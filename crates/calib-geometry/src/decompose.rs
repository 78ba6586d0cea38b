//! The decompositions that estimation trusts: one-sided Jacobi SVD behind a Householder QR, cyclic
//! Jacobi for symmetric matrices, and the pencil `DᵀD u = λ C u`.
//!
//! A general-purpose SVD that iterates on a bidiagonal form can return wrong factors for repeated or
//! vanishing singular values, which is what an exact hinge or a one-axis sweep produces. Jacobi methods
//! are slower and have no such case: each rotation is orthogonal to rounding, and small singular
//! values keep their relative accuracy (Demmel & Veselić 1992).

use nalgebra::{DMatrix, DVector, SMatrix, SVector};

mod bordered;
mod cholesky;
mod jacobi;
mod null_space;

pub use bordered::{InverseRoot, inverse_root, solve_positive};
pub use cholesky::{cholesky_in_place, lower_inverse, solve_in_place};
pub use jacobi::dot;
use jacobi::{cyclic_jacobi, one_sided_jacobi};
pub use null_space::{NullSpace, null_space};

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

/// The half of a singular value decomposition `A = U diag(s) Vᵀ` that says what rows of A see of each direction.
#[derive(Debug, Clone, PartialEq)]
pub struct RightSingular {
    /// n singular values, descending, ≥ 0.
    pub s: DVector<f64>,
    /// n × n, orthonormal columns in the order of `s`; those of no singular value complete the basis.
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
    one_sided_jacobi(
        work.as_mut_slice(),
        Some(v.as_mut_slice()),
        s.as_mut_slice(),
        n,
    );
    let u = match q {
        Some(q) => q * work,
        None => work,
    };
    Svd { u, s, v }
}

/// Singular values and right singular vectors of any real matrix with finite entries.
///
/// Householder QR with column pivoting, `A P = Q R`, then one-sided Jacobi on the columns of `P Rᵀ = V diag(s) Uᵀ`: they become
/// `V diag(s)` in a few sweeps, for R is graded, and nothing is accumulated (Drmač & Veselić 2008). Singular values that are rounding of the
/// largest, at most n ε of it, are 0.
#[must_use]
pub fn right_singular(a: &DMatrix<f64>) -> RightSingular {
    let n = a.ncols();
    if n == 0 {
        return RightSingular {
            s: DVector::zeros(0),
            v: DMatrix::zeros(0, 0),
        };
    }
    let scale = null_space::scale_of(a);
    let rows = row_factor(&(a / scale), f64::EPSILON * (n as f64).sqrt());
    let mut v = DMatrix::zeros(n, n);
    v.columns_mut(0, rows.nrows()).tr_copy_from(&rows);
    let mut s = DVector::zeros(n);
    one_sided_jacobi(v.as_mut_slice(), None, s.as_mut_slice(), n);
    RightSingular { s: s * scale, v }
}

/// Eigen decomposition of a positive semidefinite matrix; what rounding leaves negative counts as 0.
#[must_use]
pub fn semidefinite_eigen(a: &DMatrix<f64>) -> SymmetricEigen {
    let RightSingular { s, v } = right_singular(&square_root(a).transpose());
    let n = s.len();
    SymmetricEigen {
        values: DVector::from_fn(n, |i, _| s[n - 1 - i] * s[n - 1 - i]),
        vectors: DMatrix::from_fn(n, n, |r, c| v[(r, n - 1 - c)]),
    }
}

/// Singular values only, descending; as accurate as [`svd`], without the m × n factor.
#[must_use]
pub fn singular_values(a: &DMatrix<f64>) -> DVector<f64> {
    let (m, n) = a.shape();
    if m < n {
        return singular_values(&a.transpose());
    }
    let mut r = if m > n { a.clone().qr().r() } else { a.clone() };
    let mut s = DVector::zeros(n);
    one_sided_jacobi(r.as_mut_slice(), None, s.as_mut_slice(), n);
    s
}

/// SVD of a small square matrix without allocation.
#[must_use]
pub fn svd_small<const N: usize>(a: &SMatrix<f64, N, N>) -> SvdSmall<N> {
    let mut u = *a;
    let mut v = SMatrix::<f64, N, N>::identity();
    let mut s = SVector::<f64, N>::zeros();
    one_sided_jacobi(
        u.as_mut_slice(),
        Some(v.as_mut_slice()),
        s.as_mut_slice(),
        N,
    );
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
    null_space::pivoted(a, relative_tolerance).rows
}

/// H with `HHᵀ = A` of a positive semidefinite A (n × n), as many columns as A has directions above rounding: Cholesky with the largest
/// diagonal entry first. What rounding leaves negative counts as nothing.
#[must_use]
pub fn square_root(a: &DMatrix<f64>) -> DMatrix<f64> {
    let n = a.nrows();
    let mut left: Vec<f64> = a.diagonal().iter().copied().collect();
    let nothing = left.iter().copied().fold(0.0, f64::max) * f64::EPSILON * n as f64;
    let mut h = DMatrix::zeros(n, n);
    let mut rank = 0;
    while rank < n {
        let largest = (0..n).fold(0, |best, i| if left[i] > left[best] { i } else { best });
        if left[largest] <= nothing || left[largest].is_nan() {
            break;
        }
        // h = (A e_p − H Hᵀe_p) / √(A_pp − |Hᵀe_p|²)
        let (done, mut rest) = h.columns_range_pair_mut(0..rank, rank..n);
        let mut column = rest.column_mut(0);
        column.copy_from(&a.column(largest));
        column.gemv(-1.0, &done, &done.row(largest).transpose(), 1.0);
        let root = left[largest].sqrt();
        column /= root;
        for (left, h) in left.iter_mut().zip(column.iter()) {
            *left -= h * h;
        }
        left[largest] = 0.0;
        rank += 1;
    }
    h.columns(0, rank).into_owned()
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
