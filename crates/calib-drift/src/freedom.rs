//! Degrees of freedom of a comparison: each calibration found its own noise, from its own number of residuals.
//!
//! ```text
//! S = S₁ + S₂, w_i: eigenvalues of S₁ S⁻¹:
//! ν = (p² + p) / [ ((Σ w)² + Σ w²) / ν₁ + ((Σ 1−w)² + Σ (1−w)²) / ν₂ ]                                   (3)
//! ```
//!
//! ν_k: degrees of freedom of the noise of calibration k. For one number (p = 1) this is Welch and Satterthwaite,
//! `ν = (v₁ + v₂)² / (v₁²/ν₁ + v₂²/ν₂)` (Welch 1947, Biometrika 34, 28–35; Satterthwaite 1946); for several it follows Nel and van der Merwe
//! (1986, Commun. Stat. Theory Methods 15, 3719–3735) in the form of Krishnamoorthy and Yu (2004) that no change of units or axes alters. It
//! lies between the smaller ν_k and their sum, which it is where both know the quantity equally well.
//!
//! The shares w follow from the noises that were found. Where the noise that is known worse was found too small, its share is too small and ν too
//! large just when the distance is: with 7 and 53 degrees and p = 4, 1.7 % of the distances exceed the limit of 1 %. So its share counts as large
//! as it is 1.5 standard errors above its estimate, `log (w / (1 − w)) + 1.5 √(2/ν₁ + 2/ν₂)`; then 0.7 to 1.1 % exceed it, from 7 degrees up.

use calib_report::{DataInformation, Noise, NoiseKind, Report};

/// Standard errors by which the share of the noise that is known worse is raised.
const RAISED: f64 = 1.5;

/// Equation (3); `shares`: the w_i of the first calibration, one for each of the p directions. 1 at least.
pub(crate) fn combined(shares: &[f64], first: f64, second: f64) -> f64 {
    let (first, second) = (first.max(1.0), second.max(1.0));
    let error = RAISED * (2.0 / first + 2.0 / second).sqrt();
    let towards_worse = match first.total_cmp(&second) {
        std::cmp::Ordering::Less => error,
        std::cmp::Ordering::Equal => 0.0,
        std::cmp::Ordering::Greater => -error,
    };
    let raised = shares.iter().map(|w| {
        let w = w.clamp(0.0, 1.0);
        // w e^x / (w e^x + 1 − w)
        let odds = w * towards_worse.exp();
        odds / (odds + 1.0 - w)
    });
    let sums = |w: &dyn Fn(f64) -> f64| {
        let (sum, squares) = raised
            .clone()
            .map(w)
            .fold((0.0, 0.0), |(s, q), w| (s + w, q + w * w));
        sum * sum + squares
    };
    let p = shares.len() as f64;
    let uncertain = sums(&|w| w) / first + sums(&|w| 1.0 - w) / second;
    ((p * p + p) / uncertain).max(1.0)
}

/// Degrees of freedom of the noise: with levels of their own, the level that is known worst decides how heavy the tails are.
///
/// A level of the joints with share w of the noise of a pose has the relative error 1/(w √(2n)) from n poses, so that w²/ν, what it adds to
/// 1/ν of the whole (Welch and Satterthwaite), is 1/n whatever its share: it counts with half its poses at least.
pub(crate) fn degrees_of_freedom(info: &DataInformation, report: &Report) -> f64 {
    let choice = report.noise_choice.as_ref();
    let poses = choice.map_or(0, |choice| choice.poses);
    let of = |noise: &Noise| of_level(noise.kind, noise.relative_error?, poses);
    let levels = report.noise.iter().filter_map(of);
    levels.fold(info.degrees_of_freedom, f64::min)
}

/// Degrees of freedom of a level of this relative error from so many poses; `None` where the level does not count.
fn of_level(kind: NoiseKind, error: f64, poses: usize) -> Option<f64> {
    /// A level of the joints whose relative error is larger is nothing beside the others: nobody could see it.
    const NOTHING: f64 = 0.5;
    // σ̂ of ν degrees has the relative error 1 / √(2ν).
    let own = 0.5 / error.powi(2);
    match kind {
        _ if error <= 0.0 => None,
        NoiseKind::Joint | NoiseKind::Slide if error >= NOTHING => None,
        NoiseKind::Joint | NoiseKind::Slide => Some(own.max(0.5 * poses as f64)),
        _ => Some(own),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_small_level_of_the_joints_counts_with_half_its_poses() {
        // 45 % from 320 poses: 2.4 degrees of its own.
        assert_eq!(of_level(NoiseKind::Joint, 0.4537, 320), Some(160.0));
        let position = of_level(NoiseKind::Position, 0.4537, 320).expect("counts");
        assert!((position - 2.43).abs() < 0.01, "{position}");
        // That from which all of a pose's noise comes: √(1/(2n)) from n poses.
        let error = (0.5_f64 / 12.0).sqrt();
        let large = of_level(NoiseKind::Slide, error, 12).expect("counts");
        assert!((large - 12.0).abs() < 1e-9, "{large}");
        assert_eq!(of_level(NoiseKind::Joint, 0.51, 320), None);
        assert_eq!(of_level(NoiseKind::Position, 0.0, 320), None);
    }

    #[test]
    fn it_lies_between_the_smaller_and_the_sum() {
        assert!((combined(&[0.5], 20.0, 20.0) - 40.0).abs() < 1e-9);
        assert!((combined(&[0.5; 4], 30.0, 30.0) - 60.0).abs() < 1e-9);
        // Welch 1947: variances 3 and 1.
        assert!((combined(&[0.75], 9.0, 9.0) - 16.0 / (9.0 / 9.0 + 1.0 / 9.0)).abs() < 1e-9);
        // One side's noise alone decides.
        assert!((combined(&[1.0; 2], 7.0, 500.0) - 7.0).abs() < 1e-9);
        assert!((combined(&[0.0; 2], 7.0, 500.0) - 500.0).abs() < 1e-9);
        for w in [0.1, 0.5, 0.9] {
            let nu = combined(&[w, 0.5], 12.0, 30.0);
            assert!(nu > 12.0 && nu < 42.0, "{nu}");
            // The share of the noise that is known worse counts more; which side is called the first does not matter.
            let welch = 1.0 / (w * w / 12.0 + (1.0 - w) * (1.0 - w) / 30.0);
            let one = combined(&[w], 12.0, 30.0);
            assert!(w < 0.2 || one < welch, "{w}: {one} {welch}");
            assert!((one - combined(&[1.0 - w], 30.0, 12.0)).abs() < 1e-9);
        }
    }
}
