//! The inverse of a positive definite matrix by a root. What belongs to one limb of a robot meets what belongs to another only through the few unknowns
//! that all share: such groups are factored each for itself, and the shared unknowns last.
//!
//! ```text
//! A = [A_1 0 B_1; 0 A_2 B_2; B_1ᵀ B_2ᵀ S],   A_k = L_k L_kᵀ,   Y_k = L_k⁻¹B_k,   S − Σ Y_kᵀY_k = L L ᵀ            (1)
//! W = [L_1⁻ᵀ 0 −L_1⁻ᵀY_1L⁻ᵀ; 0 L_2⁻ᵀ −L_2⁻ᵀY_2L⁻ᵀ; 0 0 L⁻ᵀ],   A⁻¹ = W Wᵀ                                    (2)
//! ```

use nalgebra::{DMatrix, DVectorView};

use super::{cholesky_in_place, lower_inverse, solve_in_place};

/// Matrices of fewer columns are one group: there is nothing to gain.
const FEW: usize = 96;

/// W of equation (2).
#[derive(Debug, Clone)]
pub struct InverseRoot {
    /// W with `W Wᵀ = A⁻¹`, n × n: rows and columns in the order of A, upper triangular only where all of A is one group.
    pub root: DMatrix<f64>,
    /// ln |A|.
    pub log_det: f64,
    groups: Groups,
}

/// Root of the inverse of A, of which both triangles are given; `None` where it is not positive definite.
#[must_use]
pub fn inverse_root(a: &DMatrix<f64>) -> Option<InverseRoot> {
    of_groups(a, Groups::of(a))
}

fn of_groups(a: &DMatrix<f64>, groups: Groups) -> Option<InverseRoot> {
    let n = a.nrows();
    let log_det = |root: &DMatrix<f64>| root.diagonal().iter().map(|x| -2.0 * x.ln()).sum();
    if groups.own.len() == 1 {
        let root = root_of(a)?;
        return Some(InverseRoot {
            log_det: log_det(&root),
            root,
            groups,
        });
    }
    let shared = &groups.shared;
    let mut root = DMatrix::zeros(n, n);
    let mut left = select(a, shared, shared);
    let mut steps = Vec::new();
    for own in &groups.own {
        let w = root_of(&select(a, own, own))?;
        put(&w, own, own, &mut root);
        if !shared.is_empty() {
            let y = w.transpose() * select(a, own, shared);
            left.gemm(-1.0, &y.transpose(), &y, 1.0);
            steps.push(&w * y);
        }
    }
    let last = root_of(&left)?;
    put(&last, shared, shared, &mut root);
    for (own, step) in groups.own.iter().zip(steps) {
        put(&(-step * &last), own, shared, &mut root);
    }
    Some(InverseRoot {
        log_det: log_det(&root),
        root,
        groups,
    })
}

/// y ← A⁻¹ y, of a positive definite A (n × n) whose lower triangle is given row by row and is lost; `false` where it is not positive definite.
pub fn solve_positive(a: &mut [f64], n: usize, y: &mut [f64]) -> bool {
    if n >= FEW {
        let lower = |i: usize, k: usize| a[i.max(k) * n + i.min(k)];
        let full = DMatrix::from_fn(n, n, lower);
        let groups = Groups::of(&full);
        if groups.own.len() > 1 {
            let Some(InverseRoot { root, .. }) = of_groups(&full, groups) else {
                return false;
            };
            let x = &root * root.tr_mul(&DVectorView::from_slice(y, n));
            y.copy_from_slice(x.as_slice());
            return true;
        }
    }
    let positive = cholesky_in_place(a, n);
    if positive {
        solve_in_place(a, n, y);
    }
    positive
}

impl InverseRoot {
    /// A⁻¹.
    #[must_use]
    pub fn inverse(&self) -> DMatrix<f64> {
        let Groups { own, shared } = &self.groups;
        if own.len() == 1 {
            return &self.root * self.root.transpose();
        }
        let border = self.root.select_columns(shared);
        let mut out = &border * border.transpose();
        for own in own {
            let w = select(&self.root, own, own);
            let square = &w * w.transpose();
            for (k, &c) in own.iter().enumerate() {
                for (i, &r) in own.iter().enumerate() {
                    out[(r, c)] += square[(i, k)];
                }
            }
        }
        out
    }
}

