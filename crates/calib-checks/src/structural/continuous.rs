//! Continuous faults (gain, coupling by a fraction, readings that lag behind, of a recording or of a joint) by score tests, and the residual that nominal errors explain.
//!
//! The residuals `r = Q y + c − R m − t` are linear in small changes of the registration (Q, c, m: columns A_r), of the nominal
//! geometry (six per moving joint, with priors: A_g) and of the tested parameter (one column G per gain, per coupling, per recording's lag, and per latency of a joint or of a joint and what it carries):
//!
//! ```text
//! r ≈ A x + G k + e,   cov e = σ² (I + λ Σ_j D_j D_jᵀ) per row,   D_j = ∂(R m + t)/∂reading_j         joint noise
//! N = Aᵀ V⁻¹ A + P,    P = σ²/σ_prior² for the geometry
//! g = Gᵀ V⁻¹ (r − A x̂),   h = Gᵀ V⁻¹ G − Gᵀ V⁻¹ A N⁻¹ Aᵀ V⁻¹ G,   k̂ = g/h
//! T = ν ln(χ²/(χ² − g²/h)),   ν = n − tr(N⁻¹ Aᵀ V⁻¹ A)
//! ```
//!
//! λ by restricted maximum likelihood over a grid, σ² from χ². The geometry is relinearized before the tests.
//! The largest T of all tests is compared with the F quantile at `false_alarm / tests`.

use std::collections::BTreeSet;

use nalgebra::DMatrix;
use rayon::prelude::*;
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use super::Options;
use super::apply::{apply, apply_all};
use super::candidates::span;
use super::data::Data;
use super::hypothesis::{Hypothesis, Scope, Scoped};
use super::ids::{JointIndex, RecordingIndex, SampleIndex};
use super::linear::{Map, Model, Sums, projected, solve};
use super::nonlinear::{fewer, noise_ratio, relinearized};
use super::screen::{Screened, screen};
use super::tested::Test;

/// Relinearizations of the geometry before the tests.
const RELINEARIZATIONS: usize = 3;
/// With fewer degrees of freedom the priors, not the data, decide a test.
const LEAST_FREEDOM: f64 = 8.0;
/// Tests that are scored by one task.
const CHUNK: usize = 120;
/// Zeros that are corrected, or steps of one that is far off.
const ZEROS: usize = 3;
/// Fall of T from the best within which another test explains the data as well (log-likelihood difference 3).
const AS_GOOD: f64 = 6.0;

/// A continuous fault that the data demand.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Continuous {
    /// [`Hypothesis::Gain`], [`Hypothesis::Coupling`], [`Hypothesis::Lag`], [`Hypothesis::Latency`] or [`Hypothesis::LatencyBeyond`], with its estimated
    /// factor or time.
    pub hypothesis: Hypothesis,
    /// Standard deviation of the factor, or of the time, s.
    pub sigma: f64,
    /// The score statistic.
    pub statistic: f64,
    /// Its familywise threshold.
    pub threshold: f64,
    /// What the fault moves the registration residual by, rms, m.
    pub effect: f64,
    /// Others whose statistic is within 6 of the largest.
    pub alternatives: Vec<Hypothesis>,
}

impl Test {
    fn hypothesis(&self, k: f64) -> Hypothesis {
        match self {
            &Self::Reading { joint, source } if joint == source => Hypothesis::Gain {
                joint,
                factor: 1.0 + k,
            },
            &Self::Reading { joint, source } => Hypothesis::Coupling {
                joint,
                source,
                factor: k,
            },
            &Self::Lag { recording } => Hypothesis::Lag {
                recording,
                seconds: k,
            },
            Self::Latency { joints } => {
                let (joint, seconds) = (joints[0], k);
                match joints.len() {
                    1 => Hypothesis::Latency { joint, seconds },
                    _ => Hypothesis::LatencyBeyond { joint, seconds },
                }
            }
            &Self::Zero { joint } => Hypothesis::Zero { joint, offset: k },
        }
    }
}

