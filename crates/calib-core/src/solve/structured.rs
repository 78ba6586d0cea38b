//! Whitening without ever forming V_s: a block-diagonal part and a few random effects.
//!
//! ```text
//! V = D + U Uᵀ,   D = L_D L_Dᵀ (a block per observation),   U = G diag(σ_k)   (m × k)
//! L_D⁻¹ U = Q R  (Gram–Schmidt, twice),      I + R Rᵀ = L Lᵀ                                 (1)
//! W = (I − Q (I − L⁻¹) Qᵀ) L_D⁻¹,            W V Wᵀ = I                                      (2)
//! V⁻¹ = L_D⁻ᵀ (I − Q S Qᵀ) L_D⁻¹,            S = I − L⁻ᵀ L⁻¹                                 (3)
//! ```
//!
//! Orthogonal Q instead of Woodbury's formula: nothing cancels, however large the random effects are. Where there are no fewer random
//! effects than rows, Q is the unit matrix, R = L_D⁻¹ U, and L is as small as the sample.

use nalgebra::{DMatrixView, DMatrixViewMut};

use crate::model::layout::Model;
use crate::solve::rows::{SampleRows, add_block};

/// Q, T = I − L⁻¹ and S of equations (1) to (3) for one sample.
#[derive(Debug, Clone, Default)]
pub(crate) struct RandomPart {
    m: usize,
    /// Columns of Q: the random effects, or the rows where those are no more.
    k: usize,
    /// m × k
    q: Vec<f64>,
    /// k × k
    t: Vec<f64>,
    /// k × k
    s: Vec<f64>,
}

/// A column that is this small beside what it was before projection adds no direction.
const DEPENDENT: f64 = 1e-12;

impl SampleRows {
    /// L_D⁻¹ times r, G diag(σ_k) and, if asked, J; `None` when some block is not positive definite.
    pub(crate) fn whiten_blocks(
        &mut self,
        model: &Model,
        weights: &[f64],
        theta: &[f64],
        jacobian: bool,
    ) -> Option<()> {
        let (n, k) = (self.n, self.k);
        if k > 0 {
            let level = |&slot: &usize| model.slots[slot].group.map_or(1.0, |g| theta[g]);
            let sigma: Vec<f64> = self.part.slots.iter().map(|s| level(s).sqrt()).collect();
            for row in self.g[..self.m * k].chunks_exact_mut(k) {
                row.iter_mut().zip(&sigma).for_each(|(x, s)| *x *= s);
            }
        }
        for b in 0..self.blocks.len() {
            let (o, first, count) = self.blocks[b];
            let mut l = [[0.0; 6]; 6];
            add_block(model, o, |i, j, group, shape| {
                l[i][j] += theta[group] * shape / weights[o];
            });
            for i in 0..count {
                for j in 0..=i {
                    let mut sum = l[i][j];
                    for c in 0..j {
                        sum -= l[i][c] * l[j][c];
                    }
                    if i == j {
                        if !(sum > 0.0 && sum.is_finite()) {
                            return None;
                        }
                        l[i][i] = sum.sqrt();
                    } else {
                        l[i][j] = sum / l[j][j];
                    }
                }
            }
            for i in 0..count {
                let row = first + i;
                for (c, &factor) in l[i][..i].iter().enumerate() {
                    if factor != 0.0 {
                        self.r[row] -= factor * self.r[first + c];
                        subtract(&mut self.g, k, row, first + c, factor);
                        if jacobian {
                            subtract(&mut self.j, n, row, first + c, factor);
                        }
                    }
                }
                let d = 1.0 / l[i][i];
                self.r[row] *= d;
                self.g[row * k..(row + 1) * k]
                    .iter_mut()
                    .for_each(|x| *x *= d);
                if jacobian {
                    self.j[row * n..(row + 1) * n]
                        .iter_mut()
                        .for_each(|x| *x *= d);
                }
            }
        }
        Some(())
    }

    /// Equation (1) from the block-whitened G; `None` when a number is not finite.
    pub(crate) fn random_part(&self, out: &mut RandomPart) -> Option<()> {
        out.of_columns(&self.g[..self.m * self.k], self.m, self.k)
    }
}

