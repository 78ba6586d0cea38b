//! Is one robot better than another on the same poses? A paired, one-sided test over postures.
//!
//! ```text
//! d_i = (mean square with registration only) − (mean square calibrated), of posture i
//! W⁺ = Σ rank|d_i| over d_i > 0          (Wilcoxon's signed ranks)
//! p_better = P(W⁺ as large | no difference),  p_worse = P(W⁺ as small | no difference)
//! ```
//!
//! Postures count, not errors: the errors of one posture share its error. Ranks need no distribution of the errors.

use std::collections::BTreeMap;

use statrs::distribution::{ContinuousCDF, Normal};

use crate::HeldOut;

/// What is compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// Positions.
    Position,
    /// Orientations.
    Orientation,
}

/// Calibrated against registration only.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Improvement {
    /// What is compared.
    pub quantity: Quantity,
    /// rms with registration only, m or rad.
    pub registration: f64,
    /// rms calibrated, m or rad.
    pub calibrated: f64,
    /// Postures that were compared.
    pub postures: usize,
    /// Probability of so clear an improvement if there were none.
    pub p_better: f64,
    /// Probability of so clear a deterioration if there were none.
    pub p_worse: f64,
}

/// Squared errors of one posture: registration, calibrated, how many.
type Sums = (f64, f64, f64);

impl Improvement {
    /// Of every quantity that was measured with both robots; screened errors do not count.
    #[must_use]
    pub fn of(held_out: &HeldOut) -> Vec<Self> {
        [Quantity::Position, Quantity::Orientation]
            .into_iter()
            .filter_map(|quantity| Self::of_quantity(held_out, quantity))
            .collect()
    }

    fn of_quantity(held_out: &HeldOut, quantity: Quantity) -> Option<Self> {
        let mut postures: BTreeMap<&str, Sums> = BTreeMap::new();
        for error in held_out.poses.iter().filter(|error| !error.screened) {
            let pair = match quantity {
                Quantity::Position => (error.registration_only_m, error.calibrated_m),
                Quantity::Orientation => (error.registration_only_rad, error.calibrated_rad),
            };
            if let (Some(registration), Some(calibrated)) = pair
                && registration.is_finite()
                && calibrated.is_finite()
            {
                let sums = postures.entry(&error.pose).or_default();
                sums.0 += registration * registration;
                sums.1 += calibrated * calibrated;
                sums.2 += 1.0;
            }
        }
        let n: f64 = postures.values().map(|s| s.2).sum();
        if n == 0.0 {
            return None;
        }
        let rms = |part: fn(&Sums) -> f64| (postures.values().map(part).sum::<f64>() / n).sqrt();
        let differences: Vec<f64> = postures.values().map(|s| (s.0 - s.1) / s.2).collect();
        let (p_better, p_worse) = signed_ranks(&differences);
        Some(Self {
            quantity,
            registration: rms(|s| s.0),
            calibrated: rms(|s| s.1),
            postures: postures.len(),
            p_better,
            p_worse,
        })
    }
}

/// Postures up to which every combination of signs is counted; beyond it W⁺ is normal to three digits.
const EXACT: usize = 30;

/// (P(W⁺ or more), P(W⁺ or less)) if differences were as likely positive as negative; zeros say nothing.
fn signed_ranks(differences: &[f64]) -> (f64, f64) {
    signed_ranks_by(differences, EXACT)
}

