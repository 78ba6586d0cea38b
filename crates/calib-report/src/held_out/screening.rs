//! Gross outliers among held-out errors, by the gate of the fit made stricter.
//!
//! ```text
//! screened:  z² > χ²_rows(1 − 0.05/n) · max(1, median(z²/χ²_rows(½)))   and   |e| > 5 median|e|
//! ```
//!
//! The first is the gate that the fit applies to its own rows, with the inflation by the median, at a level that rejects
//! one good error of n in one validation of twenty. The second keeps what a wrong model looks like: its errors grow over
//! the workspace, they do not leave the others behind.

use calib_geometry::statistics::upper_median;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::PoseError;

/// Chance that any good error of a validation passes the gate.
const FAMILY: f64 = 0.05;
/// A gross outlier exceeds the median error by this factor, in position or orientation.
const GROSS: f64 = 5.0;
/// Fewer errors have no median to speak of.
const FEWEST: usize = 5;

/// Marks the gross outliers among errors whose prediction has a covariance.
pub fn screen(poses: &mut [PoseError]) {
    let quantile = |rows: usize, p: f64| {
        ChiSquared::new(rows as f64)
            .map_or(f64::INFINITY, |distribution| distribution.inverse_cdf(p))
    };
    let known = || poses.iter().filter_map(|pose| pose.distance);
    let n = known().count();
    if n < FEWEST {
        return;
    }
    let ratios = known().map(|d| d.z * d.z / quantile(d.rows, 0.5));
    let inflation = median(ratios.collect()).unwrap_or(1.0).max(1.0);
    let position = median(poses.iter().filter_map(|p| p.calibrated_m).collect());
    let angle = median(poses.iter().filter_map(|p| p.calibrated_rad).collect());
    let gross = |error: Option<f64>, median: Option<f64>| {
        error
            .zip(median)
            .is_some_and(|(error, median)| error > GROSS * median)
    };
    let mut gates = std::collections::BTreeMap::new();
    for pose in poses.iter_mut() {
        let Some(distance) = pose.distance else {
            continue;
        };
        let gate = *gates
            .entry(distance.rows)
            .or_insert_with(|| quantile(distance.rows, 1.0 - FAMILY / n as f64));
        pose.screened = distance.z * distance.z > gate * inflation
            && (gross(pose.calibrated_m, position) || gross(pose.calibrated_rad, angle));
    }
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    values.retain(|value| value.is_finite());
    upper_median(&mut values)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Distance;

    /// Errors of 1 mm, a third of each size, z as it should be.
    fn errors(n: usize) -> Vec<PoseError> {
        (0..n)
            .map(|i| {
                let z = 1.0 + (i % 3) as f64 * 0.5;
                PoseError {
                    pose: format!("checks:{i}"),
                    calibrated_m: Some(0.001 * z),
                    distance: Some(Distance { z, rows: 3 }),
                    ..PoseError::default()
                }
            })
            .collect()
    }

    fn screened(mut poses: Vec<PoseError>) -> usize {
        screen(&mut poses);
        poses.iter().filter(|pose| pose.screened).count()
    }

    #[test]
    fn a_gross_outlier_is_screened_and_good_errors_are_not() {
        assert_eq!(screened(errors(30)), 0);
        let mut poses = errors(30);
        poses[7].calibrated_m = Some(0.05);
        poses[7].distance = Some(Distance { z: 50.0, rows: 3 });
        assert_eq!(screened(poses), 1);
    }

    /// All errors twentyfold, as a wrong model shows them, and a tail of three times the others: nothing is hidden.
    #[test]
    fn a_wrong_model_is_not_screened() {
        let mut poses = errors(30);
        for (i, pose) in poses.iter_mut().enumerate() {
            let factor = if i < 3 { 60.0 } else { 20.0 };
            pose.calibrated_m = pose.calibrated_m.map(|m| m * factor);
            pose.distance = pose.distance.map(|d| Distance {
                z: d.z * factor,
                ..d
            });
        }
        assert_eq!(screened(poses), 0);
    }

    #[test]
    fn without_a_prediction_or_with_few_errors_nothing_is_screened() {
        let mut poses = errors(30);
        for pose in &mut poses {
            pose.distance = None;
        }
        poses[0].calibrated_m = Some(1.0);
        assert_eq!(screened(poses), 0);
        let mut few = errors(4);
        few[0].calibrated_m = Some(1.0);
        few[0].distance = Some(Distance { z: 1e3, rows: 3 });
        assert_eq!(screened(few), 0);
    }
}
