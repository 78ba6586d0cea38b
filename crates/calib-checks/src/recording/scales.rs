//! The tracker's unit of length in one recording against that in the others.
//!
//! What a tracker's calibration does to lengths it does to all bodies alike. With d the distances between the markers of all bodies, as known in
//! two recordings from so many rows each:
//!
//! ```text
//! s_k = d_k / d'_k − 1,   σ_k² = (σ(d_k)²/n + σ(d'_k)²/n') / d_k²                                         (1)
//! s   = Σ s_k/σ_k² / Σ 1/σ_k²,   σ_s² = m / Σ 1/σ_k²,   m = distances per marker                           (2)
//! ```
//!
//! Distances that share a marker share its noise, so (2) counts as many as there are markers. One scale explains n distances where
//!
//! ```text
//! Σ (s_k − s)² / (σ_k² + (d s)²) < n + 5 √(2n),   d: the tracker's distortion                            (3)
//! ```
//!
//! and where it is clear without any one of the markers, too. Otherwise a marker or a body is another one ([`other_shapes`](super::other_shapes)). Recordings in which a distance scatters more than in the other
//! are not compared: a filter that averages over a motion makes bodies smaller, and a marker that slides makes one distance another.

use std::collections::{BTreeMap, BTreeSet};

use calib_finding::{About, Fact, Finding, Severity, Subject, catalog};
use calib_recording::Poses;

use super::Expectations;
use super::rigidity::{Body, Pair};

/// A scale is another one from so many of its σ on…
const SIGMAS: f64 = 6.0;
/// …and from so many without any one of the markers: else that marker may have moved.
const SIGMAS_OF_REST: f64 = 4.5;
/// Scales differ by less from day to day, 1: nobody would look for it.
const LEAST: f64 = 1e-3;
/// From here on, 1, no calibration of a tracker is as wrong: fitted together, the recordings contradict each other.
const MUCH: f64 = 6e-3;
/// d of (3), as a part of the scale: refraction and the tracker's distortion differ from place to place.
const DISTORTION: f64 = 0.15;
/// Standard deviations of χ² in (3).
const CHANCE: f64 = 5.0;
/// Scatters of one distance in two recordings differ by chance by less than this factor…
const ALIKE: f64 = 4.0;
/// …or by what is no scatter, m.
const ROUNDING: f64 = 1e-6;
/// More is another unit, which is said elsewhere.
const UNIT: f64 = 0.2;

/// Recordings in which all lengths differ in one ratio from those of the recording with most rows.
#[must_use]
pub fn other_scales(recordings: &[(&str, &Poses)], expected: &Expectations) -> Vec<Finding> {
    let bodies = |poses: &Poses| -> BTreeMap<String, Known> {
        let of = |(name, markers): (&String, &Vec<String>)| {
            let mut columns = markers.iter();
            let seen = columns.all(|marker| poses.markers.contains_key(marker));
            let body = seen.then(|| Body::new(name, markers, poses, expected))??;
            Some((name.clone(), Known::of(&body)))
        };
        expected.bodies.iter().filter_map(of).collect()
    };
    let known: Vec<_> = recordings.iter().map(|(_, poses)| bodies(poses)).collect();
    let most = |k: &usize| (recordings[*k].1.len(), std::cmp::Reverse(*k));
    let Some(reference) = (0..recordings.len()).max_by_key(most) else {
        return Vec::new();
    };
    let mut scaled = Vec::new();
    for k in (0..recordings.len()).filter(|k| *k != reference) {
        if let Some(scale) = scale(&known[k], &known[reference]) {
            scaled.push((k, scale));
        }
    }
    // Where all the others agree, the reference is the one that differs.
    let others = recordings.len() - 1;
    let odd = others > 1 && scaled.len() == others && agree(&scaled);
    if odd {
        let (_, scale) = scaled[0];
        let opposite = Scale {
            value: 1.0 / (1.0 + scale.value) - 1.0,
            ..scale
        };
        let other = recordings[scaled[0].0].0;
        return vec![opposite.finding(recordings[reference].0, other)];
    }
    let findings = scaled.into_iter();
    findings
        .map(|(k, scale)| scale.finding(recordings[k].0, recordings[reference].0))
        .collect()
}

/// Scales that differ by no more than chance.
fn agree(scaled: &[(usize, Scale)]) -> bool {
    let mut pairs = scaled.windows(2);
    pairs.all(|pair| {
        let [a, b] = [pair[0].1, pair[1].1];
        (a.value - b.value).abs() < SIGMAS * a.sigma.hypot(b.sigma)
    })
}

