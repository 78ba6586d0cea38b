//! Motion of one joint with its effects: the one place where they are evaluated.
//!
//! ```text
//! φ = q + Σ_j F_j c_j,   θ = Σ_j e_j F_j c_j,   δ = p Σ_j F_j c_j
//! joint_from_child = Trans(δ) · exp(S φ) · Exp(θ)                                           (1)
//! ```

use nalgebra::{Isometry3, Matrix3, Translation3, UnitQuaternion, Vector3, Vector6};

use calib_geometry::so3;

use crate::axis::Axis;
use crate::effect::{Drives, EffectKind};
use crate::pose::Pose;

/// φ, θ and δ of equation (1).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointMotion {
    axis: Axis,
    phi: f64,
    /// Sine and cosine of φ at a revolute joint.
    sin: f64,
    cos: f64,
    theta: Option<Vector3<f64>>,
    delta: Option<Vector3<f64>>,
}

impl JointMotion {
    /// From the reading (rad or m) and the amount F·c of every term, at a joint with this reach (m, in its axes).
    pub fn new(
        (axis, reach): (Axis, Vector3<f64>),
        q: f64,
        amounts: impl IntoIterator<Item = (EffectKind, f64)>,
    ) -> Self {
        let amounts = amounts.into_iter();
        let amounts = amounts.map(|(kind, a)| (kind.drives(), a));
        Self::sum((axis, &reach), q, amounts)
    }

    /// Equation (1); the terms by what they drive.
    #[inline]
    pub fn sum(
        (axis, reach): (Axis, &Vector3<f64>),
        q: f64,
        amounts: impl Iterator<Item = (Drives, f64)>,
    ) -> Self {
        let mut phi = q;
        let (mut theta, mut delta) = (None, None);
        for (drives, amount) in amounts {
            match drives {
                Drives::About => phi += amount,
                Drives::Across(k) => {
                    *theta.get_or_insert_with(Vector3::zeros) += axis.across()[k] * amount;
                }
                Drives::Along => *delta.get_or_insert_with(Vector3::zeros) += reach * amount,
            }
        }
        Self {
            delta,
            ..Self::of(axis, phi, theta)
        }
    }

    /// From φ (rad or m) and θ (rad).
    #[inline]
    #[must_use]
    pub fn of(axis: Axis, phi: f64, theta: Option<Vector3<f64>>) -> Self {
        let (sin, cos) = match axis {
            Axis::Revolute(_) => phi.sin_cos(),
            Axis::Prismatic(_) => (0.0, 1.0),
        };
        Self {
            axis,
            phi,
            sin,
            cos,
            theta,
            delta: None,
        }
    }

    /// A revolute joint from (sin, cos) of its reading and of the constant that is added to it:
    ///
    /// ```text
    /// sin(q + c) = sin q cos c + cos q sin c,   cos(q + c) = cos q cos c − sin q sin c
    /// ```
    #[inline]
    pub fn shifted(axis: Axis, (sin_q, cos_q): (f64, f64), (sin_c, cos_c): (f64, f64)) -> Self {
        let (sin, cos) = (sin_q * cos_c + cos_q * sin_c, cos_q * cos_c - sin_q * sin_c);
        Self {
            axis,
            phi: f64::NAN,
            sin,
            cos,
            theta: None,
            delta: None,
        }
    }

    /// φ: the motion about (along) the axis, rad or m.
    #[must_use]
    pub fn phi(&self) -> f64 {
        self.phi
    }

    /// From φ (rad or m) whose sine and cosine are known; without θ.
    #[inline]
    #[must_use]
    pub fn turned(axis: Axis, phi: f64, (sin, cos): (f64, f64)) -> Self {
        Self {
            axis,
            phi,
            sin,
            cos,
            theta: None,
            delta: None,
        }
    }

