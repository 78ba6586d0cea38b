//! What the solvers refuse to read: lists of unequal length, too few poses, values that are not finite, rotations about one axis.

use calib_geometry::{decompose, so3};
use nalgebra::{Isometry3, Matrix3, Vector3};
use thiserror::Error;

/// Why a hand–eye problem has no answer.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum HandEyeError {
    /// The two lists differ in length.
    #[error("{a} poses on one side and {b} on the other")]
    Lengths {
        /// Left.
        a: usize,
        /// Right.
        b: usize,
    },
    /// Three poses with two different rotation axes are the least.
    #[error("{found} poses are too few: {needed} are the least")]
    TooFew {
        /// Given.
        found: usize,
        /// Needed.
        needed: usize,
    },
    /// A pose is not finite.
    #[error("pose {index} is not finite")]
    NotFinite {
        /// Its index.
        index: usize,
    },
    /// Nothing turns between the poses.
    #[error(
        "the poses of one side are all turned alike; turn the flange about two axes between them"
    )]
    NoRotation,
    /// All rotations are about one axis: the translation along it is not observable.
    #[error(
        "the rotations share one axis: σ ratio {ratio:.1e} is under {limit:.0e}; rotate about a second axis"
    )]
    OneAxis {
        /// Second over first singular value of the relative rotation vectors.
        ratio: f64,
        /// The limit.
        limit: f64,
    },
}

/// Rotation vectors whose second direction is weaker than this fraction of the first are one axis: 0.1° of
/// noise on 10° of motion.
pub(crate) const ONE_AXIS: f64 = 1e-2;

/// Rotation vectors whose squares sum to less than the square of this, rad, are rounding.
const NO_ROTATION: f64 = 1e-6;

pub(crate) fn check(
    a: &[Isometry3<f64>],
    b: &[Isometry3<f64>],
    needed: usize,
) -> Result<(), HandEyeError> {
    if a.len() != b.len() {
        return Err(HandEyeError::Lengths {
            a: a.len(),
            b: b.len(),
        });
    }
    if a.len() < needed {
        return Err(HandEyeError::TooFew {
            found: a.len(),
            needed,
        });
    }
    let finite = |x: &Isometry3<f64>| {
        x.translation.vector.iter().all(|v| v.is_finite())
            && x.rotation.coords.iter().all(|v| v.is_finite())
    };
    match a.iter().zip(b).position(|(a, b)| !finite(a) || !finite(b)) {
        Some(index) => Err(HandEyeError::NotFinite { index }),
        None => Ok(()),
    }
}

pub(crate) fn check_axes(a: &[Isometry3<f64>]) -> Result<(), HandEyeError> {
    let first = a[0].rotation.inverse();
    two_axes(a[1..].iter().map(|a| so3::log(&(first * a.rotation))))
}

pub(crate) fn two_axes(logs: impl Iterator<Item = Vector3<f64>>) -> Result<(), HandEyeError> {
    let moment: Matrix3<f64> = logs.map(|l| l * l.transpose()).sum();
    let s = decompose::svd_small(&moment).s;
    if s[0].sqrt() < NO_ROTATION {
        return Err(HandEyeError::NoRotation);
    }
    let ratio = if s[0] > 0.0 {
        (s[1] / s[0]).sqrt()
    } else {
        0.0
    };
    if ratio < ONE_AXIS {
        return Err(HandEyeError::OneAxis {
            ratio,
            limit: ONE_AXIS,
        });
    }
    Ok(())
}
