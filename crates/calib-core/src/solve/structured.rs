//! Whitening without ever forming V_s: a block-diagonal part and a few random effects.
//!
//! ```text
//! V = D + U Uᵀ,   D = L_D L_Dᵀ (a block per observation),   U = G diag(σ_k)   (m × k)
//! L_D⁻¹ U = Q R  (Gram–Schmidt, twice),      I + R Rᵀ = L Lᵀ                                 (1)
//! W = (I − Q (I − L⁻¹) Qᵀ) L_D⁻¹,            W V Wᵀ = I                                      (2)
//! V⁻¹ = L_D⁻ᵀ (I − Q S Qᵀ) L_D⁻¹,            S = I − L⁻ᵀ L⁻¹                                 (3)
//! ```
//!
//! Orthogonal Q instead of Woodbury's formula: nothing cancels, however large the random effects are.

use crate::model::layout::Model;
use crate::solve::rows::{SampleRows, add_block};

/// Q, T = I − L⁻¹ and S of equations (1) to (3) for one sample.
#[derive(Debug, Clone, Default)]
pub(crate) struct RandomPart {
    m: usize,
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
            let sigma: Vec<f64> = model
                .slots
                .iter()
                .map(|slot| slot.group.map_or(1.0, |g| theta[g]).sqrt())
                .collect();
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
        let (m, k) = (self.m, self.k);
        out.m = m;
        out.k = k;
        out.q.clear();
        out.q.extend_from_slice(&self.g[..m * k]);
        let mut r = vec![0.0; k * k];
        let before: Vec<f64> = (0..k).map(|c| norm(&out.q, m, k, c)).collect();
        for c in 0..k {
            // Its first projection was taken when each of the earlier columns was finished.
            for p in 0..c {
                let mut along = 0.0;
                for i in 0..m {
                    along += out.q[i * k + p] * out.q[i * k + c];
                }
                r[p * k + c] += along;
                for i in 0..m {
                    out.q[i * k + c] -= along * out.q[i * k + p];
                }
            }
            let size = norm(&out.q, m, k, c);
            let new = size > DEPENDENT * before[c];
            r[c * k + c] = if new { size } else { 0.0 };
            let factor = if new { 1.0 / size } else { 0.0 };
            for i in 0..m {
                out.q[i * k + c] *= factor;
            }
            project_later(&mut out.q, k, c, &mut r[c * k..(c + 1) * k]);
        }
        // L of I + R Rᵀ
        let mut l = vec![0.0; k * k];
        for i in 0..k {
            for j in 0..=i {
                let mut sum = if i == j { 1.0 } else { 0.0 };
                for c in i..k {
                    sum += r[i * k + c] * r[j * k + c];
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
        out.t.clear();
        out.s.clear();
        for i in 0..k {
            for j in 0..k {
                let unit = if i == j { 1.0 } else { 0.0 };
                let square: f64 = (i.max(j)..k)
                    .map(|c| inverse[c * k + i] * inverse[c * k + j])
                    .sum();
                out.t.push(unit - inverse[i * k + j]);
                out.s.push(unit - square);
            }
        }
        Some(())
    }
}

impl RandomPart {
    /// What a later [`RandomPart::load`] needs to whiten another residual with the same V, in rows that are not turned.
    pub(crate) fn store(&self, rows: &SampleRows, into: &mut Vec<f64>) {
        rows.append_unturned(&self.q, self.k, into);
        into.extend_from_slice(&self.t);
    }

    /// Reads back what [`RandomPart::store`] wrote for a sample of m rows and k effects; returns its length.
    pub(crate) fn load(&mut self, from: &[f64], m: usize, k: usize) -> usize {
        self.m = m;
        self.k = k;
        self.q.clear();
        self.q.extend_from_slice(&from[..m * k]);
        self.t.clear();
        self.t.extend_from_slice(&from[m * k..m * k + k * k]);
        m * k + k * k
    }

    /// Equation (2) without L_D⁻¹: x ← (I − Q T Qᵀ) x, x being m rows of `columns`.
    pub(crate) fn whiten(&self, x: &mut [f64], columns: usize) {
        self.take_out(&self.t, x, columns);
    }

    /// Equation (3) without the L_D: x ← (I − Q S Qᵀ) x.
    pub(crate) fn weigh(&self, x: &mut [f64], columns: usize) {
        self.take_out(&self.s, x, columns);
    }

    fn take_out(&self, matrix: &[f64], x: &mut [f64], columns: usize) {
        let (m, k) = (self.m, self.k);
        if k == 0 {
            return;
        }
        let (q, width) = (&self.q[..m * k], columns.max(1));
        let mut terms = Vec::with_capacity(m.max(k));
        let mut z = vec![0.0; k * columns];
        for (c, z) in z.chunks_exact_mut(width).enumerate() {
            nonzero(&mut terms, m, |i| q[i * k + c]);
            add_rows(z, &terms, x);
        }
        let mut mixed = vec![0.0; k * columns];
        for (i, mixed) in mixed.chunks_exact_mut(width).enumerate() {
            nonzero(&mut terms, k, |j| matrix[i * k + j]);
            add_rows(mixed, &terms, &z);
        }
        for (i, x) in x.chunks_exact_mut(width).enumerate() {
            nonzero(&mut terms, k, |c| -q[i * k + c]);
            add_rows(x, &terms, &mixed);
        }
    }
}

/// Factors that are not zero, with their places.
#[inline]
fn nonzero(terms: &mut Vec<(f64, usize)>, count: usize, factor: impl Fn(usize) -> f64) {
    terms.clear();
    terms.extend(
        (0..count)
            .map(|at| (factor(at), at))
            .filter(|(f, _)| *f != 0.0),
    );
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

/// x += Σ factor · row over the rows of a matrix as wide as x, four at a time: each sum is in their order.
#[inline]
fn add_rows(x: &mut [f64], terms: &[(f64, usize)], rows: &[f64]) {
    let n = x.len();
    let row = |at: usize| &rows[at * n..at * n + n];
    let mut fours = terms.chunks_exact(4);
    for four in &mut fours {
        let [a, b, c, d] = [four[0].0, four[1].0, four[2].0, four[3].0];
        let [p, q] = [row(four[0].1), row(four[1].1)];
        let [r, s] = [row(four[2].1), row(four[3].1)];
        for i in 0..n {
            x[i] = x[i] + a * p[i] + b * q[i] + c * r[i] + d * s[i];
        }
    }
    for &(factor, at) in fours.remainder() {
        x.iter_mut()
            .zip(row(at))
            .for_each(|(x, y)| *x += factor * y);
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
