//! Sums of rowᵀ row, gathered so that many rows go into one matrix product.

use nalgebra::{DMatrix, Dyn, MatrixView};

/// Rows gathered before one matrix product: 64 to 96 rows fill the cache lines of the product's kernel.
const PANEL: usize = 96;

/// Of fewer columns H is one product.
const FEW: usize = 48;

/// H and g over some columns, and their share of the cost.
pub(crate) struct Local {
    pub k: usize,
    /// k × k.
    pub h: DMatrix<f64>,
    pub g: Vec<f64>,
    /// k × PANEL: whitened rows of J waiting to be multiplied, one per column.
    panel: DMatrix<f64>,
    filled: usize,
    pub cost: f64,
}

impl Local {
    /// Space for k columns; never more than `most` rows are asked for at once.
    pub(crate) fn new(k: usize, most: usize) -> Self {
        let panel = PANEL.max(most);
        Self {
            k,
            h: DMatrix::zeros(k, k),
            g: vec![0.0; k],
            panel: DMatrix::zeros(k, panel),
            filled: 0,
            cost: 0.0,
        }
    }

    /// Space for `m` further rows, each k long, one after the other.
    pub(crate) fn rows(&mut self, m: usize) -> &mut [f64] {
        self.rows_and_gradient(m).0
    }

    /// As [`Local::rows`], with the gradient that they are to be added to.
    pub(crate) fn rows_and_gradient(&mut self, m: usize) -> (&mut [f64], &mut [f64]) {
        if self.filled + m > self.panel.ncols() {
            self.multiply();
        }
        let start = self.filled * self.k;
        self.filled += m;
        let rows = &mut self.panel.as_mut_slice()[start..start + m * self.k];
        (rows, &mut self.g)
    }

    /// H += Σ rowᵀ row
    pub(crate) fn multiply(&mut self) {
        if self.filled == 0 || self.k == 0 {
            self.filled = 0;
            return;
        }
        let rows = self.panel.columns(0, self.filled);
        // The same numbers read along the other way: row stride k, column stride 1.
        let transposed = MatrixView::<_, _, _, Dyn, Dyn>::from_slice_with_strides_generic(
            &self.panel.as_slice()[..self.k * self.filled],
            Dyn(self.filled),
            Dyn(self.k),
            Dyn(self.k),
            Dyn(1),
        );
        // H is symmetric: of four blocks, three are multiplied and one is copied. Of few columns it takes longer to prepare them thrice.
        let (k, half) = match self.k {
            k if k < FEW => (k, 0),
            k => (k, k / 2),
        };
        let mut product = |from: usize, count: usize, to: usize, width: usize| {
            let mut block = self.h.view_mut((from, to), (count, width));
            let left = rows.rows(from, count);
            block.gemm(1.0, &left, &transposed.columns(to, width), 1.0);
        };
        product(0, half, 0, half);
        product(0, half, half, k - half);
        product(half, k - half, half, k - half);
        for b in 0..half {
            for a in half..k {
                self.h[(a, b)] = self.h[(b, a)];
            }
        }
        self.filled = 0;
    }
}
