//! The linear start, (2).

use calib_geometry::{
    decompose::{svd, symmetric_eigen_small},
    so3,
};
use nalgebra::{DMatrix, Isometry3, Matrix3, Translation3, Vector3};

use super::model::{Seen, State, total};

/// Samples that the linear start looks at; more would only cost time.
const START_SAMPLES: usize = 200;

/// A first W and Y.
pub(super) struct Start {
    pub w: Isometry3<f64>,
    pub y: Isometry3<f64>,
    /// Root mean square distance of the positions from their mean.
    pub spread: f64,
}

impl Start {
    pub fn state(&self) -> State {
        State {
            w: self.w,
            y: self.y,
        }
    }
}

/// (2): rotations from a null vector, then positions.
pub(super) fn linear_start(seen: &[Seen]) -> Option<Start> {
    let stride = seen.len().div_ceil(START_SAMPLES);
    let picked: Vec<&Seen> = seen.iter().step_by(stride).collect();
    // R_W A − R Q = 0 for the entries of R_W and Q = R_Yᵀ, column-major: (Aᵀ ⊗ I) vec R_W = (I ⊗ R) vec Q
    let mut rows = DMatrix::zeros(9 * picked.len(), 18);
    for (k, sample) in picked.iter().enumerate() {
        let a = sample.turn.to_rotation_matrix();
        for column in 0..3 {
            for i in 0..3 {
                let row = 9 * k + 3 * column + i;
                for l in 0..3 {
                    rows[(row, 3 * l + i)] = a[(l, column)];
                    rows[(row, 9 + 3 * column + l)] = -sample.pose.rotation[(i, l)];
                }
            }
        }
    }
    let null = svd(&rows).v.column(17).into_owned();
    let entry = |at: usize| Matrix3::from_fn(|i, j| null[at + 3 * j + i]);
    let (mut r_w, mut q) = (entry(0), entry(9));
    if r_w.determinant() < 0.0 {
        r_w = -r_w;
        q = -q;
    }
    let r_w = so3::nearest_rotation(&r_w)?;
    // Given R_W the best R_Y is a projection: it repairs a poor null vector.
    let sum = picked.iter().fold(Matrix3::zeros(), |sum, s| {
        let turned = (r_w * s.turn).to_rotation_matrix();
        sum + turned.matrix().transpose() * s.pose.rotation * s.weight
    });
    let r_y = so3::nearest_rotation(&sum).or_else(|| so3::nearest_rotation(&q.transpose()))?;

    let n = total(seen);
    let mean_t = seen
        .iter()
        .map(|s| s.pose.translation * s.weight)
        .sum::<Vector3<f64>>()
        / n;
    let turn = |s: &Seen| (r_w * s.turn).to_rotation_matrix().into_inner();
    let mean_r = seen
        .iter()
        .map(|s| turn(s) * s.weight)
        .sum::<Matrix3<f64>>()
        / n;
    let (mut m, mut b, mut spread) = (Matrix3::zeros(), Vector3::zeros(), 0.0);
    for s in seen {
        let d = turn(s) - mean_r;
        let t = s.pose.translation - mean_t;
        m += d.tr_mul(&d) * s.weight;
        b += d.tr_mul(&t) * s.weight;
        spread += s.weight * t.norm_squared();
    }
    let eigen = symmetric_eigen_small(&m);
    if eigen.values[0] <= 1e-12 * eigen.values[2] {
        return None;
    }
    let p = m.cholesky()?.solve(&b);
    let origin = mean_t - mean_r * p;
    Some(Start {
        w: Isometry3::from_parts(Translation3::from(origin), r_w),
        y: Isometry3::from_parts(Translation3::from(p), r_y),
        spread: (spread / n).sqrt(),
    })
}
