//! Sums of rows with joint noise: rows of one instant err together where a joint does.

use calib_geometry::decompose::inverse_root;
use nalgebra::{Cholesky, DMatrix, DVector};

use super::chain::{Chain, Motion};

/// Noise of a prismatic joint in m where a revolute one has it in rad: 0.01 mm beside 0.01°.
const PRISMATIC_NOISE: f64 = 0.06;

/// D of the rows of one instant, its columns weighted, and Dᵀ of all columns.
pub(super) struct JointNoise {
    /// The joint of each column, and its weight.
    joints: Vec<(usize, f64)>,
    d: DMatrix<f64>,
    /// DᵀD
    gram: DMatrix<f64>,
    /// Dᵀ block
    of_block: DMatrix<f64>,
}

impl JointNoise {
    pub(super) fn of(
        chain: &Chain,
        block: &DMatrix<f64>,
        by_reading: Vec<(usize, DVector<f64>)>,
    ) -> Self {
        let weights = by_reading
            .iter()
            .map(|(j, _)| (*j, noise_weight(chain, *j).sqrt()));
        let joints: Vec<(usize, f64)> = weights.collect();
        let mut d = DMatrix::zeros(block.nrows(), joints.len());
        for (k, (_, column)) in by_reading.iter().enumerate() {
            d.column_mut(k).axpy(joints[k].1, column, 0.0);
        }
        // Products with a transpose have no fast kernel.
        let transposed = d.transpose();
        Self {
            gram: &transposed * &d,
            of_block: &transposed * block,
            joints,
            d,
        }
    }

    /// Of joints 0, 1, … whose columns are `d`, with one weight.
    #[cfg(test)]
    pub(super) fn of_columns(d: &DMatrix<f64>, block: &DMatrix<f64>, weight: f64) -> Self {
        let d = d * weight;
        Self {
            joints: (0..d.ncols()).map(|j| (j, weight)).collect(),
            gram: d.tr_mul(&d),
            of_block: d.tr_mul(block),
            d,
        }
    }

    /// The joints that move a point of this instant.
    pub(super) fn joints(&self) -> impl Iterator<Item = usize> {
        self.joints.iter().map(|(joint, _)| *joint)
    }

    /// The column of a joint; `None` where it moves no point.
    pub(super) fn place(&self, joint: usize) -> Option<usize> {
        self.joints().position(|j| j == joint)
    }

    /// Aᵀ V⁻¹ D and Dᵀ V⁻¹ D of the columns D without their weights, A the block; `None` where λ is not finite.
    ///
    /// ```text
    /// V⁻¹ D = D (1 + λ DᵀD)⁻¹
    /// ```
    pub(super) fn whitened(&self, lambda: f64) -> Option<(DMatrix<f64>, DMatrix<f64>)> {
        let joints = self.joints.len();
        let inner = DMatrix::identity(joints, joints) + &self.gram * lambda;
        let inverse = Cholesky::new(inner)?.inverse();
        let mut with_block = self.of_block.tr_mul(&inverse);
        let mut with_itself = &self.gram * inverse;
        for (k, (_, weight)) in self.joints.iter().enumerate() {
            with_block.column_mut(k).scale_mut(1.0 / weight);
            with_itself.column_mut(k).scale_mut(1.0 / weight);
            with_itself.row_mut(k).scale_mut(1.0 / weight);
        }
        Some((with_block, with_itself))
    }

    /// Fewer joints than coordinates.
    pub(super) fn is_narrow(&self) -> bool {
        self.d.ncols() < self.d.nrows()
    }
}

/// Sums with one ratio of joint noise, as they grow.
///
/// ```text
/// V = 1 + λ D Dᵀ = L Lᵀ,   V⁻¹ = L⁻ᵀ L⁻¹ = 1 − Cᵀ C,   C = M⁻¹ Dᵀ,   M Mᵀ = 1/λ + DᵀD
/// ln |V| = 2 Σ ln L_ii = 2 Σ ln M_ii + J ln λ
/// ```
pub(super) struct Whitened {
    lambda: f64,
    /// Rows L⁻¹ A.
    pub added: Tall,
    /// Rows C A.
    pub subtracted: Tall,
    pub log_det: f64,
}

impl Whitened {
    pub(super) fn new(lambda: f64, width: usize) -> Self {
        Self {
            lambda,
            added: Tall::new(width),
            subtracted: Tall::new(width),
            log_det: 0.0,
        }
    }

    /// Adds the rows of one instant.
    pub(super) fn add(&mut self, block: &DMatrix<f64>, noise: &JointNoise) {
        let n = block.nrows();
        let mut v = DMatrix::identity(n, n);
        v.gemm(self.lambda, &noise.d, &noise.d.transpose(), 1.0);
        match (self.lambda > 0.0).then(|| inverse_root(&v)).flatten() {
            Some(of) => {
                self.log_det += of.log_det;
                self.added.push(&(of.root.transpose() * block));
            }
            None => self.added.push(block),
        }
    }

