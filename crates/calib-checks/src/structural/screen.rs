//! Gross outliers: found under the hypotheses that lead, never under one alone.
//!
//! A sample that is an outlier under a wrong hypothesis may be the very one that shows the fault. Each leading hypothesis is
//! fitted robustly; the one with the smallest S-scale s decides which samples are left out, and all hypotheses are
//! scored again on the same samples:
//!
//! ```text
//! mean min(r²/(c s)², 1) = b,    b = 0.2,  c² = 15        E min(χ₃²/15, 1) = 0.2: s is σ per coordinate for Gaussian residuals
//! ```
//!
//! The scale grows without limit as a fifth of the samples disagree, and a tenth of them cannot hide: it costs 1/√(2(1 − …)).
//! Each body has a scale of its own, since nominal errors grow along the robot; hypotheses are compared by the geometric mean.
//! Where most samples of a body in a recording disagree, they are no outliers and stay.

use super::apply::apply_all;
use super::data::{Data, Measured};
use super::hypothesis::Scoped;
use super::ids::{BodyIndex, SampleIndex};
use super::scan::Scan;
use calib_geometry::statistics::upper_median;

/// Share of the bounded loss that defines the scale: the share of outliers at which it breaks down.
const SHARE: f64 = 0.2;
/// c² of the bound, which makes the scale σ for Gaussian residuals.
const BOUND: f64 = 15.0;
/// A residual beyond this many scales is an outlier: 1 in 10⁴ Gaussian ones.
const CUT: f64 = 4.6;
/// Samples of a body from which a scale of its own is worth something.
const ENOUGH_SAMPLES: usize = 12;
/// Least scale, m, so that noise-free data can be compared.
const LEAST_SCALE: f64 = 1e-9;
/// Part of a body's samples in a recording up to which they can be outliers.
const MINORITY: f64 = 0.4;
/// Rounds with smooth weights, then as many with the cut.
const ROUNDS: usize = 4;

/// The scale under one hypothesis, and the samples beyond the cut.
pub(crate) struct Screened {
    pub scale: f64,
    pub samples: Vec<SampleIndex>,
    /// Part of the sum of squares that the samples beyond the cut had in the first fit.
    pub matters: bool,
}

/// The robust scale of the residuals after the corrections.
pub(crate) fn screen(data: &Data, corrections: &[Scoped]) -> Screened {
    let corrected = apply_all(corrections, data);
    let mut scan = Scan::new(&corrected, &[]);
    let seen = scan.weights.clone();
    let n = scan.channels.len();
    let samples = samples_of(&scan, &seen);
    let mut screened = Screened {
        scale: f64::INFINITY,
        samples: Vec::new(),
        matters: false,
    };
    for round in 0..2 * ROUNDS {
        let fit = scan.fit(None);
        let norms: Vec<f64> = samples
            .iter()
            .map(|(sample, channels)| {
                let sum: f64 = channels
                    .iter()
                    .map(|&k| scan.residual(&fit, sample.row, k).norm_squared())
                    .sum();
                (sum / channels.len() as f64).sqrt()
            })
            .collect();
        let scales = scales(&samples, &norms, data.bodies.len());
        let cut = |s: &SampleIndex| CUT * scales[s.body.0];
        let total: f64 = norms.iter().map(|r| r * r).sum();
        let all = || samples.iter().zip(&norms);
        let inside = all().filter(|((s, _), r)| **r <= cut(s));
        // Outliers with less than a tenth of the sum of squares move no ratio.
        if round == 0 {
            screened.matters = inside.map(|(_, r)| r * r).sum::<f64>() < 0.9 * total;
        }
        screened.scale = geometric_mean(&samples, &scales);
        let outside = all().filter(|((s, _), r)| **r > cut(s));
        screened.samples = outside.map(|(s, _)| s.0).collect();
        if screened.scale <= LEAST_SCALE {
            break;
        }
        let mut weights = vec![0.0; seen.len()];
        for ((sample, channels), r) in all() {
            let scale = scales[sample.body.0].max(LEAST_SCALE);
            let smooth = (1.0 + (r / scale).powi(2) / 9.0).powi(-2);
            let hard = if *r <= cut(sample) { 1.0 } else { 0.0 };
            let w = if round < ROUNDS { smooth } else { hard };
            channels
                .iter()
                .for_each(|&k| weights[sample.row * n + k] = w);
        }
        // The next fit would be this one.
        if weights == scan.weights {
            break;
        }
        scan.set_weights(weights);
    }
    only_minorities(data, &samples, &mut screened.samples);
    screened.matters |=
        !screened.samples.is_empty() && screened.samples.len() * 100 >= samples.len();
    screened
}

