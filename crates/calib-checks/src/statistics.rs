//! Robust spreads and ranges.

use std::ops::RangeInclusive;

use calib_geometry::statistics::SIGMA_PER_MAD;
pub(crate) use calib_geometry::statistics::median;

/// σ of a Gaussian from the median absolute deviation about `center`.
pub(crate) fn robust_sigma(values: impl Iterator<Item = f64>, center: f64) -> Option<f64> {
    let off = values.map(|value| (value - center).abs()).collect();
    median(off).map(|mad| SIGMA_PER_MAD * mad)
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

/// The coarsest 10⁻ᵏ m, k from 2 to 5, of which all coordinates are multiples: positions were rounded to it when they were written. 0 where
/// there is none, or finer: a step below 10 µm is below every tracker's noise.
pub(crate) fn written_step(coordinates: impl Iterator<Item = f64> + Clone) -> f64 {
    step_of(coordinates, 2..=5)
}

/// The coarsest 10⁻ᵏ of these of which all values are multiples; 0 where there is none, and without values.
pub(crate) fn step_of(
    values: impl Iterator<Item = f64> + Clone,
    decimals: RangeInclusive<i32>,
) -> f64 {
    let on_grid = |x: f64, per_unit: f64| ((x * per_unit).round() - x * per_unit).abs() < 1e-4;
    if values.clone().next().is_none() {
        return 0.0;
    }
    let found = decimals
        .map(|k| 10f64.powi(k))
        .find(|per_unit| values.clone().all(|x| on_grid(x, *per_unit)));
    found.map_or(0.0, f64::recip)
}

#[cfg(test)]
mod tests {
    use super::written_step;

    #[test]
    fn the_step_is_the_coarsest_of_which_all_are_multiples() {
        let values = [0.1234, -1.2, 0.0, 7.0001];
        assert_eq!(written_step(values.iter().copied()), 1e-4);
        assert_eq!(written_step([0.12345].into_iter()), 1e-5);
        assert_eq!(written_step([0.123_456].into_iter()), 0.0);
        assert_eq!(written_step(std::iter::empty()), 0.0);
        // 12.3 mm, read as mm.
        assert_eq!(written_step([12.3 * 1e-3, 100.1 * 1e-3].into_iter()), 1e-4);
    }
}