    /// Takes from the rows of one instant, counted as they are, what joint noise explains.
    pub(super) fn subtract(&mut self, noise: &JointNoise) {
        if self.lambda <= 0.0 {
            return;
        }
        let joints = noise.gram.nrows();
        let mut m = noise.gram.clone();
        (0..joints).for_each(|k| m[(k, k)] += 1.0 / self.lambda);
        if let Some(of) = inverse_root(&m) {
            self.log_det += of.log_det + joints as f64 * self.lambda.ln();
            self.subtracted
                .push(&(of.root.transpose() * &noise.of_block));
        }
    }
}

/// Rows that wait to be multiplied: one product of many rows is several times as fast as many of few.
pub(super) struct Tall {
    rows: DMatrix<f64>,
    filled: usize,
    gram: DMatrix<f64>,
}

impl Tall {
    /// Rows at a time: with a hundred columns they stay in the cache.
    const ROWS: usize = 128;

    /// The last column is the residual.
    pub(super) fn new(width: usize) -> Self {
        Self {
            rows: DMatrix::zeros(Self::ROWS, width),
            filled: 0,
            gram: DMatrix::zeros(width, width),
        }
    }

    pub(super) fn push(&mut self, block: &DMatrix<f64>) {
        for first in (0..block.nrows()).step_by(Self::ROWS) {
            let count = Self::ROWS.min(block.nrows() - first);
            if self.filled + count > Self::ROWS {
                self.flush();
            }
            let mut to = self.rows.rows_mut(self.filled, count);
            to.copy_from(&block.rows(first, count));
            self.filled += count;
        }
    }

    /// The products of the columns of all rows.
    pub(super) fn gram(mut self) -> DMatrix<f64> {
        if self.filled > 0 {
            self.flush();
        }
        let first = self.gram.ncols() - 1;
        let half = first / 2;
        for (i, k) in (0..half).flat_map(|i| (half..first).map(move |k| (i, k))) {
            self.gram[(k, i)] = self.gram[(i, k)];
        }
        self.gram
    }

    fn flush(&mut self) {
        let rows = self.rows.rows(0, self.filled);
        let last = rows.ncols() - 1;
        // The product of a transpose has no fast kernel.
        let transposed = rows.columns(0, last).transpose();
        // Of the products of the columns with each other, those of the later half with the earlier one are the earlier ones'.
        let half = last / 2;
        let mut upper = self.gram.rows_mut(0, half);
        upper.gemm(1.0, &transposed.rows(0, half), &rows, 1.0);
        let mut lower = self
            .gram
            .view_mut((half, half), (last - half, last + 1 - half));
        let (left, right) = (
            transposed.rows(half, last - half),
            rows.columns(half, last + 1 - half),
        );
        lower.gemm(1.0, &left, &right, 1.0);
        self.gram[(last, last)] += rows.column(last).norm_squared();
        self.filled = 0;
    }
}

fn noise_weight(chain: &Chain, joint: usize) -> f64 {
    match chain.joints()[joint].motion {
        Motion::Prismatic(_) => PRISMATIC_NOISE * PRISMATIC_NOISE,
        _ => 1.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Products by the inverse of V itself, for more and for fewer coordinates than joints.
    #[test]
    fn both_ways_are_the_inverse_of_the_covariance() {
        let (width, lambda) = (9, 0.7);
        for (rows, joints) in [(12, 4), (3, 5), (4, 4), (6, 0)] {
            let of = |i: usize, k: usize, a: f64| (a * (1 + i * 7 + k * 3) as f64).sin();
            let block = DMatrix::from_fn(rows, width, |i, k| of(i, k, 1.3));
            let d = DMatrix::from_fn(rows, joints, |i, k| of(i, k, 0.7));
            let noise = JointNoise::of_columns(&d, &block, 1.0);
            let mut whitened = Whitened::new(lambda, width);
            let mut white = Tall::new(width);
            if noise.is_narrow() {
                white.push(&block);
                whitened.subtract(&noise);
            } else {
                whitened.add(&block, &noise);
            }
            let log_det = whitened.log_det;
            let gram = white.gram() + whitened.added.gram() - whitened.subtracted.gram();
            let v = DMatrix::identity(rows, rows) + &d * d.transpose() * lambda;
            assert!((log_det - v.determinant().ln()).abs() < 1e-12);
            let expected = block.tr_mul(&(v.try_inverse().expect("regular") * &block));
            let last = width - 1;
            for (i, k) in (0..width).flat_map(|i| (0..width).map(move |k| (i, k))) {
                // The products of the residual with the columns are there once.
                if i < last || k == last {
                    let off = gram[(i, k)] - expected[(i, k)];
                    assert!(off.abs() < 1e-12, "{rows} {joints} {i} {k} {off:e}");
                }
            }
        }
    }
}
