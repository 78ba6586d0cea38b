//! A sphere that bends within the cloud of one sample.
//!
//! A sample x = f + ε, ε ~ N(0, Σ), belongs to a foot f on the sphere (radius r, normal ν at f) that nobody knows.
//!
//! ```text
//! v = νᵀΣν,   T = Σ − Σν(Σν)ᵀ/v       noise across the sphere, and along it (given that across)       (1)
//! E[h] = tr T / 2r,   var h = v + tr T²/2r² + …      height of x over the sphere, in the metric of Σ   (2)
//! ```
//!
//! (2) holds for every foot: with equal, isotropic noise the mean is the constant σ²/r, which the radius swallows; otherwise it depends on the
//! direction and pushes the center. The score of a center is Σ D h/v with D = ν − ν̄, read off the same sample at the foot of (1), which
//! itself moves by T/r². To second order its variance is Σ D Dᵀ/v + E,
//!
//! ```text
//! E = Σ [ D Dᵀ tr T²/(2 v) + T − (T q Dᵀ + D qᵀT)/v + D Dᵀ qᵀT q/v² ] / (v r²),    q = Σν               (3)
//! ```
//!
//! first because h is not normal any more, then because direction and weight are not known.
//!
//! What no unbiased estimator gets back: all that a displacement along the normal has in common with other feet. With z = Σ^−½ ε and
//! δ = Σ^−½ (f' − f) the likelihood ratio of the foot f' is exp(δ·z − |δ|²/2), two of them have the inner product exp(δ·δ'), and the
//! information 1/v of the sample shrinks to λ/v,
//!
//! ```text
//! λ = min over c and feet f_j of E (n·z − Σ c_j exp(δ_j·z − |δ_j|²/2))² = 1 − bᵀ K⁻¹ b,
//! K_ij = exp(δ_i·δ_j),  b_j = n·δ_j,   n ∥ Σ^½ ν                                                         (4)
//! ```
//!
//! with as many feet as one likes: fewer only leave λ larger, so that any number of them is a bound (Bhattacharyya 1946, all orders at once).

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

/// Feet tried in (4): so many steps of [`STEP`] to either side.
const STEPS: i32 = 4;
/// Half a standard deviation; finer ones change λ in the fourth digit.
const STEP: f64 = 0.5;
/// Added to the unit diagonal of K so that it can be factored; λ only grows by it.
const RIDGE: f64 = 1e-10;

/// (1) at one foot.
pub(crate) struct Bend {
    variance: f64,
    radius: f64,
    /// Σν.
    across: Vector3<f64>,
    /// T.
    along: Matrix3<f64>,
}

impl Bend {
    pub fn of(covariance: &Matrix3<f64>, normal: &Vector3<f64>, radius: f64) -> Self {
        let across = covariance * normal;
        let variance = normal.dot(&across);
        Self {
            variance,
            radius,
            along: covariance - across * across.transpose() / variance,
            across,
        }
    }

    /// E[h] of (2).
    pub fn mean_height(&self) -> f64 {
        self.along.trace() / (2.0 * self.radius)
    }

    /// What the bend adds to the variance of h, relative to v: the size of the next order.
    pub fn added_share(&self) -> f64 {
        0.5 * self.along.norm_squared() / (self.variance * self.radius * self.radius)
    }

    /// The summand of (3) for a sample whose normal is off the mean by `d`.
    pub fn excess(&self, d: &Vector3<f64>) -> Matrix3<f64> {
        let v = self.variance;
        let turned = self.along * self.across;
        let outer = d * d.transpose();
        let weight = (self.along + outer * (self.across.dot(&turned) / (v * v))
            - (turned * d.transpose() + d * turned.transpose()) / v)
            / (v * self.radius * self.radius);
        outer * (self.added_share() / v) + weight
    }
}

