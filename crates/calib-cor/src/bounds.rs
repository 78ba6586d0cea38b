//! Cramér–Rao bounds: the covariance below which no unbiased estimator of the center can be.
//!
//! ```text
//! sphere:    C ≥ σ² ( Σ_p Σ_k (u_pk − ū_p)(u_pk − ū_p)ᵀ )⁻¹                               (1)
//! hot spot:  C ≥ ( Σ_i A_iᵀ Σ_i⁻¹ A_i )⁻¹,  A_i = [I  −R_i] over [o; p],
//!            Σ_i = σ_t² I + σ_r² |p|² R_i (I − p̂p̂ᵀ) R_iᵀ                                   (2)
//! ```
//!
//! (1) does not depend on the radius; (2) has the true poses eliminated. All at the truth.

use calib_geometry::measured::Pose;
use nalgebra::{Matrix3, Matrix6, UnitQuaternion, Vector3};

use crate::ball_bundle;

/// Bound (1) for markers whose true positions, relative to the center, are given marker by marker.
///
/// `None` where the positions determine no center (all in parallel planes).
#[must_use]
pub fn sphere_center(markers: &[Vec<Vector3<f64>>], sigma: f64) -> Option<Matrix3<f64>> {
    let mut information = Matrix3::zeros();
    for marker in markers {
        let n = marker.len() as f64;
        let directions = || marker.iter().map(Vector3::normalize);
        let mean = directions().sum::<Vector3<f64>>() / n;
        for u in directions() {
            information += (u - mean) * (u - mean).transpose();
        }
    }
    // Exactly planar data invert to rounding noise: compare the pivots, not zero.
    let eigen = calib_geometry::decompose::symmetric_eigen_small(&information);
    if eigen.values[0] <= 1e-12 * eigen.values[2] {
        return None;
    }
    Some(information.cholesky()?.inverse() * (sigma * sigma))
}

/// Bound (2) over `[center; body_point]` for true poses `world_from_body` and a true body point.
///
/// `None` where the rotations share one axis.
#[must_use]
pub fn hot_spot(
    poses: &[Pose],
    body_point: &Vector3<f64>,
    sigma_t: f64,
    sigma_r: f64,
) -> Option<Matrix6<f64>> {
    let unit = body_point.try_normalize(0.0).unwrap_or_else(Vector3::x);
    let across = sigma_t * sigma_t + sigma_r * sigma_r * body_point.norm_squared();
    let along_part = unit * unit.transpose();
    let weight = along_part / (sigma_t * sigma_t) + (Matrix3::identity() - along_part) / across;
    let mut information = Matrix6::zeros();
    for pose in poses {
        // In the body frame A_i = [R_iᵀ  −I].
        let turned = pose.rotation * weight;
        let mut oo = information.fixed_view_mut::<3, 3>(0, 0);
        oo += turned * pose.rotation.transpose();
        let mut op = information.fixed_view_mut::<3, 3>(0, 3);
        op -= turned;
        let mut po = information.fixed_view_mut::<3, 3>(3, 0);
        po -= turned.transpose();
        let mut pp = information.fixed_view_mut::<3, 3>(3, 3);
        pp += weight;
    }
    let eigen = calib_geometry::decompose::symmetric_eigen_small(&information);
    if eigen.values[0] <= 1e-12 * eigen.values[5] {
        return None;
    }
    Some(information.cholesky()?.inverse())
}

/// Bound of the center for the raw markers of a rigid body: `layout` relative to the center, one
/// orientation for each frame, every marker seen in every frame.
#[must_use]
pub fn ball(
    layout: &[Vector3<f64>],
    orientations: &[UnitQuaternion<f64>],
    sigma: f64,
) -> Option<Matrix3<f64>> {
    Some(ball_bundle::unit_bound(layout, orientations)? * (sigma * sigma))
}
