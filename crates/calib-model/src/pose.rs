//! A pose as rotation matrix and translation: what the inner loop multiplies.

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, Vector3, Vector6};

use calib_geometry::so3;

/// A pose, `outer_from_inner`: p ↦ r p + t.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// Rotation matrix.
    pub r: Matrix3<f64>,
    /// Translation, m.
    pub t: Vector3<f64>,
}

impl Pose {
    /// No motion.
    #[inline]
    #[must_use]
    pub fn identity() -> Self {
        Self {
            r: Matrix3::identity(),
            t: Vector3::zeros(),
        }
    }

    /// From an isometry.
    #[inline]
    #[must_use]
    pub fn of(x: &Isometry3<f64>) -> Self {
        Self {
            r: *x.rotation.to_rotation_matrix().matrix(),
            t: x.translation.vector,
        }
    }

    /// As an isometry; exact where `r` is a rotation.
    #[must_use]
    pub fn isometry(&self) -> Isometry3<f64> {
        Isometry3::from_parts(
            Translation3::from(self.t),
            so3::quaternion_of(&Rotation3::from_matrix_unchecked(self.r)),
        )
    }

    /// `a_from_c` from `a_from_b` (this) and `b_from_c`.
    #[inline]
    #[must_use]
    pub fn then(&self, rhs: &Self) -> Self {
        Self {
            r: self.r * rhs.r,
            t: self.t + self.r * rhs.t,
        }
    }

    /// `inner_from_outer`.
    #[inline]
    #[must_use]
    pub fn inverse(&self) -> Self {
        let rt = self.r.transpose();
        Self {
            r: rt,
            t: -(rt * self.t),
        }
    }

    /// Itself, or its inverse.
    #[inline]
    #[must_use]
    pub fn oriented(self, inverse: bool) -> Self {
        if inverse { self.inverse() } else { self }
    }

    /// Ad(self⁻¹) [ω; v] = [Rᵀω; Rᵀ(v + ω × t)]
    #[inline]
    #[must_use]
    pub fn pull_back(&self, xi: &Vector6<f64>) -> Vector6<f64> {
        let omega = Vector3::new(xi[0], xi[1], xi[2]);
        let v = Vector3::new(xi[3], xi[4], xi[5]) + omega.cross(&self.t);
        let (a, b) = (self.r.tr_mul(&omega), self.r.tr_mul(&v));
        Vector6::new(a.x, a.y, a.z, b.x, b.y, b.z)
    }

    /// [`Pose::pull_back`] of a twist with ω = 0: [0; Rᵀv]
    #[inline]
    #[must_use]
    pub fn pull_back_translation(&self, xi: &Vector6<f64>) -> Vector6<f64> {
        let b = self.r.tr_mul(&Vector3::new(xi[3], xi[4], xi[5]));
        Vector6::new(0.0, 0.0, 0.0, b.x, b.y, b.z)
    }

    /// Ad(self) [ω; v] = [Rω; t × Rω + Rv]
    #[inline]
    #[must_use]
    pub fn push_forward(&self, xi: &Vector6<f64>) -> Vector6<f64> {
        let omega = self.r * Vector3::new(xi[0], xi[1], xi[2]);
        let v = self.r * Vector3::new(xi[3], xi[4], xi[5]) + self.t.cross(&omega);
        Vector6::new(omega.x, omega.y, omega.z, v.x, v.y, v.z)
    }
}

impl Pose {
    /// R | t by rows: the upper three rows of a homogeneous matrix.
    #[must_use]
    pub fn rows(&self) -> [f64; 12] {
        let mut out = [0.0; 12];
        for (i, row) in out.chunks_exact_mut(4).enumerate() {
            for (k, x) in row.iter_mut().take(3).enumerate() {
                *x = self.r[(i, k)];
            }
            row[3] = self.t[i];
        }
        out
    }

    /// From the same twelve numbers; the rotation is taken as it is.
    #[must_use]
    pub fn from_rows(rows: &[f64; 12]) -> Self {
        let x = |i: usize, k: usize| rows[4 * i + k];
        Self {
            r: nalgebra::Matrix3::from_fn(x),
            t: Vector3::from_fn(|i, _| x(i, 3)),
        }
    }
}

impl From<Isometry3<f64>> for Pose {
    fn from(pose: Isometry3<f64>) -> Self {
        Self::of(&pose)
    }
}