/// The distances of a body, by its markers.
struct Known {
    distances: BTreeMap<(usize, usize), Distance>,
    markers: usize,
}

#[derive(Clone, Copy)]
struct Distance {
    /// m.
    length: f64,
    /// Scatter from row to row, m.
    sigma: f64,
    rows: usize,
}

impl Distance {
    fn variance(&self) -> f64 {
        self.sigma * self.sigma / self.rows as f64
    }

    fn scatters_like(&self, other: &Self) -> bool {
        let [less, more] = [f64::min, f64::max].map(|f| f(self.sigma, other.sigma));
        more <= ALIKE * less + ROUNDING
    }
}

impl Known {
    fn of(body: &Body<'_>) -> Self {
        let of = |p: &Pair| {
            let known = Distance {
                length: p.distance,
                sigma: p.sigma,
                rows: p.rows,
            };
            ((p.i, p.j), known)
        };
        Self {
            distances: body.pairs.iter().map(of).collect(),
            markers: body.markers.len(),
        }
    }
}

/// A ratio of lengths minus 1, equation (2).
#[derive(Debug, Clone, Copy)]
struct Scale {
    value: f64,
    sigma: f64,
}

impl Scale {
    fn finding(self, recording: &str, other: &str) -> Finding {
        let much = self.value.abs() > MUCH;
        let severity = if much {
            Severity::Error
        } else {
            Severity::Warning
        };
        let subject = Subject::from(About::Tracker);
        Finding::new(catalog::TRACKER_SCALE, subject)
            .with_severity(severity)
            .in_recording(recording)
            .with("scale", Fact::ratio(self.value))
            .with("sigma", Fact::ratio(self.sigma))
            .with("other", Fact::name(other))
    }
}

/// How much longer one distance is in one recording than in another.
struct Ratio {
    /// By body and column.
    markers: [(usize, usize); 2],
    value: f64,
    variance: f64,
}

/// The scale of one recording against another's, where it is clear and explains all distances.
fn scale(here: &BTreeMap<String, Known>, there: &BTreeMap<String, Known>) -> Option<Scale> {
    let mut ratios = Vec::new();
    let mut markers = BTreeSet::new();
    for (b, (name, body)) in here.iter().enumerate() {
        let other = there.get(name);
        let Some(other) = other.filter(|other| other.markers == body.markers) else {
            continue;
        };
        for ((i, j), d) in &body.distances {
            let Some(e) = other.distances.get(&(*i, *j)).filter(|e| e.length > 0.0) else {
                continue;
            };
            if !d.scatters_like(e) {
                return None;
            }
            // A median of the rows is less exact than their mean by a quarter.
            let variance = 1.57 * (d.variance() + e.variance()) / (d.length * d.length);
            let of = [(b, *i), (b, *j)];
            markers.extend(of);
            ratios.push(Ratio {
                markers: of,
                value: d.length / e.length - 1.0,
                variance: variance.max(f64::MIN_POSITIVE),
            });
        }
    }
    if ratios.len() < 3 {
        return None;
    }
    let scale = mean(ratios.iter(), markers.len())?;
    let value = scale.value.abs();
    let clear = value > LEAST && value > SIGMAS * scale.sigma && value < UNIT;
    let without = |marker: &(usize, usize)| {
        let rest = ratios.iter().filter(|r| !r.markers.contains(marker));
        let rest = mean(rest, markers.len() - 1);
        rest.is_some_and(|rest| rest.value * scale.value.signum() > SIGMAS_OF_REST * rest.sigma)
    };
    (clear && explains(&scale, &ratios) && markers.iter().all(without)).then_some(scale)
}

/// (2).
fn mean<'a>(ratios: impl Iterator<Item = &'a Ratio>, markers: usize) -> Option<Scale> {
    let [mut count, mut weights, mut sum] = [0.0; 3];
    for ratio in ratios {
        count += 1.0;
        weights += 1.0 / ratio.variance;
        sum += ratio.value / ratio.variance;
    }
    let shared = f64::max(1.0, count / markers as f64);
    (count > 0.0).then(|| Scale {
        value: sum / weights,
        sigma: (shared / weights).sqrt(),
    })
}

/// (3).
fn explains(scale: &Scale, ratios: &[Ratio]) -> bool {
    let distortion = (DISTORTION * scale.value).powi(2);
    let n = ratios.len() as f64;
    let chi2 = ratios
        .iter()
        .map(|r| (r.value - scale.value).powi(2) / (r.variance + distortion));
    chi2.sum::<f64>() < n + CHANCE * (2.0 * n).sqrt()
}

#[cfg(test)]
mod tests;
