//! A matrix of the rows of a sample over the columns of the model that holds, of the rows of each [`Part`], the columns of the part only.

use std::borrow::Cow;
use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use crate::model::parts::Part;

/// A, m × n.
#[derive(Debug, Clone)]
pub(crate) struct Parted {
    m: usize,
    n: usize,
    blocks: Vec<Block>,
}

/// Some rows of A.
#[derive(Debug, Clone)]
struct Block {
    part: Arc<Part>,
    /// Their places, ascending.
    rows: Vec<usize>,
    /// They themselves: rows × the columns of the part.
    a: DMatrix<f64>,
    /// Their transpose: the product of a transpose has no fast kernel.
    transposed: DMatrix<f64>,
}

/// Some rows of a matrix, in their order.
fn gathered<'a>(of: &'a DMatrix<f64>, rows: &[usize]) -> Cow<'a, DMatrix<f64>> {
    if rows.len() == of.nrows() {
        Cow::Borrowed(of)
    } else {
        Cow::Owned(of.select_rows(rows))
    }
}

impl Parted {
    /// An empty matrix of m rows over n columns.
    pub(crate) fn new(m: usize, n: usize) -> Self {
        Self {
            m,
            n,
            blocks: Vec::new(),
        }
    }

    /// Puts the rows of a part, one after the other over its columns, into these places, ascending.
    pub(crate) fn put(&mut self, part: &Arc<Part>, rows: Vec<usize>, row_by_row: &[f64]) {
        let (m, n) = (rows.len(), part.columns.len());
        self.blocks.push(Block {
            part: Arc::clone(part),
            a: DMatrix::from_row_slice(m, n, row_by_row),
            transposed: DMatrix::from_column_slice(n, m, row_by_row),
            rows,
        });
    }

    pub(crate) fn nrows(&self) -> usize {
        self.m
    }

    /// A itself, m × n.
    pub(crate) fn dense(&self) -> DMatrix<f64> {
        let mut out = DMatrix::zeros(self.m, self.n);
        for block in &self.blocks {
            for (own, &row) in block.transposed.column_iter().zip(&block.rows) {
                for (x, &column) in own.iter().zip(&block.part.columns) {
                    out[(row, column)] = *x;
                }
            }
        }
        out
    }

    /// A X
    pub(crate) fn times(&self, x: &DMatrix<f64>) -> DMatrix<f64> {
        let mut out = DMatrix::zeros(self.m, x.ncols());
        for block in &self.blocks {
            let own = gathered(x, &block.part.columns);
            if block.rows.len() == self.m {
                out.gemm(1.0, &block.a, &*own, 0.0);
            } else {
                let product = &block.a * &*own;
                for (c, own) in product.column_iter().enumerate() {
                    let mut to = out.column_mut(c);
                    block
                        .rows
                        .iter()
                        .zip(own.iter())
                        .for_each(|(&r, x)| to[r] = *x);
                }
            }
        }
        out
    }

    /// A x
    pub(crate) fn times_vector(&self, x: &DVector<f64>) -> DVector<f64> {
        let mut out = DVector::zeros(self.m);
        for block in &self.blocks {
            for (own, &row) in block.transposed.column_iter().zip(&block.rows) {
                let along = own.iter().zip(&block.part.columns);
                out[row] = along.map(|(a, &column)| a * x[column]).sum();
            }
        }
        out
    }

    /// h += factor AᵀA
    pub(crate) fn add_gram(&self, factor: f64, h: &mut DMatrix<f64>) {
        for block in &self.blocks {
            let columns = &block.part.columns;
            if columns.len() == self.n {
                h.gemm(factor, &block.transposed, &block.a, 1.0);
                continue;
            }
            let own = &block.transposed * &block.a;
            for (b, &column) in columns.iter().enumerate() {
                for (a, &row) in columns.iter().enumerate() {
                    h[(row, column)] += factor * own[(a, b)];
                }
            }
        }
    }

