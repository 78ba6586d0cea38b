//! Means of rotations and of axes.
//!
//! ```text
//! rotations:  argmax_R tr(Rᵀ Σ w_i R_i)      chordal L2 mean (Sharf et al. 2010), paper Eq. 24/25
//! axes:       principal eigenvector of Σ w_i n_i n_iᵀ       an axis has no sign
//! ```

use nalgebra::{Matrix3, Unit, UnitQuaternion, Vector3};

use crate::decompose::symmetric_eigen_small;
use crate::so3;

/// Relative spectral gap below which the mean is decided by rounding.
const UNIQUE: f64 = 1e-9;

/// Why there is no mean.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MeanError {
    /// Nothing to average.
    #[error("no samples to average")]
    Empty,
    /// A sample is NaN or infinite.
    #[error("sample {index} is not finite")]
    NotFinite {
        /// Position of the sample.
        index: usize,
    },
    /// Several means are equally good.
    #[error("the mean is not unique: relative spectral gap {gap:.1e}, needed {needed:.0e}")]
    NotUnique {
        /// The gap found.
        gap: f64,
        /// The gap that makes the mean meaningful.
        needed: f64,
    },
}

/// Chordal L2 mean of rotations, equal weights.
///
/// # Errors
/// [`MeanError`] when empty, not finite, or not unique (e.g. two rotations 180° apart).
pub fn chordal_mean(rotations: &[UnitQuaternion<f64>]) -> Result<UnitQuaternion<f64>, MeanError> {
    weighted_chordal_mean(rotations.iter().map(|r| (*r, 1.0)))
}

/// Chordal L2 mean of rotations with weights.
///
/// # Errors
/// As [`chordal_mean`]; weights count as part of their rotation.
pub fn weighted_chordal_mean(
    rotations: impl IntoIterator<Item = (UnitQuaternion<f64>, f64)>,
) -> Result<UnitQuaternion<f64>, MeanError> {
    let mut sum = Matrix3::zeros();
    let mut empty = true;
    for (index, (r, w)) in rotations.into_iter().enumerate() {
        if !(w.is_finite() && r.coords.iter().all(|x| x.is_finite())) {
            return Err(MeanError::NotFinite { index });
        }
        sum += r.to_rotation_matrix().matrix() * w;
        empty = false;
    }
    if empty {
        return Err(MeanError::Empty);
    }
    so3::nearest_rotation(&sum).ok_or(MeanError::NotUnique {
        gap: 0.0,
        needed: UNIQUE,
    })
}

/// Sign-free mean of axes; with a `reference` the sign is chosen within 90° of it, otherwise within
/// 90° of the first axis.
///
/// # Errors
/// [`MeanError`] when empty, not finite, or not unique (e.g. two orthogonal axes).
pub fn axis_mean(
    axes: &[Unit<Vector3<f64>>],
    reference: Option<Unit<Vector3<f64>>>,
) -> Result<Unit<Vector3<f64>>, MeanError> {
    let first = axes.first().ok_or(MeanError::Empty)?;
    let mut scatter = Matrix3::zeros();
    for (index, n) in axes.iter().enumerate() {
        if !n.iter().all(|x| x.is_finite()) {
            return Err(MeanError::NotFinite { index });
        }
        scatter += n.into_inner() * n.transpose();
    }
    let eigen = symmetric_eigen_small(&scatter);
    let gap = (eigen.values[2] - eigen.values[1]) / eigen.values[2];
    if gap <= UNIQUE {
        return Err(MeanError::NotUnique {
            gap,
            needed: UNIQUE,
        });
    }
    let mean = Unit::new_normalize(eigen.vectors.column(2).into_owned());
    let sign_of = reference.unwrap_or(*first);
    Ok(if mean.dot(&sign_of) < 0.0 {
        -mean
    } else {
        mean
    })
}
