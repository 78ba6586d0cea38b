//! Cramér–Rao bounds: the covariance below which no unbiased estimator of the center can be.
//!
//! ```text
//! sphere:    C ≥ σ² ( Σ_p Σ_k (u_pk − ū_p)(u_pk − ū_p)ᵀ )⁻¹                               (1)
//! hot spot:  C ≥ ( Σ_i A_iᵀ Σ_i⁻¹ A_i )⁻¹,  A_i = [I  −R_i] over [o; p],
//!            Σ_i = σ_t² I + σ_r² |p|² R_i (I − p̂p̂ᵀ) R_iᵀ                                   (2)
//! ```
//!
//! (1) does not depend on the radius; (2) has the true poses eliminated. All at the truth.
//!
//! Samples with covariances of their own, feet (where on the sphere a sample belongs) unknown:
//!
//! ```text
//! C ≥ I⁻¹,   I = Σ_p Σ_k w_pk (u_pk − ū_p)(u_pk − ū_p)ᵀ,   w = 1/uᵀΣu,  ū weighted             (3)
//! C ≥ the same with w λ instead of w                                                        (4)
//! C ≈ I⁻¹ + I⁻¹ E I⁻¹                                                                       (5)
//! ```
//!
//! (3) is the Cramér–Rao bound: what is left as the noise goes to zero. (4) holds for every unbiased estimator at any noise: λ ≤ 1 is the share
//! of a sample's information that no displacement of its foot along the bent sphere imitates. (5) is no bound but what the best estimator has
//! to second order that reads direction and weight of a sample off the sample. λ and E: see [`crate::bend`].

use calib_estimator::measured::Pose;
use nalgebra::{Matrix3, Matrix6, UnitQuaternion, Vector3};

use crate::{
    ball_bundle,
    bend::{Bend, share_left},
};

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

/// Bounds (3), (4) and the second-order figure (5) of a sphere whose samples have covariances of their own.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct SphereBounds {
    /// (3): the Cramér–Rao bound.
    pub cramer_rao: Matrix3<f64>,
    /// (4): below this no unbiased estimator can be, however large the noise.
    pub unbiased: Matrix3<f64>,
    /// (5): the least that can be had to second order by weighing samples by what they themselves say.
    pub second_order: Matrix3<f64>,
}

/// Bounds of the center for true positions relative to it and their covariances, marker by marker. The radius of a marker is that of its first sample.
///
/// `None` where the positions determine no center, a covariance is not positive definite, or the numbers of both differ.
#[must_use]
pub fn sphere_center_weighted(
    markers: &[Vec<Vector3<f64>>],
    covariances: &[Vec<Matrix3<f64>>],
) -> Option<SphereBounds> {
    if markers.len() != covariances.len() {
        return None;
    }
    let (mut plain, mut left, mut excess) = (Matrix3::zeros(), Matrix3::zeros(), Matrix3::zeros());
    for (arms, noise) in markers.iter().zip(covariances) {
        if arms.len() != noise.len() {
            return None;
        }
        let mut samples = Vec::with_capacity(arms.len());
        for (arm, covariance) in arms.iter().zip(noise) {
            let u = arm.try_normalize(0.0)?;
            covariance.cholesky()?;
            samples.push((u, covariance, 1.0 / u.dot(&(covariance * u))));
        }
        let radius = arms.first().map_or(0.0, Vector3::norm);
        let mean = weighted_mean(samples.iter().map(|(u, _, w)| (*u, *w)));
        let mut shares = Vec::with_capacity(samples.len());
        for (u, covariance, w) in &samples {
            let d = u - mean;
            plain += d * (d * *w).transpose();
            excess += Bend::of(covariance, u, radius).excess(&d);
            shares.push((*u, w * share_left(covariance, u, radius)));
        }
        let mean = weighted_mean(shares.iter().copied());
        for (u, w) in shares {
            left += (u - mean) * ((u - mean) * w).transpose();
        }
    }
    let eigen = calib_geometry::decompose::symmetric_eigen_small(&plain);
    if eigen.values[0] <= 1e-12 * eigen.values[2] {
        return None;
    }
    let cramer_rao = plain.cholesky()?.inverse();
    Some(SphereBounds {
        cramer_rao,
        unbiased: left.cholesky()?.inverse(),
        second_order: cramer_rao + cramer_rao * excess * cramer_rao,
    })
}

fn weighted_mean(samples: impl Iterator<Item = (Vector3<f64>, f64)>) -> Vector3<f64> {
    let (sum, total) = samples.fold((Vector3::zeros(), 0.0), |(sum, total), (u, w)| {
        (sum + u * w, total + w)
    });
    sum / total
}
