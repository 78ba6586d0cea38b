//! L of a positive definite matrix = L Lᵀ, in place, and what follows from it.

use std::ops::Range;

use nalgebra::DMatrix;

use super::dot;

/// Lower Cholesky factor in place (row-major, lower triangle): columns block by block, what earlier blocks take from them as one product. `false`
/// where the n × n matrix is not positive definite.
pub fn cholesky_in_place(a: &mut [f64], n: usize) -> bool {
    /// Columns of a block.
    const BLOCK: usize = 64;
    for first in (0..n).step_by(BLOCK) {
        let end = n.min(first + BLOCK);
        if first > 0 {
            take_earlier(a, n, first..end);
        }
        for i in first..n {
            for j in first..end.min(i + 1) {
                let (ri, rj) = (&a[i * n + first..i * n + j], &a[j * n + first..j * n + j]);
                let sum = a[i * n + j] - dot(ri, rj);
                if i == j {
                    if !(sum > 0.0 && sum.is_finite()) {
                        return false;
                    }
                    a[i * n + i] = sum.sqrt();
                } else {
                    a[i * n + j] = sum / a[j * n + j];
                }
            }
        }
    }
    true
}

/// A_ij −= Σ_c L_ic L_jc over the columns before those of a block, for its columns j.
fn take_earlier(a: &mut [f64], n: usize, block: Range<usize>) {
    let first = block.start;
    let mut done = DMatrix::zeros(first, n - first);
    for (i, mut row) in done.column_iter_mut().enumerate() {
        let from = (first + i) * n;
        row.copy_from_slice(&a[from..from + first]);
    }
    // The product of a transpose has no fast kernel.
    let product = done.transpose() * done.columns(0, block.len());
    for i in first..n {
        for j in first..block.end.min(i + 1) {
            a[i * n + j] -= product[(i - first, j - first)];
        }
    }
}

/// y ← (L Lᵀ)⁻¹ y, L row by row.
pub fn solve_in_place(l: &[f64], n: usize, y: &mut [f64]) {
    for i in 0..n {
        let sum = dot(&l[i * n..i * n + i], &y[..i]);
        y[i] = (y[i] - sum) / l[i * n + i];
    }
    for i in (0..n).rev() {
        y[i] /= l[i * n + i];
        let yi = y[i];
        for j in 0..i {
            y[j] -= l[i * n + j] * yi;
        }
    }
}

/// L⁻¹ of a lower triangular L (n × n), both row by row.
#[must_use]
pub fn lower_inverse(l: &[f64], n: usize) -> Vec<f64> {
    let mut out = vec![0.0; n * n];
    for i in 0..n {
        // row i of L⁻¹ = (e_i − Σ_j<i L_ij row j) / L_ii
        let (done, rest) = out.split_at_mut(i * n);
        let row = &mut rest[..=i];
        for (j, &factor) in l[i * n..i * n + i].iter().enumerate() {
            if factor != 0.0 {
                let above = &done[j * n..=j * n + j];
                row.iter_mut()
                    .zip(above)
                    .for_each(|(x, y)| *x -= factor * y);
            }
        }
        row[i] = 1.0;
        let d = 1.0 / l[i * n + i];
        row.iter_mut().for_each(|x| *x *= d);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Within one block and over several, and a matrix that is not positive definite.
    #[test]
    fn a_factor_gives_the_matrix_back() {
        for n in [1, 63, 64, 65, 150] {
            let b = DMatrix::from_fn(n, n, |i, k| ((i * 31 + k * 17) as f64).sin());
            let matrix = &b * b.transpose() + DMatrix::identity(n, n);
            let mut a: Vec<f64> = matrix.iter().copied().collect();
            assert!(cholesky_in_place(&mut a, n));
            let l = DMatrix::from_row_slice(n, n, &a).lower_triangle();
            assert!((&l * l.transpose() - &matrix).amax() < 1e-12 * n as f64 * matrix.amax());
            let mut indefinite = matrix;
            indefinite[(n - 1, n - 1)] = -1.0;
            let mut a: Vec<f64> = indefinite.iter().copied().collect();
            assert!(!cholesky_in_place(&mut a, n));
        }
    }
}
