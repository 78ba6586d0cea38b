//! Bodies of two markers: with one distance, only its own rows show whether it changes.

use calib_finding::{Fact, Finding, Severity, Subject, catalog};
use calib_recording::Poses;

use super::{BENDING, SIGMAS, SMALLEST_FAULT, distances};
use crate::statistics::{median, robust_sigma};

/// Fewer rows do not tell a distance that changes from one that is noisy.
const ROWS: usize = 12;

/// The smaller of two scatters, each from n rows, is below σ: by up to 1 + this over n.
const FEW_ROWS: f64 = 8.0;
/// Where a tenth of each marker's samples are gross, a fifth of the distances is, which the fit leaves out: more than this part is no outliers.
const MOST_OUTLIERS: f64 = 0.3;
/// Means of a third of the rows differ by less than this many σ of a row, unless something slides.
const SLID: f64 = 4.0;
/// Refraction and calibration do not change a distance by more from place to place, m.
const DISTORTION: f64 = 1e-3;

/// That the distance of two markers is another one in many rows, or changes slowly. Its noise is the scatter about the median, or that from row to
/// row, whichever is less.
pub(super) fn changes(name: &str, markers: &[String], poses: &Poses) -> Option<Finding> {
    let [first, second] = markers else {
        return None;
    };
    let track = |marker: &String| Some(poses.markers.get(marker)?.as_slice());
    let series: Vec<f64> = distances(track(first)?, track(second)?)
        .map(|(_, d)| d)
        .collect();
    if series.len() < ROWS {
        return None;
    }
    let middle = median(series.clone())?;
    let about = robust_sigma(series.iter().copied(), middle)?;
    let steps = series.windows(2).map(|pair| pair[1] - pair[0]);
    let between = robust_sigma(steps, 0.0)? / std::f64::consts::SQRT_2;
    let rows = series.len() as f64;
    let sigma = about.min(between) * (1.0 + FEW_ROWS / rows);
    let tolerance = (SIGMAS * sigma).max(SMALLEST_FAULT);
    let off = series.iter().filter(|d| (*d - middle).abs() > tolerance);
    let off = off.count();
    // One that slides is at another place at the end than at the beginning.
    let third = series.len() / 3;
    let [start, end] = [&series[..third], &series[series.len() - third..]];
    let slid = (median(end.to_vec())? - median(start.to_vec())?).abs();
    let slides = slid > (SLID * sigma).max(DISTORTION);
    let [low, high] = [f64::min, f64::max].map(|f| series.iter().copied().fold(middle, f));
    let share = off as f64 / rows;
    let (off, severity) = match (share >= MOST_OUTLIERS || slides, share >= BENDING) {
        (true, many) => (if many { off } else { series.len() }, Severity::Error),
        (false, true) => (off, Severity::Warning),
        (false, false) => return None,
    };
    let [first, second] = [first, second].map(Fact::name);
    Some(
        Finding::of_kind(catalog::NOT_RIGID, "bends", Subject::body(name))
            .with_severity(severity)
            .with("first", first)
            .with("second", second)
            .with("range", Fact::meters(high - low))
            .with("rows", Fact::count(off)),
    )
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;

    /// Forty rows of two markers, `extra` meters more between them in row k; noise of 0.3 mm per coordinate, where 3 % of them have five times that.
    fn found(seed: u64, extra: &dyn Fn(usize) -> f64) -> Option<Finding> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut noise = || {
            let x: f64 = StandardNormal.sample(&mut rng);
            let y: f64 = StandardNormal.sample(&mut rng);
            if y > 1.88 { 1.5e-3 * x } else { 3e-4 * x }
        };
        let mut poses = Poses {
            rows: (1..=40).collect(),
            ..Poses::default()
        };
        for k in 0..40 {
            let mut at = |x: f64| Point3::new(x + noise(), 0.5 + noise(), 0.2 + noise());
            let (a, b) = (at(0.0), at(0.072 + extra(k)));
            poses
                .markers
                .entry("a".to_owned())
                .or_default()
                .push(Some(a));
            poses
                .markers
                .entry("b".to_owned())
                .or_default()
                .push(Some(b));
        }
        changes("hand", &["a".to_owned(), "b".to_owned()], &poses)
    }

    #[test]
    fn a_distance_that_changes_is_no_noise() {
        for seed in 0..100 {
            assert_eq!(found(seed, &|_| 0.0), None, "{seed}: clean");
            // Two rows that are off are for the fit, which leaves them out.
            let outliers = found(seed, &|k| if k % 20 == 7 { 0.02 } else { 0.0 });
            assert_eq!(outliers, None, "{seed}: outliers");
            let ghost = found(seed, &|k| if k % 3 == 0 { 0.02 } else { 0.0 });
            assert!(
                ghost.is_some(),
                "{seed}: a reflection in a third of the rows"
            );
            let slides = found(seed, &|k| -0.008 * k as f64 / 40.0);
            assert!(slides.is_some(), "{seed}: a marker that slides by 8 mm");
        }
    }
}
