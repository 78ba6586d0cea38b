//! A tracker, or a stand, that does not stand still: a body that no joint moves shows it, and the others move with it.
//!
//! ```text
//! d_i, r_i   mean of measured − predicted of that body and of the others in row i, less mean, trend and best step of the recording
//! ρ = Σ d·r / √(Σ d·d Σ r·r),   n' = 3 n (1 − a_d a_r)/(1 + a_d a_r),   F = ρ² (n' − 1)/(1 − ρ²)  ~  F(1, n' − 1)                (1)
//! ```
//!
//! with the correlations a of successive rows (Bartlett 1935). What one step or an even drift explains is left to the scan for changes.

use std::collections::{BTreeMap, BTreeSet};

use calib_estimator::chance::f_tail;
use calib_finding::{About, Fact, Finding, catalog};
use calib_profile::{Body, BodyKind};
use calib_report::ResidualRow;
use nalgebra::Vector3;

use crate::prepare::inputs::Inputs;

/// Probability of chance.
const CHANCE: f64 = 1e-6;
/// Share of the other bodies' squared residuals that follows the body's at least.
const SHARE: f64 = 0.3;
/// How far the others move per motion of the body: its own noise makes it less, a rotation of the tracker makes it another one.
const SLOPE: std::ops::Range<f64> = 0.3..3.0;
/// Rows of a recording that are compared, at least: mean, trend and step take four.
const FEWEST: usize = 8;
/// Rows on either side of a step.
const SIDE: usize = 2;

/// One row: measured − predicted of the body, and of the others.
type Pair = [Vector3<f64>; 2];

/// That everything moves with a body that no joint moves, and the share of the other bodies' squared residuals which that explains.
pub(super) fn sways(inputs: &Inputs, residuals: &[ResidualRow]) -> Option<(Finding, f64)> {
    let profile = &inputs.robot.profile;
    let still = profile
        .bodies
        .iter()
        .filter(|(_, body)| stands(inputs, body));
    let still: Vec<_> = still
        .map(|(name, body)| (name, subjects(name, body)))
        .collect();
    let all: BTreeSet<&str> = still.iter().flat_map(|(_, own)| own).copied().collect();
    let of = |(name, own): &(&String, BTreeSet<&str>)| {
        let common = Common::of(&pairs(residuals, own, &all))?;
        let finding = Finding::new(catalog::TRACKER_SWAYS, About::Tracker)
            .with("body", Fact::name(*name))
            .with("motion", Fact::meters(common.motion))
            .with("explains", Fact::ratio(common.share));
        Some((finding, common.share))
    };
    let found = still.iter().filter_map(of);
    found.max_by(|a, b| a.1.total_cmp(&b.1))
}

/// Whether no joint moves the body.
pub(super) fn stands(inputs: &Inputs, body: &Body) -> bool {
    let model = &inputs.robot.model;
    let up = model.chain_to_root(body.link);
    up.iter()
        .all(|joint| model.joint(*joint).kind.axis().is_none())
}

/// What the residuals of a body are called.
pub(super) fn subjects<'a>(name: &'a str, body: &'a Body) -> BTreeSet<&'a str> {
    match &body.kind {
        BodyKind::Markers { names, .. } => names.iter().map(String::as_str).collect(),
        BodyKind::Pose => BTreeSet::from([name]),
    }
}

/// The rows of each recording that show the body and others, in their order.
fn pairs(
    residuals: &[ResidualRow],
    own: &BTreeSet<&str>,
    still: &BTreeSet<&str>,
) -> Vec<Vec<Pair>> {
    /// Sum and count.
    type Mean = (Vector3<f64>, f64);
    let mut rows: BTreeMap<(&str, u64), [Mean; 2]> = BTreeMap::new();
    for row in residuals {
        let which = match &*row.subject {
            subject if own.contains(subject) => 0,
            subject if !still.contains(subject) => 1,
            _ => continue,
        };
        let mean = &mut rows.entry((&row.recording, row.row)).or_default()[which];
        mean.0 -= Vector3::from(row.residual_m);
        mean.1 += 1.0;
    }
    let mut recordings: BTreeMap<&str, Vec<Pair>> = BTreeMap::new();
    for ((recording, _), means) in rows {
        if means
            .iter()
            .all(|(sum, count)| *count > 0.0 && sum.iter().all(|x| x.is_finite()))
        {
            let pair = means.map(|(sum, count)| sum / count);
            recordings.entry(recording).or_default().push(pair);
        }
    }
    let enough = |rows: &Vec<Pair>| rows.len() >= FEWEST;
    recordings.into_values().filter(enough).collect()
}