impl RandomPart {
    /// Equation (1) from L_D⁻¹ U, m × `effects`; `None` when a number is not finite.
    fn of_columns(&mut self, columns: &[f64], m: usize, effects: usize) -> Option<()> {
        self.m = m;
        self.k = m.min(effects);
        if m <= effects {
            self.q.clear();
            self.q.resize(m * m, 0.0);
            self.q.iter_mut().step_by(m + 1).for_each(|q| *q = 1.0);
            self.factor(columns, effects)
        } else {
            let r = self.orthogonalize(columns);
            self.factor(&r, effects)
        }
    }

    /// Q from m rows of k columns; returns R.
    fn orthogonalize(&mut self, columns: &[f64]) -> Vec<f64> {
        let (m, k) = (self.m, self.k);
        self.q.clear();
        self.q.extend_from_slice(columns);
        let q = &mut self.q;
        let mut r = vec![0.0; k * k];
        let mut again = vec![0.0; k];
        let before: Vec<f64> = (0..k).map(|c| norm(q, m, k, c)).collect();
        for c in 0..k {
            // Its first projection was taken when each of the earlier columns was finished.
            again.fill(0.0);
            for row in q.chunks_exact(k) {
                let own = row[c];
                again[..c]
                    .iter_mut()
                    .zip(row)
                    .for_each(|(x, q)| *x += q * own);
            }
            for (p, x) in again[..c].iter().enumerate() {
                r[p * k + c] += x;
            }
            for row in q.chunks_exact_mut(k) {
                row[c] -= along(&row[..c], &again);
            }
            let size = norm(q, m, k, c);
            let new = size > DEPENDENT * before[c];
            r[c * k + c] = if new { size } else { 0.0 };
            let factor = if new { 1.0 / size } else { 0.0 };
            for i in 0..m {
                q[i * k + c] *= factor;
            }
            project_later(q, k, c, &mut r[c * k..(c + 1) * k]);
        }
        r
    }

    /// T and S of equations (1) and (3) from R, k × `effects`; `None` when a number is not finite.
    fn factor(&mut self, r: &[f64], effects: usize) -> Option<()> {
        let k = self.k;
        // L of I + R Rᵀ
        let mut l = vec![0.0; k * k];
        for i in 0..k {
            for j in 0..=i {
                let mut sum = if i == j { 1.0 } else { 0.0 };
                for c in 0..effects {
                    sum += r[i * effects + c] * r[j * effects + c];
                }
                for c in 0..j {
                    sum -= l[i * k + c] * l[j * k + c];
                }
                if i == j {
                    if !(sum > 0.0 && sum.is_finite()) {
                        return None;
                    }
                    l[i * k + i] = sum.sqrt();
                } else {
                    l[i * k + j] = sum / l[j * k + j];
                }
            }
        }
        let mut inverse = vec![0.0; k * k];
        for c in 0..k {
            for i in c..k {
                let mut sum = if i == c { 1.0 } else { 0.0 };
                for j in c..i {
                    sum -= l[i * k + j] * inverse[j * k + c];
                }
                inverse[i * k + c] = sum / l[i * k + i];
            }
        }
        self.t.clear();
        self.s.clear();
        for i in 0..k {
            for j in 0..k {
                let unit = if i == j { 1.0 } else { 0.0 };
                let square: f64 = (i.max(j)..k)
                    .map(|c| inverse[c * k + i] * inverse[c * k + j])
                    .sum();
                self.t.push(unit - inverse[i * k + j]);
                self.s.push(unit - square);
            }
        }
        Some(())
    }

    /// What a later [`RandomPart::load`] needs to whiten another residual with the same V, in rows that are not turned.
    pub(crate) fn store(&self, rows: &SampleRows, into: &mut Vec<f64>) {
        into.push(self.k as f64);
        rows.append_unturned(&self.q, self.k, into);
        into.extend_from_slice(&self.t);
    }

