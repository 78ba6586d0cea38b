//! Medians.

/// The median (mean of the middle two); `None` of nothing.
pub(crate) fn median(mut values: Vec<f64>) -> Option<f64> {
    if values.is_empty() {
        return None;
    }
    values.sort_by(f64::total_cmp);
    let n = values.len();
    Some(0.5 * (values[(n - 1) / 2] + values[n / 2]))
}

/// σ of a Gaussian from the median absolute deviation about `centre`.
pub(crate) fn robust_sigma(values: impl Iterator<Item = f64>, centre: f64) -> Option<f64> {
    // 1 / Φ⁻¹(3/4)
    median(values.map(|value| (value - centre).abs()).collect()).map(|mad| 1.4826 * mad)
}

/// Smallest and largest.
pub(crate) fn range(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    values.fold(None, |range, value| match range {
        None => Some((value, value)),
        Some((low, high)) => Some((low.min(value), high.max(value))),
    })
}