/// The most significant continuous fault, if any is significant and large enough to matter, also without the outliers that only
/// the fitted geometry shows: beside nominal errors of 10 mm, one of 20 mm is none.
///
/// The samples that were `screened` under hypotheses without such a fault may be those that show it best: in a sweep of one joint,
/// the ends of the range. It is asked for with all samples, too; what leaves the smaller scale is taken.
pub(crate) fn continuous(
    data: &Data,
    screened: &[SampleIndex],
    options: &Options,
) -> Option<Continuous> {
    let (beside, all) = rayon::join(
        || confirmed(data, screened, options),
        || (!screened.is_empty()).then(|| confirmed(data, &[], options)),
    );
    let scale = |found: &Continuous| {
        let left = left_with(data, screened, Some(&found.hypothesis), options);
        left.map_or(f64::INFINITY, |left| left.scale)
    };
    match (beside, all.flatten()) {
        (Some(a), Some(b)) if same(&a.hypothesis, &b.hypothesis) => Some(a),
        (Some(a), Some(b)) => Some(if scale(&b) < scale(&a) { b } else { a }),
        (a, b) => a.or(b),
    }
}

/// Whether two are the same fault, of whatever size.
fn same(a: &Hypothesis, b: &Hypothesis) -> bool {
    let sizeless = |h: &Hypothesis| {
        let mut h = *h;
        match &mut h {
            Hypothesis::Gain { factor, .. } | Hypothesis::Coupling { factor, .. } => *factor = 0.0,
            Hypothesis::Lag { seconds, .. }
            | Hypothesis::Latency { seconds, .. }
            | Hypothesis::LatencyBeyond { seconds, .. } => *seconds = 0.0,
            _ => {}
        }
        h
    };
    sizeless(a) == sizeless(b)
}

/// The fault that is demanded without these samples, and without those that are outliers beside it.
fn confirmed(data: &Data, screened: &[SampleIndex], options: &Options) -> Option<Continuous> {
    let found = demanded(data, screened, options)?;
    let known: BTreeSet<SampleIndex> = screened.iter().copied().collect();
    let outliers = outliers(data, screened, &found.hypothesis, options);
    if outliers.iter().all(|sample| known.contains(sample)) {
        return Some(found);
    }
    let all: BTreeSet<SampleIndex> = known.into_iter().chain(outliers).collect();
    let all: Vec<SampleIndex> = all.into_iter().collect();
    demanded(data, &all, options)
}

/// Outliers at the fitted geometry, with the fault or without it, whichever leaves the smaller scale: what the fault explains is
/// no outlier.
fn outliers(
    data: &Data,
    screened: &[SampleIndex],
    fault: &Hypothesis,
    options: &Options,
) -> Vec<SampleIndex> {
    let (with, without) = rayon::join(
        || left_with(data, screened, Some(fault), options),
        || left_with(data, screened, None, options),
    );
    let least = [without, with].into_iter().flatten();
    let least = least.min_by(|a, b| a.scale.total_cmp(&b.scale));
    least.map(|found| found.samples).unwrap_or_default()
}

/// Scale and outliers at the geometry that is fitted without the screened samples.
fn left_with(
    data: &Data,
    screened: &[SampleIndex],
    fault: Option<&Hypothesis>,
    options: &Options,
) -> Option<Screened> {
    let corrections = fault.map(|hypothesis| Scoped {
        hypothesis: *hypothesis,
        scope: Scope::All,
    });
    let corrections: Vec<Scoped> = corrections.into_iter().collect();
    let corrected = apply_all(&corrections, data);
    let (part, part_screened) = fewer(&corrected, screened);
    let (part, ..) = relinearized(part, &part_screened, options, RELINEARIZATIONS)?;
    let at_map = Data {
        chain: part.chain,
        ..corrected
    };
    Some(screen(&at_map, &[]))
}

/// What is significant, once zeros that are off by more than the priors allow, and explain more, are corrected: with the wrong posture the
/// motion of one joint looks like a part of another's. So are lags that the fit estimates.
fn demanded(data: &Data, screened: &[SampleIndex], options: &Options) -> Option<Continuous> {
    let tests = tests(data, options.clocks_estimated);
    if tests.is_empty() {
        return None;
    }
    let mut corrected = None;
    let lags = tests.iter().filter(|t| matches!(t, Test::Lag { .. }));
    let lags = lags.filter(|_| options.clocks_estimated).count();
    for _ in 0..=ZEROS + lags {
        match strongest(
            corrected.as_ref().unwrap_or(data),
            screened,
            &tests,
            options,
        )? {
            Demanded::Fault(found) => return Some(found),
            Demanded::Beside(hypothesis) => {
                let all = Scoped {
                    hypothesis,
                    scope: Scope::All,
                };
                corrected = Some(apply(&all, corrected.as_ref().unwrap_or(data)));
            }
        }
    }
    None
}

/// What explains most.
enum Demanded {
    Fault(Continuous),
    /// The zero of a joint, or the lag of a recording that the fit estimates: no fault, and to be corrected before one is named.
    Beside(Hypothesis),
}

