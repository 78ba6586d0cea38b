//! Markers that were computed from a fitted body: they scatter about it by the rounding of what was written, and by nothing else.

use nalgebra::Point3;

/// No computed marker scatters by more, m per coordinate: software that fits bodies writes micrometers.
const MOST: f64 = 2e-6;
/// Numbers of single precision are rounded by less, m, within the volume of a tracker.
const LEAST: f64 = 3e-7;
/// Rounding to a step scatters by 0.29 of it; what a fit of four markers leaves of that, and chance, is below this part of it.
const OF_STEP: f64 = 0.7;
/// Markers scatter by more than this part of the noise that is stated of them.
const OF_STATED: f64 = 1.0 / 3.0;
/// Points that are asked for the step of their coordinates.
const POINTS: usize = 100;

/// Scatter of a marker's coordinate about its body, m, below which it was computed; `stated`: the noise of a coordinate, m.
#[must_use]
pub fn computed_below<'a>(
    seen: impl Iterator<Item = &'a Point3<f64>> + Clone,
    stated: Option<f64>,
) -> f64 {
    match stated {
        Some(sigma) => MOST.min(OF_STATED * sigma),
        None => {
            let step = decimal_grid(seen.take(POINTS)).unwrap_or(0.0);
            (OF_STEP * step).clamp(LEAST, MOST)
        }
    }
}

/// The coarsest 10⁻ᵏ m, k ≤ 7, of which all coordinates are multiples.
pub(crate) fn decimal_grid<'a>(seen: impl Iterator<Item = &'a Point3<f64>> + Clone) -> Option<f64> {
    (2..=7).map(|k| 10f64.powi(k)).find_map(|per_meter| {
        let on_grid = |x: &f64| ((x * per_meter).round() - x * per_meter).abs() < 1e-4;
        let mut points = seen.clone();
        let all = points.all(|point| point.iter().all(on_grid));
        all.then_some(1.0 / per_meter)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_step_of_what_was_written_tells_rounding_from_noise() {
        let written = |unit: f64| {
            (0..40).map(move |i| {
                let x = |k: f64| ((f64::from(i) * k).sin() / unit).round() * unit;
                Point3::new(x(0.3), x(0.7), x(1.1))
            })
        };
        let below = |unit: f64, stated| {
            let points: Vec<Point3<f64>> = written(unit).collect();
            computed_below(points.iter(), stated)
        };
        // Micrometers, as most software writes them, tenths of a millimeter, and all digits.
        assert!((below(1e-6, None) - 0.7e-6).abs() < 1e-12);
        assert!((below(1e-4, None) - 2e-6).abs() < 1e-12);
        assert!((below(1e-12, None) - 3e-7).abs() < 1e-12);
        // What is stated of the markers decides before what was written.
        assert!((below(1e-6, Some(3e-7)) - 1e-7).abs() < 1e-12);
        assert!((below(1e-12, Some(3e-4)) - 2e-6).abs() < 1e-12);
    }
}