/// What the body and the others have in common.
struct Common {
    /// rms, m.
    motion: f64,
    /// ρ² of equation (1).
    share: f64,
}

impl Common {
    fn of(recordings: &[Vec<Pair>]) -> Option<Self> {
        let (mut squares, mut next) = ([0.0; 2], [0.0; 2]);
        let (mut product, mut rows, mut taken) = (0.0, 0.0, 0.0);
        for recording in recordings {
            let recording = without_step(&without_trend(recording));
            for pair in &recording {
                product += pair[0].dot(&pair[1]);
                (0..2).for_each(|k| squares[k] += pair[k].norm_squared());
            }
            for two in recording.windows(2) {
                (0..2).for_each(|k| next[k] += two[0][k].dot(&two[1][k]));
            }
            rows += recording.len() as f64;
            taken += 4.0;
        }
        let [d, r] = squares;
        if !(product > 0.0 && d > 0.0 && r > 0.0) {
            return None;
        }
        let share = (product * product / (d * r)).min(1.0 - 1e-12);
        let both = (next[0] / d * next[1] / r).clamp(0.0, 0.99);
        let count = 3.0 * (rows - taken) * (1.0 - both) / (1.0 + both) - 1.0;
        let chance = f_tail(share * count / (1.0 - share), 1.0, count);
        let is_one = share >= SHARE && chance < CHANCE && SLOPE.contains(&(product / d));
        is_one.then(|| Self {
            motion: (product / rows).sqrt(),
            share,
        })
    }
}

/// Less the straight line over the rows.
fn without_trend(rows: &[Pair]) -> Vec<Pair> {
    let middle = 0.5 * (rows.len() as f64 - 1.0);
    let at = |i: usize| i as f64 - middle;
    let square: f64 = (0..rows.len()).map(|i| at(i).powi(2)).sum();
    let line = |k: usize| {
        let of = rows.iter().map(|pair| pair[k]).enumerate();
        of.fold([Vector3::zeros(); 2], |[mean, slope], (i, x)| {
            [mean + x / rows.len() as f64, slope + x * (at(i) / square)]
        })
    };
    let lines = [line(0), line(1)];
    let rows = rows.iter().enumerate();
    rows.map(|(i, pair)| [0, 1].map(|k| pair[k] - lines[k][0] - lines[k][1] * at(i)))
        .collect()
}

/// Less the step of both that takes most of the body's motion beside the line; the rows have no mean and no trend.
fn without_step(rows: &[Pair]) -> Vec<Pair> {
    let count = rows.len() as f64;
    let middle = 0.5 * (count - 1.0);
    let at = |i: usize| i as f64 - middle;
    let square: f64 = (0..rows.len()).map(|i| at(i).powi(2)).sum();
    // Of a step from row k on, less its own line: Σ s x = −Σ_{i<k} x, and Σ s².
    let (mut before, mut lever) = ([Vector3::zeros(); 2], 0.0);
    let mut best = (0.0, 0, lever, [Vector3::zeros(); 2]);
    for k in 1..rows.len() - SIDE + 1 {
        (0..2).for_each(|of| before[of] += rows[k - 1][of]);
        lever -= at(k - 1);
        let behind = count - k as f64;
        let own = behind - behind * behind / count - lever * lever / square;
        let gain = before[0].norm_squared() / own;
        if k >= SIDE && own > 1e-9 * count && gain > best.0 {
            best = (gain, k, lever, before.map(|sum| -sum / own));
        }
    }
    let (_, first, lever, size) = best;
    let behind = rows.len() - first;
    let step = |i: usize| {
        let own = f64::from(u8::from(i >= first));
        own - behind as f64 / count - at(i) * lever / square
    };
    let rows = rows.iter().enumerate();
    rows.map(|(i, pair)| [0, 1].map(|of| pair[of] - size[of] * step(i)))
        .collect()
}
