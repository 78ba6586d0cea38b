//! A rigid body that is moved along a straight line without a turn: what a hinge has to beat.
//!
//! ```text
//! v_ip = b_p + d_i u + noise                                                                  (1)
//! min over b, d for given u:   tr S − uᵀ (S − A) u
//!     S = Σ (v_ip − v̄_p)(v_ip − v̄_p)ᵀ,   A = the same about the best b_p + D_i, D_i free     (2)
//! ```
//!
//! so that the best u is the strongest direction of S − A. A hinge far away moves as (1); near (1) its turn is two
//! numbers, the curvature of the path across u. Twice the gain in log-likelihood is χ²(2) where the body does not turn.
//! Several markers show a turn by their different chords long before any of them shows its sagitta.

use calib_geometry::decompose::symmetric_eigen_small;
use nalgebra::{DMatrix, Matrix3, Vector3};

/// Σ of squared residuals of the best motion (1); `frames`: (marker, position) of each frame, with its weight, all markers linked by frames.
///
/// `None` where they are not linked.
pub(crate) fn cost(
    frames: &[Vec<(usize, Vector3<f64>)>],
    weights: &[f64],
    markers: usize,
) -> Option<f64> {
    let mut means = vec![(Vector3::zeros(), 0.0); markers];
    for (frame, w) in frames.iter().zip(weights) {
        for (p, v) in frame {
            means[*p].0 += v * *w;
            means[*p].1 += w;
        }
    }
    let means: Vec<Vector3<f64>> = means
        .iter()
        .map(|(s, n)| s / f64::max(*n, f64::MIN_POSITIVE))
        .collect();
    let mut scatter = Matrix3::zeros();
    // Normal equations of the markers' places with every frame's D eliminated; the first place is the gauge.
    let mut normal = DMatrix::<f64>::zeros(markers, markers);
    let mut right = DMatrix::<f64>::zeros(markers, 3);
    let mut apart = Matrix3::zeros();
    for (frame, &w) in frames.iter().zip(weights) {
        let share = 1.0 / frame.len().max(1) as f64;
        let middle = frame
            .iter()
            .map(|(p, v)| (v - means[*p]) * share)
            .sum::<Vector3<f64>>();
        for (p, v) in frame {
            let d = v - means[*p];
            scatter += d * (d * w).transpose();
            let left = d - middle;
            apart += left * (left * w).transpose();
            normal[(*p, *p)] += w;
            for (q, _) in frame {
                normal[(*p, *q)] -= w * share;
            }
            for k in 0..3 {
                right[(*p, k)] += w * left[k];
            }
        }
    }
    if markers > 1 {
        let of_places = normal.view((1, 1), (markers - 1, markers - 1)).into_owned();
        let right = right.rows(1, markers - 1).into_owned();
        let explained = right.tr_mul(&of_places.cholesky()?.solve(&right));
        apart -= explained.fixed_view::<3, 3>(0, 0);
    }
    let strongest = symmetric_eigen_small(&(scatter - apart)).values[2];
    Some((scatter.trace() - strongest).max(0.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn body() -> [Vector3<f64>; 3] {
        [
            Vector3::new(0.1, 0.0, 0.3),
            Vector3::new(-0.2, 0.4, 0.0),
            Vector3::new(0.0, 0.1, -0.5),
        ]
    }

    /// Frames miss markers, the body moves along a line: nothing is left over.
    #[test]
    fn a_straight_motion_costs_nothing() {
        let u = Vector3::new(1.0, -2.0, 0.5);
        let frames: Vec<Vec<_>> = (0..9)
            .map(|i| {
                let all = body().map(|b| b + u * (0.1 * (i * i) as f64));
                let seen = all.into_iter().enumerate();
                seen.filter(|(p, _)| (i + p) % 4 != 0).collect()
            })
            .collect();
        assert!(cost(&frames, &vec![1.0; frames.len()], 3).expect("linked") < 1e-12);
    }

    /// Against the cost at its own minimum, searched over u, with b and d by alternation.
    #[test]
    fn the_closed_form_is_the_minimum() {
        let frames: Vec<Vec<_>> = (0..7)
            .map(|i| {
                let turn = nalgebra::Rotation3::new(Vector3::new(0.0, 0.05 * f64::from(i), 0.1));
                body().iter().map(|b| turn * b).enumerate().collect()
            })
            .collect();
        let closed = cost(&frames, &vec![1.0; frames.len()], 3).expect("linked");
        let mut b = body().to_vec();
        let mut u = Vector3::new(0.3, 0.2, 0.9).normalize();
        let mut d = vec![0.0; frames.len()];
        let mut alternated = f64::INFINITY;
        for _ in 0..4000 {
            for (d, frame) in d.iter_mut().zip(&frames) {
                *d = frame.iter().map(|(p, v)| (v - b[*p]).dot(&u)).sum::<f64>() / 3.0;
            }
            for (p, b) in b.iter_mut().enumerate() {
                let sum: Vector3<f64> = frames.iter().zip(&d).map(|(f, d)| f[p].1 - u * *d).sum();
                *b = sum / frames.len() as f64;
            }
            let along: Vector3<f64> = frames
                .iter()
                .zip(&d)
                .flat_map(|(f, d)| f.iter().map(move |(p, v)| (*p, v, *d)))
                .map(|(p, v, d)| (v - b[p]) * d)
                .sum();
            u = along.normalize();
            alternated = frames
                .iter()
                .zip(&d)
                .flat_map(|(f, d)| f.iter().map(move |(p, v)| (*p, v, *d)))
                .map(|(p, v, d)| (v - b[p] - u * d).norm_squared())
                .sum();
        }
        assert!(
            (closed - alternated).abs() < 1e-9 * closed,
            "{closed} {alternated}"
        );
    }

    #[test]
    fn markers_that_no_frame_links_have_no_common_motion() {
        let v = Vector3::x();
        assert!(cost(&[vec![(0, v)], vec![(1, v)]], &[1.0, 1.0], 2).is_none());
    }
}
