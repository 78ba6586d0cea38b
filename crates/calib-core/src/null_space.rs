//! Sparse combinations that span the null space: what a person can read.
//!
//! With N (n × d, orthonormal) the null space in units of the parameters' scales and P = N Nᵀ, a null vector
//! that lives on the parameters B alone exists exactly where P_BB has the eigenvalue 1 (and is its
//! eigenvector); `(1 − ε) I − P_BB` positive definite rules it out for the price of a Cholesky factor. Single
//! blocks (one edge, one joint's effects, one body's markers) are tried first, then pairs, then
//! triples; what is left is reduced by complete pivoting.

use nalgebra::{DMatrix, DVector};

use calib_geometry::decompose;

/// P_BB has an eigenvalue within this of 1: less than 1e-4 of the vector lies outside B.
const SUPPORTED: f64 = 1e-8;
/// Entries below this share of the largest are rounding of the null space, not terms.
pub(crate) const TERM: f64 = 1e-4;
/// With more blocks than this, triples are only tried among neighbours.
const ALL_TRIPLES: usize = 14;

/// Columns (n × d) spanning the same space as `null`, each with few terms; `blocks` are the column
/// indices that belong together, in the order along the robot.
pub(crate) fn sparse_basis(null: &DMatrix<f64>, blocks: &[Vec<usize>]) -> Vec<DVector<f64>> {
    let d = null.ncols();
    let mut found = Found {
        null,
        projector: null * null.transpose(),
        accepted: DMatrix::zeros(d, 0),
        vectors: Vec::new(),
    };
    let n = blocks.len();
    'search: {
        for b in blocks {
            found.within(&[b]);
        }
        for gap in 1..n {
            for i in 0..n - gap {
                if found.vectors.len() == d {
                    break 'search;
                }
                found.within(&[&blocks[i], &blocks[i + gap]]);
            }
        }
        for i in 0..n {
            for j in i + 1..n {
                for k in j + 1..n {
                    if found.vectors.len() == d {
                        break 'search;
                    }
                    if n <= ALL_TRIPLES || k - i <= 4 {
                        found.within(&[&blocks[i], &blocks[j], &blocks[k]]);
                    }
                }
            }
        }
    }
    found.rest();
    found.vectors
}

struct Found<'a> {
    null: &'a DMatrix<f64>,
    /// P
    projector: DMatrix<f64>,
    /// Orthonormal coordinates (in the columns of `null`) of what is already explained.
    accepted: DMatrix<f64>,
    vectors: Vec<DVector<f64>>,
}

impl Found<'_> {
    /// Adds the null vectors that live on the given blocks.
    fn within(&mut self, blocks: &[&Vec<usize>]) {
        let d = self.null.ncols();
        if self.vectors.len() == d {
            return;
        }
        let rows: Vec<usize> = blocks.iter().flat_map(|b| b.iter().copied()).collect();
        let part = DMatrix::from_fn(rows.len(), rows.len(), |i, j| {
            self.projector[(rows[i], rows[j])]
        });
        let margin =
            DMatrix::from_diagonal_element(rows.len(), rows.len(), 1.0 - SUPPORTED) - &part;
        if nalgebra::Cholesky::new(margin).is_some() {
            return;
        }
        let eigen = decompose::symmetric_eigen(&part);
        let count = eigen
            .values
            .iter()
            .filter(|&&v| v > 1.0 - SUPPORTED)
            .count();
        if count == 0 {
            return;
        }
        let mut vectors = DMatrix::zeros(self.null.nrows(), count);
        for (i, &r) in rows.iter().enumerate() {
            for k in 0..count {
                vectors[(r, k)] = eigen.vectors[(i, rows.len() - count + k)];
            }
        }
        let coordinates = self.null.tr_mul(&vectors);
        // Nothing new? Then no need to tidy it.
        let left = &coordinates - &self.accepted * self.accepted.tr_mul(&coordinates);
        if left.norm() < 1e-3 {
            return;
        }
        self.offer(reduced(vectors));
    }

    fn rest(&mut self) {
        let d = self.null.ncols();
        if self.vectors.len() == d {
            return;
        }
        let mut complement = DMatrix::identity(d, d) - &self.accepted * self.accepted.transpose();
        let svd = decompose::svd(&complement);
        complement = svd.u.columns(0, d - self.accepted.ncols()).into_owned();
        self.offer(reduced(self.null * complement));
    }

    /// Keeps those vectors that are independent of what is there.
    fn offer(&mut self, vectors: Vec<DVector<f64>>) {
        for v in vectors {
            let y = self.null.tr_mul(&v);
            let y = &y / y.norm();
            let mut fresh = &y - &self.accepted * self.accepted.tr_mul(&y);
            // Dependent vectors leave only the tolerance of SUPPORTED.
            if fresh.norm() < 1e-3 {
                continue;
            }
            fresh -= &self.accepted * self.accepted.tr_mul(&fresh);
            fresh.unscale_mut(fresh.norm());
            let k = self.accepted.ncols();
            self.accepted = self.accepted.clone().insert_column(k, 0.0);
            self.accepted.column_mut(k).copy_from(&fresh);
            self.vectors.push(v);
        }
    }
}

/// Reduced echelon form by complete pivoting: each vector gets a parameter of its own.
fn reduced(vectors: DMatrix<f64>) -> Vec<DVector<f64>> {
    let mut rows = vectors.transpose();
    let (d, n) = rows.shape();
    let mut done = vec![false; d];
    for _ in 0..d {
        let mut pivot = (0.0, 0, 0);
        for i in (0..d).filter(|&i| !done[i]) {
            for j in 0..n {
                // Ties go to the first column: results do not depend on rounding of equal entries.
                if rows[(i, j)].abs() > pivot.0 * (1.0 + 1e-9) {
                    pivot = (rows[(i, j)].abs(), i, j);
                }
            }
        }
        let (size, i, j) = pivot;
        if size < 1e-8 {
            break;
        }
        done[i] = true;
        let p = rows[(i, j)];
        for c in 0..n {
            rows[(i, c)] /= p;
        }
        for other in (0..d).filter(|&o| o != i) {
            let f = rows[(other, j)];
            if f != 0.0 {
                for c in 0..n {
                    let x = rows[(i, c)];
                    rows[(other, c)] -= f * x;
                }
            }
        }
    }
    (0..d)
        .filter(|&i| done[i])
        .map(|i| {
            let mut v = rows.row(i).transpose();
            let largest = v.amax();
            for x in v.iter_mut() {
                if x.abs() < TERM * largest {
                    *x = 0.0;
                }
            }
            v
        })
        .collect()
}
