//! Residuals in units of their standard deviations against the normal distribution.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use statrs::distribution::{Continuous, ContinuousCDF, Normal};

/// Width of a bin of the histogram, in standard deviations.
pub(crate) const BIN: f64 = 0.5;

/// The histogram's bins go from minus to plus this many standard deviations; what lies beyond is counted in one more on each side.
pub(crate) const REACH: f64 = 4.0;

/// Quantiles that are kept between the tails.
const MIDDLE: usize = 40;

/// Of each tail every value is kept, up to this many.
const TAIL: usize = 10;

/// Decorrelated residuals of the fit, each in units of its own standard deviation: standard normal where model and noise are right.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Standardized {
    /// How many.
    pub n: usize,
    /// Mean; 0 where model and noise are right.
    pub mean: f64,
    /// Standard deviation; 1 where model and noise are right.
    pub std: f64,
    /// Counts in bins of 0.5 from −4 to 4; the first and the last count what lies beyond.
    pub counts: Vec<u64>,
    /// Quantiles of the standard normal distribution and of the residuals: all in the tails, a selection between them.
    pub quantiles: Vec<[f64; 2]>,
    /// Their tails, where they are heavier than those of normal noise beyond doubt; null where they are not.
    #[serde(default)]
    pub tails: Option<Tails>,
}

/// Student's t that describes the residuals, rejected ones included; normal noise has infinitely many degrees of freedom.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Tails {
    /// The likeliest degrees of freedom.
    pub degrees_of_freedom: f64,
    /// Least of the 95 % interval.
    pub least: f64,
    /// Largest of it.
    pub most: f64,
    /// Probability of so much evidence for heavy tails where the noise is normal.
    pub p_value: f64,
}

impl Standardized {
    /// Of standardized residuals; `None` when fewer than two are finite.
    #[must_use]
    pub fn of(residuals: &[f64]) -> Option<Self> {
        let normal = Normal::standard();
        let mut sorted: Vec<f64> = residuals
            .iter()
            .copied()
            .filter(|r| r.is_finite())
            .collect();
        sorted.sort_by(f64::total_cmp);
        let n = sorted.len();
        if n < 2 {
            return None;
        }
        let mean = sorted.iter().sum::<f64>() / n as f64;
        let squares: f64 = sorted.iter().map(|r| (r - mean).powi(2)).sum();
        let bins = (2.0 * REACH / BIN) as usize + 2;
        let mut counts = vec![0; bins];
        for r in &sorted {
            let place = ((r + REACH) / BIN).floor() + 1.0;
            counts[place.clamp(0.0, (bins - 1) as f64) as usize] += 1;
        }
        // Blom's plotting positions: unbiased for normal order statistics to 0.01 σ.
        let expected = |i: usize| normal.inverse_cdf((i as f64 + 0.625) / (n as f64 + 0.25));
        let quantiles = kept(n).into_iter().map(|i| [expected(i), sorted[i]]);
        Some(Self {
            n,
            mean,
            std: (squares / (n as f64 - 1.0)).sqrt(),
            counts,
            quantiles: quantiles.collect(),
            tails: None,
        })
    }

    /// The same with what was found of heavy tails.
    #[must_use]
    pub fn with_tails(self, tails: Option<Tails>) -> Self {
        Self { tails, ..self }
    }

    /// σ of the observed quantile where the normal one is `z`, for independent standard normal values.
    ///
    /// ```text
    /// σ² = p (1 − p) / (n φ(z)²),   p = Φ(z)
    /// ```
    #[must_use]
    pub(crate) fn quantile_sigma(&self, z: f64) -> f64 {
        let normal = Normal::standard();
        let p = normal.cdf(z);
        (p * (1.0 - p) / self.n as f64).sqrt() / normal.pdf(z)
    }

    /// Counts per bin that a standard normal distribution would give, as a curve over the middles of the bins.
    #[must_use]
    pub(crate) fn expected_count(&self, z: f64) -> f64 {
        self.n as f64 * BIN * Normal::standard().pdf(z)
    }
}

