//! What the trials say of one quantity.
//!
//! ```text
//! promised = √mean σ_k²,   reached = √mean e_k²,   ratio = promised / reached                                  (1)
//! σ(ratio)/ratio = ½ √(var e²/(mean e²)² + var σ²/(mean σ²)²)/√N                                             (2)
//! ```

use std::collections::BTreeMap;

use calib_finding::Unit;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::quantity::{Off, Quantity};
use crate::trial::Done;

/// What was promised and reached of one quantity.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Promise {
    /// The quantity.
    pub of: Quantity,
    /// Unit of what follows.
    pub unit: Unit,
    /// σ that the session's own calibration states; null: it does not state it.
    pub stated: Option<f64>,
    /// Trials that state it.
    pub trials: usize,
    /// Root mean square σ.
    pub promised: f64,
    /// Root mean square error.
    pub reached: f64,
    /// Equation (1).
    pub ratio: f64,
    /// Its σ, from the number of trials.
    pub ratio_sigma: f64,
    /// Share of the 95 % intervals that hold the truth.
    pub coverage: f64,
    /// Mean error; null for positions, whose error has no sign.
    pub bias: Option<f64>,
    /// Its σ, from the number of trials.
    pub bias_sigma: Option<f64>,
    /// Share of what is known that the data give, not the prior.
    pub by_data: f64,
}

/// σ that is within so much of what is reached is kept.
pub const KEPT: f64 = 0.15;
/// Shares of the data from which a quantity counts as observed.
pub const OBSERVED: f64 = 0.5;

impl Promise {
    /// Whether the data decide it, rather than the prior.
    #[must_use]
    pub fn is_observed(&self) -> bool {
        self.by_data >= OBSERVED
    }

    /// Whether σ is within 15 % of what was reached.
    #[must_use]
    pub fn is_kept(&self) -> bool {
        (self.ratio - 1.0).abs() <= KEPT
    }

    /// Whether σ is further off than 15 % beyond what so few trials explain.
    #[must_use]
    pub fn is_broken(&self) -> bool {
        /// Standard deviations: of a hundred quantities one is further off by chance in three reports of ten.
        const CERTAIN: f64 = 3.0;
        (self.ratio - 1.0).abs() > KEPT + CERTAIN * self.ratio_sigma
    }

    /// Whether the mean error is beyond chance.
    #[must_use]
    pub fn is_biased(&self) -> bool {
        /// As [`Promise::is_broken`], for a hundred quantities.
        const CERTAIN: f64 = 4.0;
        let of = self.bias.zip(self.bias_sigma);
        of.is_some_and(|(bias, sigma)| bias.abs() > CERTAIN * sigma)
    }
}

/// Mean, and variance of one over the squared mean.
fn moments(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
    (mean, variance / (mean * mean).max(f64::MIN_POSITIVE))
}

/// Equations (1) and (2) of every quantity that at least half of the trials state.
#[must_use]
pub fn promises(session: &[Off], trials: &[&Done]) -> Vec<Promise> {
    let mut of: BTreeMap<&Quantity, Vec<&Off>> = BTreeMap::new();
    for off in trials.iter().flat_map(|t| &t.off) {
        of.entry(&off.of).or_default().push(off);
    }
    let enough = |all: &Vec<&Off>| 2 * all.len() >= trials.len();
    let known = of.into_iter().filter(|(_, all)| enough(all));
    known.map(|(of, all)| promise(of, session, &all)).collect()
}

fn promise(of: &Quantity, session: &[Off], all: &[&Off]) -> Promise {
    let n = all.len() as f64;
    let column = |value: &dyn Fn(&Off) -> f64| all.iter().map(|o| value(o)).collect::<Vec<_>>();
    let (squares, spread) = moments(&column(&|o| o.error * o.error));
    let (variances, of_sigma) = moments(&column(&|o| o.sigma * o.sigma));
    let ratio = (variances / squares.max(f64::MIN_POSITIVE)).sqrt();
    let mean = column(&|o| o.error).iter().sum::<f64>() / n;
    let signed = !matches!(of, Quantity::Position { .. });
    Promise {
        of: of.clone(),
        unit: all[0].unit,
        stated: session.iter().find(|o| o.of == *of).map(|o| o.sigma),
        trials: all.len(),
        promised: variances.sqrt(),
        reached: squares.sqrt(),
        ratio,
        ratio_sigma: 0.5 * ratio * ((spread + of_sigma) / n).sqrt(),
        coverage: moments(&column(&|o| o.covered)).0,
        bias: signed.then_some(mean),
        bias_sigma: signed.then(|| ((squares - mean * mean).max(0.0) / n).sqrt()),
        by_data: moments(&column(&|o| o.by_data)).0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_distr::StandardNormal;

    fn trials(sigma: f64, n: usize, seed: u64) -> Vec<Done> {
        let mut rng = rand_chacha::ChaCha12Rng::seed_from_u64(seed);
        let one = |_| {
            let error: f64 = rng.sample(StandardNormal);
            Done {
                converged: true,
                off: vec![Off {
                    of: Quantity::Parameter {
                        name: "a".to_owned(),
                    },
                    unit: Unit::Radian,
                    error,
                    sigma,
                    covered: f64::from(u8::from(error.abs() < 1.96 * sigma)),
                    by_data: 1.0,
                }],
                likeness: crate::likeness::Likeness::default(),
                tests: Vec::new(),
                alarm: false,
            }
        };
        (0..n).map(one).collect()
    }

    #[test]
    fn a_right_sigma_is_kept_and_a_wrong_one_broken() {
        for (sigma, broken) in [(1.0, false), (0.5, true), (2.0, true)] {
            let all = trials(sigma, 200, 7);
            let all: Vec<&Done> = all.iter().collect();
            let found = &promises(&[], &all)[0];
            assert_eq!(found.is_broken(), broken, "{found:?}");
            // 5 %: 1/√(2 · 200).
            assert!((found.ratio_sigma / found.ratio - 0.05).abs() < 0.015);
            assert!(!found.is_biased());
        }
    }

    #[test]
    fn the_error_of_the_ratio_is_as_stated() {
        let z: Vec<f64> = (0..400)
            .map(|seed| {
                let all = trials(1.0, 100, seed);
                let all: Vec<&Done> = all.iter().collect();
                let found = &promises(&[], &all)[0];
                (found.ratio - 1.0) / found.ratio_sigma
            })
            .collect();
        let mean = z.iter().sum::<f64>() / 400.0;
        let sd = (z.iter().map(|z| (z - mean).powi(2)).sum::<f64>() / 399.0).sqrt();
        assert!((sd - 1.0).abs() < 0.15 && mean.abs() < 0.25, "{mean} {sd}");
    }
}
