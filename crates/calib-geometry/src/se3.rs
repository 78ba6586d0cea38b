//! Rigid motions: exponential, logarithm, adjoint and right Jacobians on SE(3).
//!
//! Barfoot, *State Estimation for Robotics* (2017), §7.1, reordered to twists `[ω; v]`.

use std::ops::{Add, Mul, Neg};

use nalgebra::{Isometry3, Matrix3, Matrix6, Translation3, Vector3, Vector6};
use serde::{Deserialize, Serialize};

use crate::so3;

/// A twist `[ω; v]`: rotation (rad) over translation (m).
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Twist(
    /// `[ω; v]` as one vector.
    pub Vector6<f64>,
);

impl Twist {
    /// Twist of angular part ω (rad) and linear part v (m).
    #[must_use]
    pub fn new(angular: Vector3<f64>, linear: Vector3<f64>) -> Self {
        Self(Vector6::new(
            angular.x, angular.y, angular.z, linear.x, linear.y, linear.z,
        ))
    }

    /// The twist that moves nothing.
    #[must_use]
    pub fn zero() -> Self {
        Self(Vector6::zeros())
    }

    /// ω, rad.
    #[must_use]
    pub fn angular(&self) -> Vector3<f64> {
        self.0.fixed_rows::<3>(0).into_owned()
    }

    /// v, m.
    #[must_use]
    pub fn linear(&self) -> Vector3<f64> {
        self.0.fixed_rows::<3>(3).into_owned()
    }
}

impl Neg for Twist {
    type Output = Self;
    fn neg(self) -> Self {
        Self(-self.0)
    }
}

impl Add for Twist {
    type Output = Self;
    fn add(self, rhs: Self) -> Self {
        Self(self.0 + rhs.0)
    }
}

impl Mul<f64> for Twist {
    type Output = Self;
    fn mul(self, rhs: f64) -> Self {
        Self(self.0 * rhs)
    }
}

/// `exp(ξ) = (exp ω, V(ω) v)`.
#[must_use]
pub fn exp(xi: &Twist) -> Isometry3<f64> {
    let omega = xi.angular();
    let translation = so3::left_jacobian(&omega) * xi.linear();
    Isometry3::from_parts(Translation3::from(translation), so3::exp(&omega))
}

/// ξ with `exp(ξ) = x` and ‖ω‖ ≤ π.
#[must_use]
pub fn log(x: &Isometry3<f64>) -> Twist {
    let omega = so3::log(&x.rotation);
    Twist::new(
        omega,
        so3::left_jacobian_inverse(&omega) * x.translation.vector,
    )
}

/// `Ad(x)` in `[ω; v]` order: `x · exp(ξ) · x⁻¹ = exp(Ad(x) ξ)`.
#[must_use]
pub fn adjoint(x: &Isometry3<f64>) -> Matrix6<f64> {
    let r = *x.rotation.to_rotation_matrix().matrix();
    blocks(
        &r,
        &Matrix3::zeros(),
        &(so3::skew(&x.translation.vector) * r),
        &r,
    )
}

/// Right Jacobian: `exp(ξ + δ) ≈ exp(ξ) · exp(J_r(ξ) δ)`.
#[must_use]
pub fn right_jacobian(xi: &Twist) -> Matrix6<f64> {
    let j = so3::right_jacobian(&xi.angular());
    let q = coupling(&-xi.angular(), &-xi.linear());
    blocks(&j, &Matrix3::zeros(), &q, &j)
}

/// Inverse of [`right_jacobian`]: `log(x · exp(δ)) ≈ log(x) + J_r⁻¹(log x) δ`.
#[must_use]
pub fn right_jacobian_inverse(xi: &Twist) -> Matrix6<f64> {
    let j = so3::right_jacobian_inverse(&xi.angular());
    let q = coupling(&-xi.angular(), &-xi.linear());
    blocks(&j, &Matrix3::zeros(), &(-(j * q * j)), &j)
}

/// The rotation–translation block `Q(φ, ρ)` of the *left* Jacobian, Barfoot eq. 7.86.
fn coupling(phi: &Vector3<f64>, rho: &Vector3<f64>) -> Matrix3<f64> {
    let theta = phi.norm();
    let t2 = theta * theta;
    let (_, c2) = so3::jacobian_coefficients(theta);
    // c3 = (θ²/2 + cos θ − 1)/θ⁴,  c4 = ½ (c3 + 3 (θ − sin θ − θ³/6)/θ⁵)
    let (c3, c4) = if theta < so3::SERIES_BELOW {
        let c3 = 1.0 / 24.0 - t2 * (1.0 / 720.0 - t2 * (1.0 / 40_320.0 - t2 * (1.0 / 3_628_800.0)));
        let e = -1.0 / 120.0 + t2 * (1.0 / 5_040.0 - t2 * (1.0 / 362_880.0 - t2 / 39_916_800.0));
        (c3, 0.5 * (c3 + 3.0 * e))
    } else {
        let c3 = (0.5 * t2 + theta.cos() - 1.0) / (t2 * t2);
        let e = (theta - theta.sin() - t2 * theta / 6.0) / (t2 * t2 * theta);
        (c3, 0.5 * (c3 + 3.0 * e))
    };
    let p = so3::skew(phi);
    let r = so3::skew(rho);
    let pr = p * r;
    let rp = r * p;
    let prp = pr * p;
    r * 0.5 + (pr + rp + prp) * c2 + (p * pr + rp * p - prp * 3.0) * c3 + (prp * p + p * prp) * c4
}

fn blocks(a: &Matrix3<f64>, b: &Matrix3<f64>, c: &Matrix3<f64>, d: &Matrix3<f64>) -> Matrix6<f64> {
    let mut m = Matrix6::zeros();
    m.fixed_view_mut::<3, 3>(0, 0).copy_from(a);
    m.fixed_view_mut::<3, 3>(0, 3).copy_from(b);
    m.fixed_view_mut::<3, 3>(3, 0).copy_from(c);
    m.fixed_view_mut::<3, 3>(3, 3).copy_from(d);
    m
}