    /// out += factor AᵀB
    pub(crate) fn add_transposed_times(
        &self,
        factor: f64,
        b: &DMatrix<f64>,
        out: &mut DMatrix<f64>,
    ) {
        for block in &self.blocks {
            let own = gathered(b, &block.rows);
            if block.part.columns.len() == self.n {
                out.gemm(factor, &block.transposed, &*own, 1.0);
                continue;
            }
            // Most columns concern other parts.
            let concern = |c: &usize| own.column(*c).iter().any(|x| *x != 0.0);
            let kept: Vec<usize> = (0..own.ncols()).filter(concern).collect();
            let product = &block.transposed * own.select_columns(&kept);
            for (own, &c) in product.column_iter().zip(&kept) {
                let mut to = out.column_mut(c);
                let places = block.part.columns.iter().zip(own.iter());
                places.for_each(|(&row, x)| to[row] += factor * x);
            }
        }
    }

    /// AᵀB
    pub(crate) fn transposed_times(&self, b: &DMatrix<f64>) -> DMatrix<f64> {
        let mut out = DMatrix::zeros(self.n, b.ncols());
        self.add_transposed_times(1.0, b, &mut out);
        out
    }

    /// Calls `add` with each column and the entry of Aᵀv there, once for each part that has it.
    pub(crate) fn each_transposed(&self, v: &DVector<f64>, mut add: impl FnMut(usize, f64)) {
        for block in &self.blocks {
            let own = DVector::from_iterator(block.rows.len(), block.rows.iter().map(|&r| v[r]));
            let along = &block.transposed * own;
            let places = block.part.columns.iter().zip(along.iter());
            places.for_each(|(&column, x)| add(column, *x));
        }
    }

    /// g += Aᵀv
    pub(crate) fn add_transposed_vector(&self, v: &DVector<f64>, g: &mut DVector<f64>) {
        self.each_transposed(v, |column, x| g[column] += x);
    }

    /// (A C, A C Aᵀ)
    pub(crate) fn between(&self, c: &DMatrix<f64>) -> (DMatrix<f64>, DMatrix<f64>) {
        let ac = self.times(c);
        let mut out = DMatrix::zeros(self.m, self.m);
        for block in &self.blocks {
            let own = if block.part.columns.len() == self.n {
                &ac * &block.transposed
            } else {
                ac.select_columns(&block.part.columns) * &block.transposed
            };
            for (own, &row) in own.column_iter().zip(&block.rows) {
                out.column_mut(row).copy_from(&own);
            }
        }
        (ac, out)
    }

    /// A C Aᵀ
    pub(crate) fn gram_with(&self, c: &DMatrix<f64>) -> DMatrix<f64> {
        if self.blocks.iter().any(|b| b.part.columns.len() == self.n) {
            return self.between(c).1;
        }
        let mut out = DMatrix::zeros(self.m, self.m);
        for (k, right) in self.blocks.iter().enumerate() {
            for left in &self.blocks[..=k] {
                let (rows, columns) = (&left.part.columns, &right.part.columns);
                let of = |i: usize, j: usize| c[(rows[i], columns[j])];
                let own = DMatrix::from_fn(rows.len(), columns.len(), of);
                let own = &left.a * (own * &right.transposed);
                for (j, &column) in right.rows.iter().enumerate() {
                    for (i, &row) in left.rows.iter().enumerate() {
                        (out[(row, column)], out[(column, row)]) = (own[(i, j)], own[(i, j)]);
                    }
                }
            }
        }
        out
    }

    /// (A C Aᵀ)_ii
    pub(crate) fn squares_with(&self, c: &DMatrix<f64>) -> Vec<f64> {
        let mut out = vec![0.0; self.m];
        for block in &self.blocks {
            let columns = &block.part.columns;
            let along = if columns.len() == self.n {
                c * &block.transposed
            } else {
                let own = DMatrix::from_fn(columns.len(), columns.len(), |a, b| {
                    c[(columns[a], columns[b])]
                });
                own * &block.transposed
            };
            for (i, &row) in block.rows.iter().enumerate() {
                out[row] = along.column(i).dot(&block.transposed.column(i));
            }
        }
        out
    }
}