fn strongest(
    data: &Data,
    screened: &[SampleIndex],
    tests: &[Test],
    options: &Options,
) -> Option<Demanded> {
    let (part, part_screened) = fewer(data, screened);
    let (part, deviation, sigma) = relinearized(part, &part_screened, options, RELINEARIZATIONS)?;
    let noise = noise_ratio(&part, &deviation, sigma, &part_screened, options)?;
    let (lambda, sigma) = (noise.lambda, noise.sigma);
    let at_map = Data {
        chain: part.chain,
        ..data.clone()
    };
    let model = Model::new(&at_map, tests, screened);
    let [sums, plain] = model.sums_of([lambda, 0.0]);
    let map = solve(&model, &sums, sigma, &deviation, options)?;
    let is_zero = |t: usize| matches!(tests[t], Test::Zero { .. });
    let (zeros, mut scored): (Vec<_>, Vec<_>) = score_tests(&model, &sums, &map)
        .into_iter()
        .partition(|s| is_zero(s.0));
    if options.clocks_estimated {
        beside_others(&mut scored, tests, &map);
    }
    scored.sort_by(|a, b| b.1.total_cmp(&a.1));
    if !options.clocks_estimated {
        whole_recording_first(tests, &mut scored);
    }
    let &(which, statistic, factor, h) = scored.first()?;
    if map.freedom < LEAST_FREEDOM {
        return None;
    }
    let threshold = threshold(options.false_alarm / scored.len() as f64, map.freedom);
    if statistic < threshold {
        return None;
    }
    let zero = zeros.into_iter().max_by(|a, b| a.1.total_cmp(&b.1));
    if let Some((joint, _, offset, _)) = zero.filter(|zero| zero.1 > statistic) {
        return Some(Demanded::Beside(tests[joint].hypothesis(offset)));
    }
    let cross = plain.cross.view((0, which), (model.registration, 1));
    let own = DMatrix::from_element(1, 1, plain.own[which]);
    let moved = projected(&plain.gram, cross.into_owned(), own)?[(0, 0)].max(0.0);
    let effect = factor.abs() * (3.0 * moved / plain.observations).sqrt();
    if effect < options.least_effect {
        return None;
    }
    let as_good = |s: &&(usize, f64, f64, f64)| statistic - s.1 < AS_GOOD;
    if options.clocks_estimated && matches!(tests[which], Test::Lag { .. }) {
        return Some(Demanded::Beside(tests[which].hypothesis(factor)));
    }
    let alternatives = scored[1..].iter().take_while(as_good);
    Some(Demanded::Fault(Continuous {
        hypothesis: tests[which].hypothesis(factor),
        sigma: map.sigma / h.sqrt(),
        statistic,
        threshold,
        effect,
        alternatives: alternatives.map(|s| tests[s.0].hypothesis(s.2)).collect(),
    }))
}

/// Of joints that are late and a recording that is late as a whole, the second is more common: the first must explain more.
fn whole_recording_first(tests: &[Test], scored: &mut [(usize, f64, f64, f64)]) {
    let best = scored.first().map(|s| (&tests[s.0], s.1));
    let Some((Test::Latency { .. }, statistic)) = best else {
        return;
    };
    let as_good = scored.iter().take_while(|s| statistic - s.1 < AS_GOOD);
    let of_recording = as_good
        .map(|s| &tests[s.0])
        .position(|test| matches!(test, Test::Lag { .. }));
    if let Some(place) = of_recording {
        scored[..=place].rotate_right(1);
    }
}

/// Where the fit estimates the clocks, each latency in comparison with the other joints: of k₁ of its joints and k₂ of the others
///
/// ```text
/// k₁ − k₂ = [1 −1] H⁻¹ g,   h = 1/([1 −1] H⁻¹ [1 −1]ᵀ),   T = ν ln(χ²_b/(χ²_b − (k₁ − k₂)² h)),   H₁₂ = (h_b − h₁ − h₂)/2
/// ```
///
/// with h_b and χ²_b of both together. Those of the others and of both are no tests of their own.
fn beside_others(scored: &mut Vec<(usize, f64, f64, f64)>, tests: &[Test], map: &Map) {
    let is_late = |s: &(usize, f64, f64, f64)| matches!(tests[s.0], Test::Latency { .. });
    let late: Vec<_> = scored.iter().copied().filter(is_late).collect();
    scored.retain(|s| !is_late(s));
    let Some((&(_, _, common, both), groups)) = late.split_first() else {
        return;
    };
    let chi2 = map.chi2 - common * common * both;
    for pair in groups.chunks_exact(2) {
        let [(test, _, own, h1), (_, _, rest, h2)] = [pair[0], pair[1]];
        let cross = 0.5 * (both - h1 - h2);
        let determinant = h1 * h2 - cross * cross;
        let h = determinant / both;
        // Columns that the geometry explains altogether test nothing.
        if !(h.is_finite() && h > 1e-9 * h1.max(h2) && chi2 > 0.0) {
            continue;
        }
        // g = −k h of each alone
        let (g1, g2) = (-own * h1, -rest * h2);
        let seconds = ((h1 + cross) * g2 - (h2 + cross) * g1) / determinant;
        let explained = (seconds * seconds * h).min(chi2 * (1.0 - 1e-12));
        let statistic = map.freedom * (chi2 / (chi2 - explained)).ln();
        scored.push((test, statistic, seconds, h));
    }
}

