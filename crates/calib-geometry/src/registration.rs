//! Rigid registration of corresponding points (Kabsch 1976, Umeyama 1991 for the reflection).
//!
//! ```text
//! min_{R,t} Σ w_i ‖ b_i − (R a_i + t) ‖²,   H = Σ w_i (a_i − ā)(b_i − b̄)ᵀ,   R = V diag(1,1,±1) Uᵀ
//! ```

use nalgebra::{Isometry3, Matrix3, Point3, Translation3, Vector3};

use crate::decompose::symmetric_eigen_small;
use crate::so3;

/// σ₂/σ₁ of the point spread below which the points are a line to rounding.
const COLLINEAR: f64 = 1e-7;

/// Rigid motion between two point sets, and how well it fits.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Registration {
    /// `b_from_a`.
    pub b_from_a: Isometry3<f64>,
    /// Root mean square of ‖b_i − b_from_a · a_i‖, m (unweighted).
    pub rms: f64,
}

/// Why two point sets do not determine a motion.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RegistrationError {
    /// The sets have different lengths.
    #[error("{a} points were given against {b}")]
    CountMismatch {
        /// Length of the first set.
        a: usize,
        /// Length of the second set.
        b: usize,
    },
    /// Fewer than three correspondences.
    #[error("{got} corresponding points: a rigid motion needs 3")]
    TooFew {
        /// Correspondences given.
        got: usize,
    },
    /// The points lie on a line or coincide: the turn about it is free.
    #[error("the points lie on a line (spread ratio {ratio:.1e}): the turn about it is free")]
    Collinear {
        /// Second over first principal spread.
        ratio: f64,
    },
    /// A coordinate is NaN or infinite.
    #[error("point {index} is not finite")]
    NotFinite {
        /// Position of the point.
        index: usize,
    },
    /// The best orthogonal map is not unique (e.g. a mirrored planar or symmetric set).
    #[error("the rotation between the sets is not unique")]
    NotUnique,
}

/// The motion `b_from_a` that carries `a` onto `b` in least squares; `weights` (≥ 0) default to 1.
///
/// # Errors
/// [`RegistrationError`] for fewer than three, collinear, non-finite or mismatched points.
pub fn rigid_registration(
    a: &[Point3<f64>],
    b: &[Point3<f64>],
    weights: Option<&[f64]>,
) -> Result<Registration, RegistrationError> {
    if a.len() != b.len() || weights.is_some_and(|w| w.len() != a.len()) {
        return Err(RegistrationError::CountMismatch {
            a: a.len(),
            b: b.len(),
        });
    }
    if a.len() < 3 {
        return Err(RegistrationError::TooFew { got: a.len() });
    }
    let finite = |p: &Point3<f64>| p.iter().all(|x| x.is_finite());
    if let Some(index) = (0..a.len()).find(|&i| !finite(&a[i]) || !finite(&b[i])) {
        return Err(RegistrationError::NotFinite { index });
    }
    let weight = |i: usize| weights.map_or(1.0, |w| w[i]);
    let total: f64 = (0..a.len()).map(weight).sum();
    let centroid = |p: &[Point3<f64>]| -> Vector3<f64> {
        (0..p.len())
            .map(|i| p[i].coords * weight(i))
            .sum::<Vector3<f64>>()
            / total
    };
    let (mean_a, mean_b) = (centroid(a), centroid(b));

    let mut h = Matrix3::zeros();
    let mut scatter = Matrix3::zeros();
    for i in 0..a.len() {
        let da = a[i].coords - mean_a;
        h += da * (b[i].coords - mean_b).transpose() * weight(i);
        scatter += da * da.transpose() * weight(i);
    }
    let spread = symmetric_eigen_small(&scatter).values;
    let ratio = (spread[1].max(0.0) / spread[2].max(f64::MIN_POSITIVE)).sqrt();
    if spread[2] <= 0.0 || ratio < COLLINEAR {
        return Err(RegistrationError::Collinear { ratio });
    }
    let rotation = so3::nearest_rotation(&h.transpose()).ok_or(RegistrationError::NotUnique)?;
    let b_from_a = Isometry3::from_parts(Translation3::from(mean_b - rotation * mean_a), rotation);
    let sum: f64 = a
        .iter()
        .zip(b)
        .map(|(a, b)| (b - b_from_a * a).norm_squared())
        .sum();
    Ok(Registration {
        b_from_a,
        rms: (sum / a.len() as f64).sqrt(),
    })
}
