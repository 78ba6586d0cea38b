//! Reported transforms against the simulated truth.

#![allow(dead_code)]

use std::collections::BTreeMap;

use calib_geometry::se3;
use nalgebra::{Isometry3, Matrix6, Quaternion, Translation3, UnitQuaternion, Vector6};
use serde_json::Value;

/// 99 % of a χ² distribution with six degrees of freedom (any table).
pub const CHI2_99_SIX: f64 = 16.81;

/// `truth.json`: transforms by name.
pub struct Truth(BTreeMap<String, Isometry3<f64>>);

/// One reported transform: how far it is from the truth.
pub struct TransformError {
    pub name: String,
    /// `log(reported⁻¹ · true)`, `[ω; v]` of the child.
    pub xi: Vector6<f64>,
    /// `ξᵀ Σ⁻¹ ξ` with the reported covariance.
    pub chi2: f64,
    /// Directions that the report calls not observable.
    pub unobservable: Vec<Vector6<f64>>,
}

impl Truth {
    pub fn read(value: &Value) -> Self {
        let transforms = value["transforms"].as_object().expect("transforms");
        Self(
            transforms
                .iter()
                .map(|(name, t)| (name.clone(), pose(t)))
                .collect(),
        )
    }
}

impl TransformError {
    /// Norms of rotation (rad) and translation (m) of ξ without its part along `directions`.
    pub fn seen(&self, directions: &[Vector6<f64>]) -> (f64, f64) {
        let mut xi = self.xi;
        let mut basis: Vec<Vector6<f64>> = Vec::new();
        for direction in directions {
            let mut d = *direction;
            for b in &basis {
                d -= b * b.dot(&d);
            }
            if let Some(d) = d.try_normalize(1e-9) {
                xi -= d * d.dot(&xi);
                basis.push(d);
            }
        }
        (xi.fixed_rows::<3>(0).norm(), xi.fixed_rows::<3>(3).norm())
    }
}

/// The error of every transform of a report; the truth must have all of them.
pub fn errors(report: &Value, truth: &Truth) -> Vec<TransformError> {
    let transforms = report["transforms"].as_array().expect("transforms");
    let names: Vec<&str> = transforms
        .iter()
        .filter_map(|t| t["name"].as_str())
        .collect();
    for name in truth.0.keys() {
        assert!(
            names.contains(&name.as_str()),
            "{name} of the truth is not reported, only {names:?}"
        );
    }
    transforms
        .iter()
        .map(|t| {
            let name = t["name"].as_str().expect("a name").to_owned();
            let known = truth
                .0
                .get(&name)
                .unwrap_or_else(|| panic!("no truth for {name}"));
            let xi = se3::log(&(pose(t).inverse() * known)).0;
            let rows = t["covariance"]
                .as_array()
                .unwrap_or_else(|| panic!("{name} has no covariance"));
            let covariance = Matrix6::from_row_iterator(rows.iter().flat_map(numbers));
            let weighed = covariance
                .cholesky()
                .unwrap_or_else(|| panic!("{name}: the covariance is not positive definite"))
                .solve(&xi);
            TransformError {
                name,
                xi,
                chi2: xi.dot(&weighed),
                unobservable: t["unobservable"]
                    .as_array()
                    .expect("a list")
                    .iter()
                    .map(|u| Vector6::from_row_slice(&numbers(&u["direction"])))
                    .collect(),
            }
        })
        .collect()
}

fn pose(value: &Value) -> Isometry3<f64> {
    let (t, q) = (
        numbers(&value["translation_m"]),
        numbers(&value["rotation_xyzw"]),
    );
    let rotation = UnitQuaternion::from_quaternion(Quaternion::new(q[3], q[0], q[1], q[2]));
    Isometry3::from_parts(Translation3::new(t[0], t[1], t[2]), rotation)
}

fn numbers(value: &Value) -> Vec<f64> {
    value
        .as_array()
        .expect("numbers")
        .iter()
        .map(|v| v.as_f64().expect("a number"))
        .collect()
}
