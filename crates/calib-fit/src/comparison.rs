//! All estimators side by side.

use std::fmt::Write as _;

use calib_estimator::chance::f_tail;
use calib_geometry::decompose::symmetric_eigen_small;
use nalgebra::{Isometry3, Matrix3, Vector3};
use serde_json::{Value, json};

use crate::answer::{Answer, answer, coordinates};

/// What of an estimate is compared.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Quantity {
    /// A place, m, under this key.
    Place(&'static str),
    /// A direction without sign, under this key.
    Direction(&'static str),
}

/// The quantity in one estimate.
pub(crate) struct Found {
    pub value: Vector3<f64>,
    /// m² or rad².
    pub covariance: Matrix3<f64>,
    /// m or rad; infinite where the data do not give it.
    pub sigma: f64,
    /// Behind the covariance; `None` where the noise was stated.
    pub degrees_of_freedom: Option<f64>,
}

/// What one estimator says.
pub(crate) struct Line {
    pub id: &'static str,
    pub verdict: &'static str,
    pub reason: String,
    pub found: Option<Found>,
}

/// Chance of a distance, at the uncertainties of both, below which two estimates differ.
const DIFFERS: f64 = 1e-3;
/// Rounding of a place or a direction, m or rad.
const ROUNDING: f64 = 1e-9;
/// Degrees of freedom of a noise that was stated.
const STATED: f64 = 1e9;

/// The covariance of a translation in the parent frame, from that of its right perturbation.
pub(crate) fn in_parent(parent_from_child: &Isometry3<f64>, of: &Matrix3<f64>) -> Matrix3<f64> {
    let r = parent_from_child.rotation.to_rotation_matrix();
    r.matrix() * of * r.matrix().transpose()
}

impl Quantity {
    fn key(self) -> &'static str {
        match self {
            Self::Place(key) | Self::Direction(key) => key,
        }
    }

    /// What the columns of the table are; coordinates of a direction have no unit.
    fn heads(self) -> [&'static str; 3] {
        match self {
            Self::Place(_) => ["place, m", "σ, mm", "off, mm"],
            Self::Direction(_) => ["direction", "σ, deg", "off, deg"],
        }
    }

    /// m or rad.
    fn distance(self, a: &Vector3<f64>, b: &Vector3<f64>) -> f64 {
        match self {
            Self::Place(_) => (a - b).norm(),
            Self::Direction(_) => a.cross(b).norm().atan2(a.dot(b).abs()),
        }
    }

    /// Whether two estimates are as near as their uncertainties allow:
    ///
    /// ```text
    /// dᵀ (C₁ + C₂)⁻¹ d / k  ~  F(k, ν)     k = 3 for places, 2 for directions; ν: the smaller of both
    /// ```
    ///
    /// Estimates from the same data are nearer than that.
    fn agree(self, a: &Found, b: &Found) -> bool {
        let (d, k) = match self {
            Self::Place(_) => (a.value - b.value, 3),
            Self::Direction(_) => (a.value - b.value * a.value.dot(&b.value).signum(), 2),
        };
        if d.norm() <= ROUNDING || !(a.sigma + b.sigma).is_finite() {
            return true;
        }
        let eigen = symmetric_eigen_small(&(a.covariance + b.covariance));
        // The weakest first; a direction has no part along itself.
        let of = |i: usize| {
            let variance = eigen.values[i].max(ROUNDING * ROUNDING);
            d.dot(&eigen.vectors.column(i)).powi(2) / variance
        };
        let square: f64 = (3 - k..3).map(of).sum();
        let freedom = |f: &Found| f.degrees_of_freedom.unwrap_or(STATED).max(1.0);
        f_tail(square / k as f64, k as f64, freedom(a).min(freedom(b))) >= DIFFERS
    }

    fn shown(self, length: f64) -> String {
        match self {
            Self::Place(_) => format!("{:.4}", length * 1e3),
            Self::Direction(_) => format!("{:.4}", length.to_degrees()),
        }
    }
}

/// A table of estimates with the distance of each from the first that is observable.
pub(crate) fn comparison(quantity: Quantity, lines: &[Line]) -> Answer {
    let reference = lines.iter().find(|l| l.verdict == "ok");
    let reference = reference.and_then(|l| l.found.as_ref());
    let mut text = String::new();
    if lines.iter().any(|line| line.found.is_some()) {
        let [place, sigma, off] = quantity.heads();
        let _ = writeln!(
            text,
            "{:<16}      {place:<32} {sigma:>8} {off:>8}",
            "estimator"
        );
    }
    let mut values = Vec::new();
    for Line {
        id,
        verdict,
        reason,
        found,
    } in lines
    {
        let Some(found) = found else {
            let _ = writeln!(text, "{id:<16} {verdict}: {reason}");
            values.push(json!({ "estimator": id, "observable": false, "reason": reason }));
            continue;
        };
        let Found { value, sigma, .. } = found;
        let distance = reference.map(|r| quantity.distance(value, &r.value));
        let agrees = reference.is_some_and(|r| quantity.agree(found, r));
        let compared = match distance.map(|d| quantity.shown(d)) {
            Some(off) => format!("{off:>8}{}", if agrees { "" } else { " DIFFERS" }),
            // Nothing to compare with: what stands against it is the news.
            None => format!("\n  {reason}"),
        };
        let _ = writeln!(
            text,
            "{id:<16} {verdict:<4} {:<32} {:>8} {compared}",
            coordinates(value.as_slice()),
            quantity.shown(*sigma),
        );
        values.push(json!({
            "estimator": id,
            "observable": *verdict == "ok",
            "reason": reason,
            (quantity.key()): value.as_slice(),
            "sigma": sigma,
            "distance": distance,
            "agrees": agrees,
        }));
    }
    let observable = lines.iter().any(|l| l.verdict == "ok");
    answer(text, &Value::Array(values), observable)
}
