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

use super::apply::apply_all;
use super::data::{Data, Measured};
use super::hypothesis::Scoped;
use super::ids::{BodyIndex, SampleIndex};
use super::scan::Scan;

/// Share of the bounded loss that defines the scale: the share of outliers at which it breaks down.
const SHARE: f64 = 0.2;
/// c² of the bound, which makes the scale σ for Gaussian residuals.
const BOUND: f64 = 15.0;
/// A residual beyond this many scales is an outlier: 1 in 10⁴ Gaussian ones.
const CUT: f64 = 4.6;
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
        let scale = s_scale(&norms);
        let total: f64 = norms.iter().map(|r| r * r).sum();
        let inside: f64 = norms
            .iter()
            .filter(|r| **r <= CUT * scale)
            .map(|r| r * r)
            .sum();
        // Outliers with less than a tenth of the sum of squares move no ratio.
        if round == 0 {
            screened.matters = inside < 0.9 * total;
        }
        screened.scale = scale;
        screened.samples = samples
            .iter()
            .zip(&norms)
            .filter(|(_, r)| **r > CUT * scale)
            .map(|(s, _)| s.0)
            .collect();
        if scale <= 0.0 {
            break;
        }
        let mut weights = vec![0.0; seen.len()];
        for ((sample, channels), r) in samples.iter().zip(&norms) {
            let smooth = (1.0 + (r / scale).powi(2) / 9.0).powi(-2);
            let hard = if *r <= CUT * scale { 1.0 } else { 0.0 };
            let w = if round < ROUNDS { smooth } else { hard };
            channels
                .iter()
                .for_each(|&k| weights[sample.row * n + k] = w);
        }
        scan.set_weights(weights);
    }
    screened.matters |=
        !screened.samples.is_empty() && screened.samples.len() * 100 >= samples.len();
    screened
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
    let mut sorted = norms.to_vec();
    sorted.sort_by(f64::total_cmp);
    let Some(median) = sorted.get(sorted.len() / 2) else {
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
