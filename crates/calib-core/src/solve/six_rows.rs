//! What the markers of a body say of its twist together, as six rows.
//!
//! ```text
//! W = Σ_m w_m [ |p|²I − ppᵀ, [p]ₓ ; −[p]ₓ, I ],   UᵀU = W                                          (1)
//! ```

use nalgebra::{Matrix6, Vector3, Vector6};

/// U with UᵀU = W. W depends only on which markers were seen and their weights: U is kept while those stay.
#[derive(Default)]
pub(crate) struct Upper {
    seen: Vec<(usize, f64)>,
    factor: [[f64; 6]; 6],
}

impl Upper {
    #[inline]
    pub(crate) fn of(
        &mut self,
        now: &[(usize, f64)],
        positions: &[Vector3<f64>],
    ) -> &[[f64; 6]; 6] {
        if now != self.seen {
            let u = upper_factor(&compressed_weight(now, positions));
            self.factor = std::array::from_fn(|r| std::array::from_fn(|c| u[(r, c)]));
            self.seen.clear();
            self.seen.extend_from_slice(now);
        }
        &self.factor
    }
}

/// U J into six rows, k long each, one after the other: every twist to its column, the others stay.
#[inline]
pub(crate) fn upper_product<'t>(
    factor: &[[f64; 6]; 6],
    twists: impl Iterator<Item = (usize, &'t Vector6<f64>)>,
    k: usize,
    rows: &mut [f64],
) {
    let [u0, u1, u2, u3, u4, u5] = factor;
    for (c, j) in twists {
        rows[c] =
            u0[0] * j[0] + u0[1] * j[1] + u0[2] * j[2] + u0[3] * j[3] + u0[4] * j[4] + u0[5] * j[5];
        rows[k + c] = u1[1] * j[1] + u1[2] * j[2] + u1[3] * j[3] + u1[4] * j[4] + u1[5] * j[5];
        rows[2 * k + c] = u2[2] * j[2] + u2[3] * j[3] + u2[4] * j[4] + u2[5] * j[5];
        rows[3 * k + c] = u3[3] * j[3] + u3[4] * j[4] + u3[5] * j[5];
        rows[4 * k + c] = u4[4] * j[4] + u4[5] * j[5];
        rows[5 * k + c] = u5[5] * j[5];
    }
}

/// W of equation (1).
fn compressed_weight(seen: &[(usize, f64)], positions: &[Vector3<f64>]) -> Matrix6<f64> {
    let mut weight = Matrix6::zeros();
    // W = Σ w [ |p|²I − ppᵀ, [p]ₓ ; −[p]ₓ, I ]
    for &(point, w) in seen {
        let p = positions[point];
        let pp = p.norm_squared();
        for i in 0..3 {
            for j in 0..3 {
                weight[(i, j)] += w * (if i == j { pp } else { 0.0 } - p[i] * p[j]);
            }
            weight[(3 + i, 3 + i)] += w;
        }
        let skew = p.cross_matrix() * w;
        for i in 0..3 {
            for j in 0..3 {
                weight[(i, 3 + j)] += skew[(i, j)];
                weight[(3 + j, i)] += skew[(i, j)];
            }
        }
    }
    weight
}

/// U with UᵀU = W for a positive semidefinite W (fewer than three markers leave it singular).
fn upper_factor(w: &Matrix6<f64>) -> Matrix6<f64> {
    if let Some(c) = nalgebra::Cholesky::new(*w) {
        return c.l().transpose();
    }
    let eigen = calib_geometry::decompose::symmetric_eigen_small(w);
    let mut u = eigen.vectors.transpose();
    for i in 0..6 {
        u.row_mut(i).scale_mut(eigen.values[i].max(0.0).sqrt());
    }
    // Upper triangular form: the caller only reads r ≤ l.
    u.qr().r()
}
