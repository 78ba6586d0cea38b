//! What a matrix does not see, from a QR decomposition with column pivoting: a tenth of the price of all singular vectors.

use nalgebra::DMatrix;

use super::{dot, lower_inverse};

/// Rank of a matrix, and what it does not see.
#[derive(Debug, Clone, PartialEq)]
pub struct NullSpace {
    /// Singular values above the tolerance.
    pub rank: usize,
    /// n × (n − rank), orthonormal columns.
    pub basis: DMatrix<f64>,
}

/// Rank and null space of A (n columns), singular values at or below `relative_tolerance` times the largest counting as 0; `None` where that is not
/// beyond doubt: some lie near the tolerance, and only the singular values themselves can say.
///
/// ```text
/// A P = Q [R₁ R₂; 0 E],   σ_k(A) ≥ 1/|R₁⁻¹|_F,   σ_k+1(A) ≤ |E|_F,   N = P [−R₁⁻¹R₂; I]
/// ```
///
/// N is that of the singular vectors within the angle (|E| |R₁⁻¹|)².
#[must_use]
pub fn null_space(a: &DMatrix<f64>, relative_tolerance: f64) -> Option<NullSpace> {
    /// Factor of the tolerance on both sides in which nothing is decided here.
    const DOUBT: f64 = 10.0;
    /// Largest |E| |R₁⁻¹|.
    const APART: f64 = 1e-6;
    let n = a.ncols();
    let least = relative_tolerance / (DOUBT * (n as f64).sqrt());
    let Pivoted {
        rows,
        pivots,
        left,
        longest,
        below,
    } = pivoted(&(a / scale_of(a)), least);
    if !(longest.is_finite() && below.is_finite()) {
        return None;
    }
    let rank = pivots.len();
    if rank == 0 {
        return Some(NullSpace {
            rank,
            basis: DMatrix::identity(n, n),
        });
    }
    // Column after column of R₁ is row after row of its transpose.
    let first = rows.select_columns(&pivots);
    let inverse = DMatrix::from_vec(rank, rank, lower_inverse(first.as_slice(), rank));
    let (size, of_inverse) = (rows.norm(), inverse.norm());
    // |E|_F of no more columns than are left, none longer than `below`
    let rest = below * (left.len() as f64).sqrt();
    let clear = of_inverse * size * relative_tolerance * DOUBT < 1.0 && rest * of_inverse < APART;
    if !clear {
        return None;
    }
    let mut basis = DMatrix::zeros(n, left.len());
    if !left.is_empty() {
        let solved = &inverse * rows.select_columns(&left);
        for (k, column) in solved.column_iter().enumerate() {
            basis[(left[k], k)] = 1.0;
            for (&pivot, x) in pivots.iter().zip(&column) {
                basis[(pivot, k)] = -x;
            }
        }
        basis = basis.qr().q();
    }
    Some(NullSpace { rank, basis })
}

/// The largest entry where it can divide: squares of very small numbers are 0, those of very large ones infinite.
pub(super) fn scale_of(a: &DMatrix<f64>) -> f64 {
    let size = a.amax();
    match size > 0.0 && size.is_finite() {
        true => size,
        false => 1.0,
    }
}

/// A QR decomposition with column pivoting that ends where what is left counts as nothing.
pub(super) struct Pivoted {
    /// R, columns in their places.
    pub(super) rows: DMatrix<f64>,
    /// Columns in the order in which they were taken.
    pub(super) pivots: Vec<usize>,
    /// Columns that were not taken.
    left: Vec<usize>,
    /// Norm of the longest column.
    longest: f64,
    /// Norm of the longest column of what is left.
    below: f64,
}

/// Householder reflections until what remains is at most `relative_tolerance` times the longest column.
pub(super) fn pivoted(a: &DMatrix<f64>, relative_tolerance: f64) -> Pivoted {
    let (m, n) = a.shape();
    let mut work = a.clone();
    let data = work.as_mut_slice();
    // Columns that were not taken as pivots yet, in their order.
    let mut left: Vec<usize> = (0..n).collect();
    let mut longest = 0.0;
    let mut reflector = vec![0.0; m];
    let mut pivots = Vec::new();
    let mut below = 0.0;
    while !left.is_empty() {
        let rank = pivots.len();
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
        if rank == m || norm <= relative_tolerance * longest || !norm.is_finite() {
            below = norm;
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
        pivots.push(pivot);
    }
    Pivoted {
        rows: work.rows(0, pivots.len()).into_owned(),
        pivots,
        left,
        longest,
        below,
    }
}