/// λ of (4); 1 where the covariance is none.
pub(crate) fn share_left(covariance: &Matrix3<f64>, normal: &Vector3<f64>, radius: f64) -> f64 {
    let Some(factor) = covariance.cholesky() else {
        return 1.0;
    };
    let root = factor.l();
    let unit = (root.tr_mul(normal)).normalize();
    let side = if normal.x.abs() < 0.6 {
        Vector3::x()
    } else {
        Vector3::y()
    };
    let first = normal.cross(&side).normalize();
    let basis = nalgebra::Matrix3x2::from_columns(&[first, normal.cross(&first)]);
    // Steps along the sphere that are one standard deviation long: the metric there is r² Bᵀ Σ⁻¹ B.
    let metric = basis.tr_mul(&factor.solve(&basis)) * (radius * radius);
    let Some(metric) = metric.cholesky() else {
        return 1.0;
    };
    let Some(unit_steps) = metric.l().transpose().try_inverse() else {
        return 1.0;
    };
    let mut feet: Vec<Vector3<f64>> = Vec::new();
    for i in -STEPS..=STEPS {
        for j in -STEPS..=STEPS {
            if i * i + j * j > STEPS * STEPS {
                continue;
            }
            let turn =
                basis * (unit_steps * nalgebra::Vector2::new(f64::from(i), f64::from(j)) * STEP);
            let angle = turn.norm();
            // Beyond the equator are other feet, but then the cloud is larger than the sphere.
            if angle > 0.5 * std::f64::consts::PI {
                continue;
            }
            let sine = if angle > 0.0 {
                angle.sin() / angle
            } else {
                1.0
            };
            let off = (normal * (angle.cos() - 1.0) + turn * sine) * radius;
            if let Some(delta) = root.solve_lower_triangular(&off) {
                feet.push(delta);
            }
        }
    }
    // Rows and columns divided by exp(|δ|²/2).
    let mut k = DMatrix::from_fn(feet.len(), feet.len(), |i, j| {
        (-0.5 * (feet[i] - feet[j]).norm_squared()).exp()
    });
    for i in 0..feet.len() {
        k[(i, i)] += RIDGE;
    }
    let b = DVector::from_fn(feet.len(), |j, _| {
        unit.dot(&feet[j]) * (-0.5 * feet[j].norm_squared()).exp()
    });
    k.cholesky()
        .map_or(1.0, |k| (1.0 - b.dot(&k.solve(&b))).clamp(0.0, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// To second order the share is 1/(1 + tr T²/2vr²): the variance that the bend adds.
    #[test]
    fn a_slight_bend_costs_its_variance() {
        let normal = Vector3::new(0.6, -0.48, 0.64);
        for size in [0.01, 0.03] {
            let covariance = Matrix3::from_diagonal(&Vector3::new(1.0, 2.0, 9.0)) * (size * size);
            let bend = Bend::of(&covariance, &normal, 1.0);
            let lost = bend.added_share();
            let share = share_left(&covariance, &normal, 1.0);
            assert!(
                ((1.0 - share) / lost - 1.0).abs() < 0.05,
                "{share}, lost {lost}"
            );
        }
    }

    #[test]
    fn a_flat_sphere_loses_nothing() {
        let covariance = Matrix3::from_diagonal(&Vector3::new(1.0, 2.0, 25.0));
        let share = share_left(&covariance, &Vector3::x(), 1e6);
        assert!((share - 1.0).abs() < 1e-6, "{share}");
    }

    #[test]
    fn no_covariance_has_no_share() {
        let none = Matrix3::from_diagonal(&Vector3::new(1.0, 0.0, 1.0));
        assert_eq!(share_left(&none, &Vector3::x(), 1.0), 1.0);
        // A cloud far larger than the sphere: still a share.
        let huge = Matrix3::identity() * 1e4;
        let share = share_left(&huge, &Vector3::x(), 1.0);
        assert!((0.0..=1.0).contains(&share), "{share}");
    }
}