    /// Reads back what [`RandomPart::store`] wrote for a sample of m rows; returns its length.
    pub(crate) fn load(&mut self, from: &[f64], m: usize) -> usize {
        let k = from[0] as usize;
        let (q, t) = (1 + m * k, 1 + m * k + k * k);
        self.m = m;
        self.k = k;
        self.q.clear();
        self.q.extend_from_slice(&from[1..q]);
        self.t.clear();
        self.t.extend_from_slice(&from[q..t]);
        t
    }

    /// Equation (2) without L_D⁻¹ of one column: x ← (I − Q T Qᵀ) x.
    pub(crate) fn whiten(&self, x: &mut [f64]) {
        self.take_out(&self.t, x);
    }

    /// Equation (3) without the L_D of one column: x ← (I − Q S Qᵀ) x.
    pub(crate) fn weigh(&self, x: &mut [f64]) {
        self.take_out(&self.s, x);
    }

    /// (I − Q T Qᵀ) x of m rows of `columns`, to `out`.
    pub(crate) fn whiten_rows(&self, x: &[f64], columns: usize, out: &mut [f64]) {
        self.take_out_of_rows(&self.t, x, columns, out);
    }

    /// (I − Q S Qᵀ) x of m rows of `columns`, to `out`.
    pub(crate) fn weigh_rows(&self, x: &[f64], columns: usize, out: &mut [f64]) {
        self.take_out_of_rows(&self.s, x, columns, out);
    }

    /// Equation (3) itself without the L_D: I − Q S Qᵀ, m × m.
    pub(crate) fn weight(&self) -> Vec<f64> {
        let m = self.m;
        let mut out = vec![0.0; m * m];
        self.without(&self.q_times(&self.s), &mut out);
        out
    }

    fn take_out(&self, matrix: &[f64], x: &mut [f64]) {
        let k = self.k;
        if k == 0 {
            return;
        }
        let mut z = vec![0.0; k];
        for (row, x) in self.q.chunks_exact(k).zip(&*x) {
            z.iter_mut().zip(row).for_each(|(z, q)| *z += q * x);
        }
        let rows = matrix.chunks_exact(k);
        let mixed: Vec<f64> = rows.map(|row| along(row, &z)).collect();
        for (row, x) in self.q.chunks_exact(k).zip(x) {
            *x -= along(row, &mixed);
        }
    }

    /// (I − Q A Qᵀ) x. A matrix of m × m is the shorter way where random effects are no fewer than half of the rows.
    fn take_out_of_rows(&self, matrix: &[f64], x: &[f64], columns: usize, out: &mut [f64]) {
        let (m, k) = (self.m, self.k);
        if k == 0 || columns == 0 || m == 0 {
            out.copy_from_slice(x);
            return;
        }
        let qa = self.q_times(matrix);
        // Row after row is column after column of the transpose.
        let x = DMatrixView::from_slice(x, columns, m);
        let mut out = DMatrixViewMut::from_slice(out, columns, m);
        if m <= 2 * k {
            let mut whole = vec![0.0; m * m];
            self.without(&qa, &mut whole);
            out.gemm(1.0, &x, &DMatrixView::from_slice(&whole, m, m), 0.0);
        } else {
            let z = x * DMatrixView::from_slice(&self.q, k, m).transpose();
            out.copy_from(&x);
            out.gemm(-1.0, &z, &DMatrixView::from_slice(&qa, k, m), 1.0);
        }
    }

    /// Q A of a k × k matrix, m × k.
    fn q_times(&self, matrix: &[f64]) -> Vec<f64> {
        let k = self.k;
        let mut out = vec![0.0; self.m * k];
        for (out, q) in out
            .chunks_exact_mut(k.max(1))
            .zip(self.q.chunks_exact(k.max(1)))
        {
            for (q, row) in q.iter().zip(matrix.chunks_exact(k)) {
                out.iter_mut().zip(row).for_each(|(x, a)| *x += q * a);
            }
        }
        out
    }

