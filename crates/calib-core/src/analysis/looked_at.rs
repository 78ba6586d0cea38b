//! Which samples of long recordings tests look at, and a fit begins with.
//!
//! Tests of what the fit does not model need no more samples than tell what matters: 4 096 of them, half before and half after a slip, show it
//! from a fifth of the noise of one sample on, and with an effect that explains 2 % of χ², the least that counts, z² is above 200. A recording is cut
//! into blocks of equal length and one sample of each is taken, at a place that follows no pattern: a stride would see only one posture of a
//! motion that repeats with it. Which samples are taken does not depend on the residuals, so that every test is exact for those it looks at.

use std::collections::BTreeSet;

use crate::analysis::solution::Solution;
use crate::model::layout::Model;

/// Samples that tests look at, at most; fewer are all looked at.
const MOST: usize = 4096;

/// Poses that statements of the noise are fitted to and tried on at most, evenly over all.
const POSES: usize = 200;

/// Samples that are looked at, in their order.
pub(crate) struct LookedAt {
    pub samples: Vec<usize>,
    /// How many samples of its recording each stands for.
    pub factors: Vec<f64>,
    /// Whether no sample is left out.
    pub all: bool,
}

impl LookedAt {
    /// Each with how many it stands for.
    pub(crate) fn weighed(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        self.samples
            .iter()
            .copied()
            .zip(self.factors.iter().copied())
    }
}

impl Solution {
    /// Of the samples with an observation that the fit used.
    pub(crate) fn looked_at(&self) -> LookedAt {
        looked_at(&self.used_samples(), &self.model.problem.borders, MOST)
    }

    /// Samples with an observation that the fit used.
    pub(crate) fn used_samples(&self) -> Vec<usize> {
        used_samples(&self.model, &self.weights)
    }
}

fn used_samples(model: &Model, weights: &[f64]) -> Vec<usize> {
    let used = |s: &usize| {
        let mut observations = model.of_sample[*s].clone();
        observations.any(|o| weights[o] > 0.0)
    };
    (0..model.problem.samples).filter(used).collect()
}

/// Weights of the observations without those of samples that are not looked at; `None` where all are.
pub(crate) fn fewer(model: &Model, weights: &[f64]) -> Option<Vec<f64>> {
    let looked_at = looked_at(&used_samples(model, weights), &model.problem.borders, MOST);
    if looked_at.all {
        return None;
    }
    let mut out = vec![0.0; weights.len()];
    for sample in looked_at.samples {
        let own = model.of_sample[sample].clone();
        out[own.clone()].copy_from_slice(&weights[own]);
    }
    Some(out)
}

/// Weights without those of poses beyond [`POSES`], evenly over all.
pub(crate) fn thinned(model: &Model, weights: &[f64]) -> Vec<f64> {
    let observations = || model.observations.iter().zip(weights);
    let kept = observations().filter(|(_, w)| **w > 0.0);
    let samples: BTreeSet<usize> = kept.map(|(o, _)| o.sample).collect();
    let step = samples.len().div_ceil(POSES).max(1);
    let used: BTreeSet<usize> = samples.iter().copied().step_by(step).collect();
    let of = |sample: usize, w: f64| if used.contains(&sample) { w } else { 0.0 };
    observations().map(|(o, w)| of(o.sample, *w)).collect()
}

/// At most about `most` of `samples`, which are in order. Recordings share them; what a short one leaves is for the longer ones.
pub(crate) fn looked_at(samples: &[usize], borders: &[usize], most: usize) -> LookedAt {
    if samples.len() <= most {
        return LookedAt {
            samples: samples.to_vec(),
            factors: vec![1.0; samples.len()],
            all: true,
        };
    }
    let mut recordings: Vec<&[usize]> = Vec::new();
    let mut rest = samples;
    for border in borders {
        let (own, others) = rest.split_at(rest.partition_point(|s| s < border));
        recordings.push(own);
        rest = others;
    }
    recordings.push(rest);
    recordings.retain(|own| !own.is_empty());
    recordings.sort_by_key(|own| own.len());
    let (count, mut left) = (recordings.len(), most);
    let mut taken: Vec<(usize, f64)> = Vec::with_capacity(most);
    for (k, own) in recordings.into_iter().enumerate() {
        let take = own.len().min((left / (count - k)).max(1));
        left = left.saturating_sub(take);
        let factor = own.len() as f64 / take as f64;
        let start = |block: usize| block * own.len() / take;
        taken.extend((0..take).map(|block| {
            let length = start(block + 1) - start(block);
            let place = scrambled(block as u64) % length as u64;
            (own[start(block) + place as usize], factor)
        }));
    }
    taken.sort_unstable_by_key(|(sample, _)| *sample);
    let (samples, factors) = taken.into_iter().unzip();
    LookedAt {
        samples,
        factors,
        all: false,
    }
}

/// A number without a pattern: Steele, Lea & Flood 2014 (`splitmix64`).
fn scrambled(number: u64) -> u64 {
    let mut z = number.wrapping_add(1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_are_all_looked_at() {
        let samples: Vec<usize> = (0..50).map(|i| 3 * i).collect();
        let looked_at = looked_at(&samples, &[30], 50);
        assert!(looked_at.all);
        assert_eq!(looked_at.samples, samples);
    }

    #[test]
    fn short_recordings_are_whole_and_long_ones_share_the_rest() {
        let samples: Vec<usize> = (0..100_060).collect();
        let borders = [60, 20_060];
        let looked_at = looked_at(&samples, &borders, 4096);
        assert!(!looked_at.all);
        assert!(looked_at.samples.is_sorted_by(|a, b| a < b));
        let of = |from: usize, to: usize| -> Vec<f64> {
            let own = looked_at.weighed().filter(|(s, _)| (from..to).contains(s));
            own.map(|(_, factor)| factor).collect()
        };
        assert_eq!(of(0, 60), vec![1.0; 60]);
        for (from, to) in [(60, 20_060), (20_060, 100_060)] {
            let own = of(from, to);
            assert_eq!(own.len(), 2018);
            // They stand for all.
            assert!((own.iter().sum::<f64>() - (to - from) as f64).abs() < 1e-6);
        }
    }

    #[test]
    fn a_motion_that_repeats_is_seen_everywhere() {
        let samples: Vec<usize> = (0..100_000).collect();
        for period in [24, 25, 48, 50, 100] {
            let looked_at = looked_at(&samples, &[], 4000);
            let mut seen = vec![0; period];
            for s in &looked_at.samples {
                seen[s % period] += 1;
            }
            let (least, most) = (seen.iter().min().unwrap(), seen.iter().max().unwrap());
            assert!(*least * 5 > *most, "{period}: {least} to {most}");
        }
    }
}
