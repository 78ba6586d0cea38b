//! The triangular factor of a tall, thin matrix that is fed row by row.
//!
//! ```text
//! A = Q R,   A: n × N, n ≫ N,   R: N × N upper triangular                            (1)
//! ```
//!
//! Rows are collected in a block of fixed size on the stack; a full block is reduced by Householder
//! reflections to N rows, which become the head of the next block. `RᵀR = AᵀA` without ever forming the
//! product, so small singular values of A survive (the normal equations lose half of the digits).

use nalgebra::SMatrix;

/// Rows of one block: long enough to amortise the reduction, short enough for the first cache.
const BLOCK: usize = 64;

/// Accumulates rows; [`RowQr::factor`] returns R. Does not allocate.
#[derive(Debug, Clone)]
pub struct RowQr<const N: usize> {
    /// Column-major: one array for each column.
    columns: [[f64; BLOCK]; N],
    rows: usize,
}

impl<const N: usize> Default for RowQr<N> {
    fn default() -> Self {
        Self {
            columns: [[0.0; BLOCK]; N],
            rows: 0,
        }
    }
}

impl<const N: usize> RowQr<N> {
    /// Adds one row.
    #[inline]
    pub fn push(&mut self, row: [f64; N]) {
        if self.rows == BLOCK {
            self.reduce();
        }
        for (column, x) in self.columns.iter_mut().zip(row) {
            column[self.rows] = x;
        }
        self.rows += 1;
    }

    /// The N × N upper triangular factor of all rows so far (zero rows below where fewer were given).
    #[must_use]
    pub fn factor(mut self) -> SMatrix<f64, N, N> {
        self.reduce();
        SMatrix::from_fn(|i, j| {
            if i <= j && i < self.rows {
                self.columns[j][i]
            } else {
                0.0
            }
        })
    }

    /// Householder reduction of the block to its first N rows.
    fn reduce(&mut self) {
        let m = self.rows;
        for k in 0..N.min(m) {
            // v = x ± ‖x‖ e₁,  H = I − 2 v vᵀ / vᵀv,  the sign without cancellation
            let norm = self.columns[k][k..m]
                .iter()
                .map(|x| x * x)
                .sum::<f64>()
                .sqrt();
            if norm == 0.0 {
                continue;
            }
            let head = self.columns[k][k];
            let alpha = if head > 0.0 { -norm } else { norm };
            // vᵀv = 2 (‖x‖² − α x₁)
            let half_vtv = norm * norm - alpha * head;
            let (left, right) = self.columns.split_at_mut(k + 1);
            let v = &mut left[k];
            v[k] = head - alpha;
            for column in right {
                let dot: f64 = v[k..m].iter().zip(&column[k..m]).map(|(a, b)| a * b).sum();
                let factor = dot / half_vtv;
                for (x, a) in column[k..m].iter_mut().zip(&v[k..m]) {
                    *x -= factor * a;
                }
            }
            v[k] = alpha;
            v[k + 1..m].fill(0.0);
        }
        self.rows = m.min(N);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::SVector;

    #[test]
    fn the_factor_has_the_gram_matrix_of_its_rows() {
        for n in [0, 1, 2, 3, 5, 63, 64, 65, 200, 1000] {
            let mut qr = RowQr::<3>::default();
            let mut gram = SMatrix::<f64, 3, 3>::zeros();
            for i in 0..n {
                let x = i as f64;
                let row = SVector::<f64, 3>::new((x * 0.7).sin(), (x * 1.3).cos() + 0.2, 0.01 * x);
                gram += row * row.transpose();
                qr.push(row.into());
            }
            let r = qr.factor();
            let defect = (r.transpose() * r - gram).amax();
            assert!(
                defect <= 1e-12 * gram.amax().max(1.0),
                "n = {n}: {defect:e}"
            );
        }
    }

    #[test]
    fn a_small_direction_survives_the_reduction() {
        let mut qr = RowQr::<2>::default();
        for i in 0..500 {
            let x = f64::from(i) / 500.0;
            // Two nearly parallel columns: the second singular value is 1e-10 of the first.
            qr.push([1.0, 1.0 + 1e-10 * (20.0 * x).sin()]);
        }
        let r = qr.factor();
        let expected = 1e-10
            * (0..500)
                .map(|i| (20.0 * f64::from(i) / 500.0).sin())
                .collect::<Vec<_>>()
                .iter()
                .map(|s| s * s)
                .sum::<f64>()
                .sqrt();
        assert!(
            (r[(1, 1)].abs() / expected - 1.0).abs() < 0.01,
            "{} {expected}",
            r[(1, 1)]
        );
    }
}
