//! Robust spreads and ranges.

pub(crate) use calib_geometry::statistics::median;

/// σ of a Gaussian from the median absolute deviation about `center`.
pub(crate) fn robust_sigma(values: impl Iterator<Item = f64>, center: f64) -> Option<f64> {
    // 1 / Φ⁻¹(3/4)
    median(values.map(|value| (value - center).abs()).collect()).map(|mad| 1.4826 * mad)
}

/// Smallest and largest.
pub(crate) fn range(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    values.fold(None, |range, value| match range {
        None => Some((value, value)),
        Some((low, high)) => Some((low.min(value), high.max(value))),
    })
}

/// What the difference of two means of `n` samples each stays below, for noise σ per coordinate: eight σ of the
/// difference's length.
pub(crate) fn robust_range_limit(sigma: f64, n: usize) -> f64 {
    8.0 * sigma * (2.0 * 3.0 / n.max(1) as f64).sqrt()
}
