//! Residuals of a pair of transforms, pose by pose and in the mean, and the size that they are compared with.

use nalgebra::{Isometry3, Vector3};
use serde::Serialize;

/// Residuals of a fit, over the rows that score.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Residuals {
    /// rms of the positions, m.
    pub rms_translation: f64,
    /// rms of the angles, rad.
    pub rms_rotation: f64,
}

/// Residuals of one pose: |R_A t_X + t_A − R_Z t_B − t_Z|² and the square of the angle between R_A R_X and R_Z R_B.
pub(crate) fn squares(
    a: &Isometry3<f64>,
    b: &Isometry3<f64>,
    x: &Isometry3<f64>,
    z: &Isometry3<f64>,
) -> [f64; 2] {
    let (left, right) = (a * x, z * b);
    [
        (left.translation.vector - right.translation.vector).norm_squared(),
        left.rotation.angle_to(&right.rotation).powi(2),
    ]
}

/// rms distance of the positions from their mean, m.
pub(crate) fn spread(poses: &[Isometry3<f64>]) -> f64 {
    let n = poses.len().max(1) as f64;
    let mean = poses
        .iter()
        .map(|p| p.translation.vector)
        .sum::<Vector3<f64>>()
        / n;
    let squares = poses
        .iter()
        .map(|p| (p.translation.vector - mean).norm_squared());
    (squares.sum::<f64>() / n).sqrt()
}