/// Ranks of the values that are kept: all of each tail, and as many between them as a picture needs.
fn kept(n: usize) -> Vec<usize> {
    if n <= 2 * TAIL + MIDDLE {
        return (0..n).collect();
    }
    let between = n - 2 * TAIL;
    let middle = (0..MIDDLE).map(|k| TAIL + (2 * k + 1) * between / (2 * MIDDLE));
    (0..TAIL).chain(middle).chain(n - TAIL..n).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal, StudentT};

    fn sample(n: usize, seed: u64) -> Vec<f64> {
        let rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        StandardNormal.sample_iter(rng).take(n).collect()
    }

    #[test]
    fn quantiles_of_the_normal_distribution_itself_lie_on_the_diagonal() {
        let normal = Normal::standard();
        for n in [2, 10, 60, 61, 5000] {
            let exact: Vec<f64> = (0..n)
                .map(|i| normal.inverse_cdf((f64::from(i) + 0.625) / (f64::from(n) + 0.25)))
                .collect();
            let found = Standardized::of(&exact).expect("finite values");
            assert_eq!(found.n, n as usize);
            for [expected, observed] in &found.quantiles {
                assert!(
                    (expected - observed).abs() < 1e-12,
                    "{n}: {expected} {observed}"
                );
            }
            let rising = found
                .quantiles
                .windows(2)
                .all(|pair| pair[0][0] < pair[1][0]);
            assert!(rising && found.quantiles.len() <= 2 * TAIL + MIDDLE);
            // Both tails are complete.
            assert_eq!(found.quantiles[0][1], exact[0]);
            assert_eq!(found.quantiles.last().map(|q| q[1]), exact.last().copied());
        }
    }

    #[test]
    fn of_normal_samples_one_quantile_in_twenty_leaves_its_band_and_of_heavy_tails_most_of_the_tail()
     {
        let outside = |residuals: &[f64]| {
            let found = Standardized::of(residuals).expect("finite values");
            let out = |q: &&[f64; 2]| (q[1] - q[0]).abs() > 2.0 * found.quantile_sigma(q[0]);
            let out = found.quantiles.iter().filter(out).count();
            out as f64 / found.quantiles.len() as f64
        };
        let normal: f64 = (0..40)
            .map(|seed| outside(&sample(2000, seed)))
            .sum::<f64>()
            / 40.0;
        assert!((0.01..0.12).contains(&normal), "{normal}");
        let rng = rand_chacha::ChaCha8Rng::seed_from_u64(1);
        let heavy = StudentT::new(3.0).expect("three degrees of freedom");
        let heavy: Vec<f64> = heavy.sample_iter(rng).take(2000).collect();
        assert!(outside(&heavy) > 0.5, "{}", outside(&heavy));
    }

    #[test]
    fn every_value_is_counted_once_and_in_its_bin() {
        let found = Standardized::of(&[-9.0, -4.0, -0.1, 0.0, 0.4, 3.99, 4.0, 7.0, f64::NAN]);
        let found = found.expect("eight values");
        assert_eq!((found.n, found.counts.iter().sum::<u64>()), (8, 8));
        assert_eq!((found.counts.len(), found.counts[0]), (18, 1));
        assert_eq!((found.counts[8], found.counts[9]), (1, 2));
        assert_eq!((found.counts[16], found.counts[17]), (1, 2));
        assert_eq!(Standardized::of(&[f64::NAN, 1.0]), None);
    }

    #[test]
    fn counts_of_a_normal_sample_follow_the_curve() {
        let found = Standardized::of(&sample(20_000, 3)).expect("finite values");
        assert!(found.mean.abs() < 0.03 && (found.std - 1.0).abs() < 0.03);
        // χ² of the 12 bins within ±3 against the area of each: below the 99.9 % quantile, 32.9.
        let normal = Normal::standard();
        let chi2: f64 = (0..12)
            .map(|i| {
                let from = -3.0 + BIN * f64::from(i);
                let expected = 20_000.0 * (normal.cdf(from + BIN) - normal.cdf(from));
                let middle = found.expected_count(from + 0.5 * BIN);
                assert!(
                    (middle / expected - 1.0).abs() < 0.12,
                    "the curve is the area: {middle} {expected}"
                );
                (found.counts[3 + i as usize] as f64 - expected).powi(2) / expected
            })
            .sum();
        assert!(chi2 < 32.9, "{chi2}");
    }
}