fn tests(data: &Data, clocks_estimated: bool) -> Vec<Test> {
    let joints = data.relevant_joints();
    let mut tests = Vec::new();
    for &joint in &joints {
        for &source in joints.iter().filter(|s| span(data, **s) > 0.0) {
            tests.push(Test::Reading { joint, source });
        }
    }
    let known = data.recording.iter().zip(&data.rates);
    let timed: BTreeSet<RecordingIndex> = known
        .filter_map(|(recording, rates)| rates.as_ref().map(|_| *recording))
        .collect();
    tests.extend(joints.into_iter().map(|joint| Test::Zero { joint }));
    let moving = data.moving_joints();
    tests.extend(timed.into_iter().map(|recording| Test::Lag { recording }));
    // Of one joint that moves it is the lag of the recording.
    if moving.len() > 1 {
        tests.extend(late(data, &moving, clocks_estimated));
    }
    tests
}

/// Each joint alone, and each with those that it carries: a wrist, an arm or a hand with a controller of its own.
/// Where the clocks are estimated, all together first, and the others behind each.
fn late(data: &Data, moving: &[JointIndex], clocks_estimated: bool) -> Vec<Test> {
    let mut groups: Vec<Vec<JointIndex>> = moving.iter().map(|joint| vec![*joint]).collect();
    let together = moving.iter().map(|joint| data.moving_with(*joint));
    groups.extend(together.filter(|group| group.len() > 1 && group.len() < moving.len()));
    if clocks_estimated {
        let mut with_others = vec![moving.to_vec()];
        for group in groups {
            let others = moving.iter().filter(|joint| !group.contains(joint));
            let others: Vec<JointIndex> = others.copied().collect();
            // The same test with the other sign.
            if !with_others.contains(&others) {
                with_others.extend([group, others]);
            }
        }
        groups = with_others;
    }
    let late = groups.into_iter();
    late.map(|joints| Test::Latency { joints }).collect()
}

/// (test, T, k̂, h) for every test.
fn score_tests(model: &Model<'_>, sums: &Sums, map: &Map) -> Vec<(usize, f64, f64, f64)> {
    let p = model.registration + 6 * model.geometry.len();
    let count = model.tests.len();
    let root = map.root.transpose();
    let taken = |first: usize| -> Vec<f64> {
        let cross = sums.cross.view((0, first), (p, CHUNK.min(count - first)));
        let half = &root * cross;
        half.column_iter().map(|c| c.norm_squared()).collect()
    };
    let firsts: Vec<usize> = (0..count).step_by(CHUNK).collect();
    let taken: Vec<f64> = firsts.into_par_iter().flat_map_iter(taken).collect();
    (0..count)
        .map(|t| {
            let own = sums.own[t];
            let h = own - taken[t];
            let g = sums.cross[(p, t)] + sums.cross.view((0, t), (p, 1)).dot(&map.x);
            // A column that the geometry explains altogether tests nothing.
            if h <= 1e-9 * own || own <= 0.0 {
                return (t, 0.0, 0.0, f64::INFINITY);
            }
            let explained = (g * g / h).min(map.chi2 * (1.0 - 1e-12));
            // r + A x + G k is minimal at k = −g/h; the correction is reading += k reading_source
            let statistic = map.freedom * (map.chi2 / (map.chi2 - explained)).ln();
            (t, statistic, -g / h, h)
        })
        .collect()
}

/// T that the largest of all tests exceeds with probability `level` times their number.
fn threshold(level: f64, freedom: f64) -> f64 {
    let f = FisherSnedecor::new(1.0, freedom).map_or(1e3, |d| d.inverse_cdf(1.0 - level));
    // g²/h = χ² F/(F + ν)
    freedom * (1.0 + f / freedom).ln()
}