/// The same, every combination of signs counted up to `exact` differences.
fn signed_ranks_by(differences: &[f64], exact: usize) -> (f64, f64) {
    let mut sorted: Vec<f64> = differences.iter().copied().filter(|d| *d != 0.0).collect();
    sorted.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
    let n = sorted.len();
    if n == 0 {
        return (1.0, 1.0);
    }
    // Twice the ranks, so that the mean rank of a tie is a whole number.
    let mut ranks = vec![0_usize; n];
    let mut first = 0;
    while first < n {
        let mut last = first;
        while last + 1 < n && sorted[last + 1].abs() == sorted[first].abs() {
            last += 1;
        }
        ranks[first..=last].fill(first + last + 2);
        first = last + 1;
    }
    let positive: usize = (0..n).filter(|i| sorted[*i] > 0.0).map(|i| ranks[i]).sum();
    if n > exact {
        let mean = ranks.iter().sum::<usize>() as f64 / 2.0;
        let variance = ranks.iter().map(|r| (r * r) as f64).sum::<f64>() / 4.0;
        let normal = Normal::standard();
        // Half a rank towards the mean: W⁺ is discrete.
        let z = |shift: f64| (positive as f64 + shift - mean) / variance.sqrt();
        return (normal.sf(z(-1.0)), normal.cdf(z(1.0)));
    }
    // ways[w]: share of the 2ⁿ choices of signs with W⁺ = w
    let all: usize = ranks.iter().sum();
    let mut ways = vec![0.0; all + 1];
    ways[0] = 1.0;
    for rank in &ranks {
        for w in (0..=all).rev() {
            let with = if w >= *rank { ways[w - rank] } else { 0.0 };
            ways[w] = 0.5 * (ways[w] + with);
        }
    }
    (
        ways[positive..].iter().sum(),
        ways[..=positive].iter().sum(),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::PoseError;

    fn held_out(pairs: &[(f64, f64)]) -> HeldOut {
        let poses = pairs.iter().enumerate().flat_map(|(i, pair)| {
            // Two markers per posture: postures count, not markers.
            ["a", "b"].map(|subject| PoseError {
                pose: format!("checks:{i}"),
                subject: subject.into(),
                registration_only_m: Some(pair.0),
                calibrated_m: Some(pair.1),
                ..PoseError::default()
            })
        });
        HeldOut::from_poses("", poses.collect())
    }

    /// p of Wilcoxon's table: five differences of one sign are as likely as 1 of 32.
    #[test]
    fn signed_ranks_by_hand() {
        let (better, worse) = signed_ranks(&[1.0, 2.0, 3.0, 4.0, 5.0]);
        assert!((better - 1.0 / 32.0).abs() < 1e-15 && (worse - 1.0).abs() < 1e-15);
        let (better, worse) = signed_ranks(&[-1.0, 2.0, 3.0]);
        assert!((better - 2.0 / 8.0).abs() < 1e-15, "{better}");
        assert!((worse - 7.0 / 8.0).abs() < 1e-15, "{worse}");
        assert_eq!(signed_ranks(&[0.0, 0.0]), (1.0, 1.0));
    }

    #[test]
    fn exact_and_normal_agree_where_they_meet() {
        let differences: Vec<f64> = (1..=31)
            .map(|i| f64::from(i) * if i % 3 == 0 { -1.0 } else { 1.0 })
            .collect();
        let exact = signed_ranks_by(&differences, 31);
        let normal = signed_ranks_by(&differences, 0);
        assert!((exact.0 - normal.0).abs() < 0.003, "{exact:?} {normal:?}");
        assert!((exact.1 - normal.1).abs() < 0.003, "{exact:?} {normal:?}");
    }

    #[test]
    fn postures_are_compared_not_markers() {
        let of = |pairs: &[(f64, f64)]| Improvement::of(&held_out(pairs))[0];
        let better = of(&[(2.0, 1.0); 6]);
        assert!(better.p_better < 0.05 && better.p_worse > 0.9);
        assert_eq!(
            (better.postures, better.registration, better.calibrated),
            (6, 2.0, 1.0)
        );
        // Four postures can never be significant, however many markers they have.
        assert!(of(&[(2.0, 1.0); 4]).p_better > 0.05);
        assert!(of(&[(1.0, 2.0); 6]).p_worse < 0.05);
        assert!(Improvement::of(&HeldOut::default()).is_empty());
    }
}