/// The scale of each body; one with few samples has that of all.
fn scales(samples: &[(SampleIndex, Vec<usize>)], norms: &[f64], bodies: usize) -> Vec<f64> {
    let all = s_scale(norms);
    let own = |b: usize| {
        let of_body = samples
            .iter()
            .zip(norms)
            .filter(|((s, _), _)| s.body.0 == b);
        let own: Vec<f64> = of_body.map(|(_, r)| *r).collect();
        if own.len() < ENOUGH_SAMPLES {
            all
        } else {
            s_scale(&own)
        }
    };
    (0..bodies).map(own).collect()
}

/// The geometric mean of the scales over the samples.
fn geometric_mean(samples: &[(SampleIndex, Vec<usize>)], scales: &[f64]) -> f64 {
    let logs = samples
        .iter()
        .map(|(s, _)| scales[s.body.0].max(LEAST_SCALE).ln());
    (logs.sum::<f64>() / samples.len().max(1) as f64).exp()
}

/// Keeps the outliers of a body in a recording only where they are the minority.
fn only_minorities(
    data: &Data,
    samples: &[(SampleIndex, Vec<usize>)],
    screened: &mut Vec<SampleIndex>,
) {
    let place = |s: &SampleIndex| s.body.0 * data.recordings() + data.recording[s.row].0;
    let mut counts = vec![(0.0, 0.0); data.bodies.len() * data.recordings()];
    samples.iter().for_each(|(s, _)| counts[place(s)].0 += 1.0);
    screened.iter().for_each(|s| counts[place(s)].1 += 1.0);
    screened.retain(|s| counts[place(s)].1 <= MINORITY * counts[place(s)].0);
}

/// Samples with the channels that belong to them.
fn samples_of(scan: &Scan<'_>, seen: &[f64]) -> Vec<(SampleIndex, Vec<usize>)> {
    let n = scan.channels.len();
    let mut samples: Vec<(SampleIndex, Vec<usize>)> = Vec::new();
    for row in 0..scan.data.readings.len() {
        for (k, channel) in scan.channels.iter().enumerate() {
            if seen[row * n + k] <= 0.0 {
                continue;
            }
            let pose = matches!(
                scan.data.bodies[channel.body].measured,
                Measured::Poses { .. }
            );
            let marker = if pose { 0 } else { channel.point };
            let sample = SampleIndex {
                row,
                body: BodyIndex(channel.body),
                marker,
            };
            match samples.last_mut() {
                Some(last) if last.0 == sample => last.1.push(k),
                _ => samples.push((sample, vec![k])),
            }
        }
    }
    samples
}

/// The S-scale of the norms of three-dimensional residuals.
fn s_scale(norms: &[f64]) -> f64 {
    let Some(median) = upper_median(&mut norms.to_vec()) else {
        return 0.0;
    };
    let mut squared = median * median / 2.4;
    for _ in 0..60 {
        if squared <= 0.0 {
            return 0.0;
        }
        let mean = norms
            .iter()
            .map(|r| (r * r / (BOUND * squared)).min(1.0))
            .sum::<f64>()
            / norms.len() as f64;
        squared *= mean / SHARE;
        if (mean / SHARE - 1.0).abs() < 1e-4 {
            break;
        }
    }
    squared.sqrt()
}