/// L⁻ᵀ of A = L Lᵀ.
fn root_of(a: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let n = a.nrows();
    // A is its own transpose: column after column is row after row.
    let mut l = a.as_slice().to_vec();
    // Row after row of L⁻¹ is column after column of its transpose.
    cholesky_in_place(&mut l, n).then(|| DMatrix::from_vec(n, n, lower_inverse(&l, n)))
}

fn select(a: &DMatrix<f64>, rows: &[usize], columns: &[usize]) -> DMatrix<f64> {
    DMatrix::from_fn(rows.len(), columns.len(), |i, k| a[(rows[i], columns[k])])
}

fn put(block: &DMatrix<f64>, rows: &[usize], columns: &[usize], to: &mut DMatrix<f64>) {
    for (column, &c) in block.column_iter().zip(columns) {
        for (x, &r) in column.iter().zip(rows) {
            to[(r, c)] = *x;
        }
    }
}

/// Columns that meet only their own and the shared ones, each in ascending order.
#[derive(Debug, Clone, PartialEq)]
struct Groups {
    own: Vec<Vec<usize>>,
    shared: Vec<usize>,
}

impl Groups {
    fn of(a: &DMatrix<f64>) -> Self {
        let n = a.ncols();
        let one = Self {
            own: vec![(0..n).collect()],
            shared: Vec::new(),
        };
        if n < FEW {
            return one;
        }
        let meets = |c: usize| a.column(c).iter().filter(|x| **x != 0.0).count();
        let (shared, rest): (Vec<usize>, Vec<usize>) = (0..n).partition(|c| 2 * meets(*c) > n);
        // The group of each column, followed from one that is known.
        let mut group: Vec<Option<usize>> = vec![None; n];
        let mut own: Vec<Vec<usize>> = Vec::new();
        for &first in &rest {
            if group[first].is_some() {
                continue;
            }
            let k = own.len();
            group[first] = Some(k);
            let mut columns = vec![first];
            let mut next = 0;
            while let Some(&c) = columns.get(next) {
                next += 1;
                for &r in &rest {
                    if group[r].is_none() && a[(r, c)] != 0.0 {
                        group[r] = Some(k);
                        columns.push(r);
                    }
                }
            }
            columns.sort_unstable();
            own.push(columns);
        }
        if own.len() < 2 {
            one
        } else {
            Self { own, shared }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A dense matrix, three limbs that share two unknowns, and three that share nothing; columns of the limbs in turn.
    #[test]
    fn a_root_gives_the_inverse() {
        for (n, groups, shared) in [(5, 1, 0), (120, 1, 0), (131, 3, 2), (130, 3, 0)] {
            let of = |i: usize| (i >= shared).then_some(i % groups);
            let meet = |i: usize, k: usize| of(i).is_none() || of(k).is_none() || of(i) == of(k);
            let a = DMatrix::from_fn(n, n, |i, k| match meet(i, k) {
                true => 0.5 * ((i + k + 3 * i * k) as f64).sin() + if i == k { 60.0 } else { 0.0 },
                false => 0.0,
            });
            let found = inverse_root(&a).unwrap();
            assert_eq!(found.groups.own.len(), groups);
            assert_eq!(found.groups.shared.len(), shared);
            let of_root = &found.root * found.root.transpose();
            assert!((&of_root * &a - DMatrix::identity(n, n)).amax() < 1e-13);
            assert!((of_root - found.inverse()).amax() < 1e-16);
            let log_det = 2.0
                * a.clone()
                    .cholesky()
                    .unwrap()
                    .l()
                    .diagonal()
                    .map(f64::ln)
                    .sum();
            assert!((found.log_det - log_det).abs() < 1e-10);
            let y: Vec<f64> = (0..n).map(|i| (i as f64).cos()).collect();
            let (mut lower, mut x) = (a.transpose().as_slice().to_vec(), y.clone());
            for (i, row) in lower.chunks_exact_mut(n).enumerate() {
                row[i + 1..].fill(f64::NAN);
            }
            assert!(solve_positive(&mut lower, n, &mut x));
            let left = &a * DVectorView::from_slice(&x, n) - DVectorView::from_slice(&y, n);
            assert!(left.amax() < 1e-13);
            for k in 0..n {
                let mut indefinite = a.clone();
                indefinite[(k, k)] = -1.0;
                assert!(inverse_root(&indefinite).is_none());
                let mut lower = indefinite.as_slice().to_vec();
                assert!(!solve_positive(&mut lower, n, &mut x));
            }
        }
    }
}
