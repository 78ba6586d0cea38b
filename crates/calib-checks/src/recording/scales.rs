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
//! Distances that share a marker share its noise, so (2) counts as many as there are markers. One scale explains them where each s_k is within
//! what noise does of s; otherwise a marker or a body is another one ([`other_shapes`](super::other_shapes)).

use std::collections::BTreeMap;

use calib_finding::{About, Fact, Finding, Severity, Subject, catalog};
use calib_recording::Poses;

use super::Expectations;
use super::rigidity::{Body, Pair};

/// A scale is another one from so many of its σ on.
const SIGMAS: f64 = 6.0;
/// Scales differ by less from day to day, 1: nobody would look for it.
const LEAST: f64 = 1e-3;
/// From here on, 1, no calibration of a tracker is as wrong: fitted together, the recordings contradict each other.
const MUCH: f64 = 6e-3;
/// A distance may be off the common scale by so many of its σ…
const CHANCE: f64 = 5.0;
/// …or by this part of the scale: refraction and the tracker's distortion differ from place to place.
const DISTORTION: f64 = 0.3;
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

/// The distances of a body: markers, m, and variance of the mean, m².
struct Known {
    distances: BTreeMap<(usize, usize), (f64, f64)>,
    markers: usize,
}

impl Known {
    fn of(body: &Body<'_>) -> Self {
        let of = |p: &Pair| {
            let variance = p.sigma * p.sigma / p.rows as f64;
            ((p.i, p.j), (p.distance, variance))
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

/// The scale of one recording against another's, where it is clear and explains all distances.
fn scale(here: &BTreeMap<String, Known>, there: &BTreeMap<String, Known>) -> Option<Scale> {
    let mut ratios: Vec<(f64, f64)> = Vec::new();
    let mut markers = 0;
    for (name, body) in here {
        let other = there.get(name);
        let Some(other) = other.filter(|other| other.markers == body.markers) else {
            continue;
        };
        markers += body.markers;
        for (pair, (d, variance)) in &body.distances {
            if let Some((e, more)) = other.distances.get(pair)
                && *e > 0.0
            {
                // A median of the rows is less exact than their mean by a quarter.
                let variance = 1.57 * (variance + more) / (d * d);
                ratios.push((d / e - 1.0, variance.max(f64::MIN_POSITIVE)));
            }
        }
    }
    if ratios.len() < 3 {
        return None;
    }
    let information: f64 = ratios.iter().map(|(_, v)| 1.0 / v).sum();
    let value = ratios.iter().map(|(s, v)| s / v).sum::<f64>() / information;
    let shared = f64::max(1.0, ratios.len() as f64 / markers as f64);
    let sigma = (shared / information).sqrt();
    let clear = value.abs() > LEAST && value.abs() > SIGMAS * sigma && value.abs() < UNIT;
    let explains =
        |(s, v): &(f64, f64)| (s - value).abs() < (CHANCE * v.sqrt()).max(DISTORTION * value.abs());
    (clear && ratios.iter().all(explains)).then_some(Scale { value, sigma })
}

#[cfg(test)]
mod tests;
