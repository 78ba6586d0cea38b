//! What both problems share: symmetric 3 × 3 solves, medians, the weight of a distance.

use calib_geometry::decompose::symmetric_eigen_small;
use nalgebra::{Matrix3, Vector3};

/// A step this small, relative to the size of the data, changes no digit that a tracker measures.
pub const SETTLED: f64 = 1e-12;

/// σ of the weakest direction as a part of the radius, above which the verdict is weak: as the built-in estimators.
pub const WEAK_FRACTION: f64 = 0.1;

/// Smoothing of the distance, relative to the median distance: `|d| ≈ √(d² + ε²)`, near enough to have the same
/// minimum to a thousandth of the noise, and far enough from zero that the weights stay comparable.
pub const SMOOTHING: f64 = 1e-3;

/// The median; 0 for nothing.
pub fn median(values: &[f64]) -> f64 {
    quantile(values, 0.5)
}

/// The value below which this part of the values lies; 0 for nothing.
pub fn quantile(values: &[f64], part: f64) -> f64 {
    let mut sorted = values.to_vec();
    if sorted.is_empty() {
        return 0.0;
    }
    let place = ((sorted.len() as f64 * part) as usize).min(sorted.len() - 1);
    *sorted.select_nth_unstable_by(place, f64::total_cmp).1
}

/// `A⁻¹`, eigenvalue by eigenvalue; `None` when one is not positive.
pub fn inverse(a: &Matrix3<f64>) -> Option<Matrix3<f64>> {
    let eigen = symmetric_eigen_small(a);
    if eigen.values.iter().any(|v| !(v.is_finite() && *v > 0.0)) {
        return None;
    }
    let inverse = Matrix3::from_diagonal(&Vector3::from_fn(|i, _| 1.0 / eigen.values[i]));
    Some(eigen.vectors * inverse * eigen.vectors.transpose())
}

/// Square root of the largest eigenvalue.
pub fn largest_sigma(covariance: &Matrix3<f64>) -> f64 {
    symmetric_eigen_small(covariance).values[2].max(0.0).sqrt()
}

/// Rows of a matrix.
pub fn rows(matrix: &Matrix3<f64>) -> [[f64; 3]; 3] {
    // Symmetric to the last bit, whatever the products rounded to.
    std::array::from_fn(|i| std::array::from_fn(|j| 0.5 * (matrix[(i, j)] + matrix[(j, i)])))
}