    /// I − (Q A) Qᵀ, m × m.
    fn without(&self, qa: &[f64], out: &mut [f64]) {
        let (m, k) = (self.m, self.k.max(1));
        for i in 0..m {
            for j in 0..m {
                let unit = if i == j { 1.0 } else { 0.0 };
                let taken = if self.k == 0 {
                    0.0
                } else {
                    along(&qa[i * k..(i + 1) * k], &self.q[j * k..(j + 1) * k])
                };
                out[i * m + j] = unit - taken;
            }
        }
    }
}

fn along(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Takes column `c` out of all later ones of a matrix with `k` columns, and notes how much in `r`.
fn project_later(q: &mut [f64], k: usize, c: usize, r: &mut [f64]) {
    let later = &mut r[c + 1..];
    for row in q.chunks_exact(k) {
        let own = row[c];
        for (along, x) in later.iter_mut().zip(&row[c + 1..]) {
            *along += own * x;
        }
    }
    for row in q.chunks_exact_mut(k) {
        let own = row[c];
        for (along, x) in later.iter().zip(&mut row[c + 1..]) {
            *x -= along * own;
        }
    }
}

/// Row `to` −= factor · row `from` of a matrix with `columns` columns; `from` < `to`.
fn subtract(x: &mut [f64], columns: usize, to: usize, from: usize, factor: f64) {
    let (above, below) = x.split_at_mut(to * columns);
    let from = &above[from * columns..(from + 1) * columns];
    below[..columns]
        .iter_mut()
        .zip(from)
        .for_each(|(x, y)| *x -= factor * y);
}

fn norm(q: &[f64], m: usize, k: usize, c: usize) -> f64 {
    (0..m)
        .map(|i| q[i * k + c] * q[i * k + c])
        .sum::<f64>()
        .sqrt()
}

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;

    use super::*;

    fn numbers(count: usize, seed: f64) -> Vec<f64> {
        (0..count).map(|i| (seed + 1.7 * i as f64).sin()).collect()
    }

    /// Few and many random effects beside the rows, dependent ones too: a column, all columns at once, the matrix itself, and the dense V.
    #[test]
    fn whitened_rows_have_the_unit_matrix_as_covariance() {
        for (m, k, columns) in [
            (6, 7, 20),
            (6, 40, 20),
            (12, 12, 61),
            (12, 7, 61),
            (12, 3, 5),
            (36, 7, 61),
            (9, 0, 4),
            (6, 2, 0),
            (0, 3, 2),
        ] {
            let mut g = numbers(m * k, 1.0);
            if k > 2 {
                // The last column is twice the first.
                g.chunks_exact_mut(k)
                    .for_each(|row| row[k - 1] = 2.0 * row[0]);
            }
            let mut random = RandomPart::default();
            assert!(random.of_columns(&g, m, k).is_some());
            let dense = {
                let g = DMatrix::from_row_slice(m, k, &g);
                DMatrix::identity(m, m) + &g * g.transpose()
            };
            let x = numbers(m * columns, 4.0);
            let (mut whitened, mut weighed) = (x.clone(), x.clone());
            random.whiten_rows(&x, columns, &mut whitened);
            random.weigh_rows(&x, columns, &mut weighed);
            let all = DMatrix::from_row_slice(m, columns, &x);
            let expected = dense.cholesky().unwrap().solve(&all);
            let whole = DMatrix::from_row_slice(m, columns, &whitened);
            let gram = whole.transpose() * &whole;
            assert!((gram - all.transpose() * &expected).amax() < 1e-11);
            let weight = random.weight();
            for c in 0..columns {
                let column: Vec<f64> = (0..m).map(|i| x[i * columns + c]).collect();
                let (mut one, mut other) = (column.clone(), column.clone());
                random.whiten(&mut one);
                random.weigh(&mut other);
                for i in 0..m {
                    let by_matrix = along(&weight[i * m..(i + 1) * m], &column);
                    assert!((whitened[i * columns + c] - one[i]).abs() < 1e-12);
                    assert!((weighed[i * columns + c] - other[i]).abs() < 1e-12);
                    assert!((by_matrix - other[i]).abs() < 1e-12);
                    assert!((other[i] - expected[(i, c)]).abs() < 1e-11);
                }
            }
        }
    }
}
