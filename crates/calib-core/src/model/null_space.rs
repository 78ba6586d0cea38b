//! Sparse combinations that span the null space: what a person can read.
//!
//! With N (n × d, orthonormal) the null space in units of the parameters' scales and P = N Nᵀ, a null vector
//! that lives on the parameters B alone exists exactly where P_BB has the eigenvalue 1 (and is its
//! eigenvector); `(1 − ε) I − P_BB` positive definite rules it out for the price of a Cholesky factor. Single
//! blocks (one edge, one joint's effects, one body's markers) are tried first, then pairs, then
//! triples; what is left is brought to reduced echelon form.

use nalgebra::{DMatrix, DVector};

use calib_geometry::decompose;

/// P_BB has an eigenvalue within this of 1: less than 1e-4 of the vector lies outside B.
const SUPPORTED: f64 = 1e-8;
/// Entries below this share of the largest are rounding of the null space, not terms.
pub(crate) const TERM: f64 = 1e-4;
/// With more blocks than this, triples are only tried among neighbors.
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

/// Reduced echelon form: each vector gets a parameter of its own, vectors in the order of these parameters.
///
/// The own parameters are the columns that QR with column pivoting picks. Its norms do not change when the basis of the
/// null space is turned, so the result does not depend on the rounding that chose this basis.
fn reduced(vectors: DMatrix<f64>) -> Vec<DVector<f64>> {
    /// Ties within this share of the largest go to the first column.
    const TIE: f64 = 1e-4;
    /// Squared norm of a column that is only rounding.
    const NOTHING: f64 = 1e-16;
    let rows = vectors.transpose();
    let mut left = rows.clone();
    let mut pivots = Vec::new();
    for _ in 0..rows.nrows() {
        let norms: Vec<f64> = left.column_iter().map(|c| c.norm_squared()).collect();
        let largest = norms.iter().copied().fold(0.0, f64::max);
        let Some(own) = norms.iter().position(|x| *x >= largest * (1.0 - TIE)) else {
            break;
        };
        if largest < NOTHING {
            break;
        }
        pivots.push(own);
        let direction = left.column(own).normalize();
        left -= &direction * direction.tr_mul(&left);
    }
    pivots.sort_unstable();
    // rows = B · reduced with B the pivot columns, invertible by their choice.
    let own = rows.select_columns(&pivots);
    let Some(inverse) = own.tr_mul(&own).try_inverse() else {
        return Vec::new();
    };
    let reduced = inverse * own.tr_mul(&rows);
    reduced
        .row_iter()
        .map(|row| {
            let mut v = row.transpose();
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