    /// θ: the rotation across the axis, rad; `None` where nothing yields across.
    #[inline]
    #[must_use]
    pub fn theta(&self) -> Option<Vector3<f64>> {
        self.theta
    }

    /// δ: the growth of what leads to the joint, m; `None` where nothing grows.
    #[inline]
    #[must_use]
    pub fn delta(&self) -> Option<Vector3<f64>> {
        self.delta
    }

    /// The same θ and δ with another φ: for joints that follow the motion of this one.
    #[must_use]
    pub fn with_phi(&self, phi: f64) -> Self {
        Self {
            delta: self.delta,
            ..Self::of(self.axis, phi, self.theta)
        }
    }

    /// `joint_from_child`: equation (1) in quaternions, where the solver's inner loop has matrices.
    #[must_use]
    pub fn joint_from_child(&self) -> Isometry3<f64> {
        let mut x = match self.axis {
            Axis::Revolute(a) => Isometry3::from_parts(
                Translation3::identity(),
                UnitQuaternion::from_axis_angle(&a, self.phi),
            ),
            Axis::Prismatic(a) => Isometry3::from_parts(
                Translation3::from(a.into_inner() * self.phi),
                UnitQuaternion::identity(),
            ),
        };
        if let Some(theta) = self.theta {
            x.rotation *= so3::exp(&theta);
        }
        if let Some(delta) = self.delta {
            x.translation.vector += delta;
        }
        x
    }

    /// Equation (1), or its inverse.
    #[inline]
    #[must_use]
    pub fn pose(&self, inverse: bool) -> Pose {
        let mut x = self.screw_motion(false);
        if let Some(theta) = self.theta {
            x.r *= so3::exp(&theta).to_rotation_matrix().matrix();
        }
        if let Some(delta) = self.delta {
            x.t += delta;
        }
        x.oriented(inverse)
    }

    /// exp(S φ), or exp(−S φ).
    #[inline]
    #[must_use]
    pub fn screw_motion(&self, inverse: bool) -> Pose {
        let sign = if inverse { -1.0 } else { 1.0 };
        match &self.axis {
            Axis::Revolute(a) => {
                // R = cos φ I + sin φ [a]ₓ + (1 − cos φ) a aᵀ
                let (s, c) = (self.sin * sign, self.cos);
                let k = 1.0 - c;
                let (x, y, z) = (a.x, a.y, a.z);
                Pose {
                    r: Matrix3::new(
                        c + k * x * x,
                        k * x * y - s * z,
                        k * x * z + s * y,
                        k * x * y + s * z,
                        c + k * y * y,
                        k * y * z - s * x,
                        k * x * z - s * y,
                        k * y * z + s * x,
                        c + k * z * z,
                    ),
                    t: Vector3::zeros(),
                }
            }
            Axis::Prismatic(a) => Pose {
                r: Matrix3::identity(),
                t: a.into_inner() * (self.phi * sign),
            },
        }
    }
}

/// S of equation (1) as a twist `[ω; v]` in the joint's frame.
#[inline]
#[must_use]
pub fn screw(axis: &Axis) -> Vector6<f64> {
    let a = axis.direction();
    match axis {
        Axis::Revolute(_) => Vector6::new(a.x, a.y, a.z, 0.0, 0.0, 0.0),
        Axis::Prismatic(_) => Vector6::new(0.0, 0.0, 0.0, a.x, a.y, a.z),
    }
}

/// A translation without rotation as a twist `[ω; v]`.
#[inline]
#[must_use]
pub fn translation_twist(v: &Vector3<f64>) -> Vector6<f64> {
    Vector6::new(0.0, 0.0, 0.0, v.x, v.y, v.z)
}

/// A rotation without translation as a twist `[ω; v]`.
#[inline]
#[must_use]
pub fn rotation_twist(w: &Vector3<f64>) -> Vector6<f64> {
    Vector6::new(w.x, w.y, w.z, 0.0, 0.0, 0.0)
}
