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
        for c in 0..k {
            let before = norm(&out.q, m, k, c);
            for _ in 0..2 {
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
            }
            let size = norm(&out.q, m, k, c);
            let new = size > DEPENDENT * before;
            r[c * k + c] = if new { size } else { 0.0 };
            let factor = if new { 1.0 / size } else { 0.0 };
            for i in 0..m {
                out.q[i * k + c] *= factor;
            }
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
    /// What a later [`RandomPart::load`] needs to whiten another residual with the same V.
    pub(crate) fn store(&self, into: &mut Vec<f64>) {
        into.extend_from_slice(&self.q);
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
        let mut z = vec![0.0; k * columns];
        for i in 0..m {
            let row = &x[i * columns..(i + 1) * columns];
            for c in 0..k {
                let q = self.q[i * k + c];
                if q != 0.0 {
                    let z = &mut z[c * columns..(c + 1) * columns];
                    z.iter_mut().zip(row).for_each(|(z, x)| *z += q * x);
                }
            }
        }
        let mut mixed = vec![0.0; k * columns];
        for i in 0..k {
            for j in 0..k {
                let factor = matrix[i * k + j];
                if factor != 0.0 {
                    let from = &z[j * columns..(j + 1) * columns];
                    let to = &mut mixed[i * columns..(i + 1) * columns];
                    to.iter_mut().zip(from).for_each(|(t, f)| *t += factor * f);
                }
            }
        }
        for i in 0..m {
            let row = &mut x[i * columns..(i + 1) * columns];
            for c in 0..k {
                let q = self.q[i * k + c];
                if q != 0.0 {
                    let from = &mixed[c * columns..(c + 1) * columns];
                    row.iter_mut().zip(from).for_each(|(x, f)| *x -= q * f);
                }
            }
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
