//! The choice of the samples that belong: subsets, refinement, rivals, members in part.

use calib_estimator::{Options, Verdict};
use nalgebra::Vector3;

use super::{
    Model,
    evidence::{Best, Evidence, surprising},
};
use crate::{
    outcome::{Outcome, RejectReason, Rejected},
    seeded::Seeded,
};

/// Samples that score a subset; more would not rank subsets better.
const SCORED: usize = 1000;
/// Candidates that are refitted.
const REFINED: usize = 24;
/// Rounds of refitting a candidate, and of sharing samples between the classes.
const ROUNDS: usize = 30;
/// Difference of costs (natural logarithm of the odds) within which another center is a rival: 100 to 1.
const RIVAL: f64 = 4.6;

/// Samples that belong together.
struct Chosen<E> {
    cost: f64,
    even: Option<f64>,
    keep: Vec<bool>,
    estimate: E,
}

/// Refits to the samples of least cost until they stand still.
fn settle<M: Model>(
    model: &M,
    evidence: &Evidence,
    start: M::Estimate,
) -> Option<Chosen<M::Estimate>> {
    let n = model.samples();
    let mut estimate = start;
    let mut chosen: Option<Chosen<M::Estimate>> = None;
    for _ in 0..ROUNDS {
        let squares: Vec<f64> = (0..n).map(|k| model.square(&estimate, k)).collect();
        let mut order: Vec<usize> = (0..n).collect();
        order.sort_by(|a, b| squares[*a].total_cmp(&squares[*b]));
        let sorted: Vec<f64> = order.iter().map(|k| squares[*k]).collect();
        let Best { cost, count, even } = evidence.best(&sorted);
        if !cost.is_finite() {
            break;
        }
        let mut keep = vec![false; n];
        for k in &order[..count] {
            keep[*k] = true;
        }
        let settled = chosen.as_ref().is_some_and(|c| c.keep == keep);
        if chosen.as_ref().is_none_or(|c| cost < c.cost) {
            chosen = Some(Chosen {
                cost,
                even,
                keep: keep.clone(),
                estimate: estimate.clone(),
            });
        } else {
            break;
        }
        if settled {
            break;
        }
        let weights: Vec<f64> = keep.iter().map(|k| f64::from(u8::from(*k))).collect();
        match model.weighted(&estimate, &weights) {
            Some(next) => estimate = next,
            None => break,
        }
    }
    chosen
}

/// All samples, as a choice.
fn everything<M: Model>(
    model: &M,
    evidence: &Evidence,
    start: Option<&M::Estimate>,
) -> Option<Chosen<M::Estimate>> {
    let n = model.samples();
    let estimate = model.weighted(start?, &vec![1.0; n])?;
    let rss = (0..n).map(|k| model.square(&estimate, k)).sum();
    if evidence.components * n <= evidence.unknowns {
        return None;
    }
    Some(Chosen {
        cost: evidence.cost(rss, 0.0, n, n),
        even: None,
        keep: vec![true; n],
        estimate,
    })
}

/// What the choice of samples came to.
pub(super) struct Choice {
    pub keep: Vec<bool>,
    /// Residuals over the noise.
    sigmas: Vec<f64>,
    gate_sigmas: f64,
    /// ln of the number of ways to choose as many samples.
    pub ln_choices: f64,
}

/// Why there is none.
pub(super) enum NoChoice {
    NoSubset,
    Rival {
        off: f64,
        cost: f64,
    },
    /// What is left has fewer degrees of freedom than the fit has unknowns.
    FewLeft {
        kept: usize,
        free: usize,
        unknowns: usize,
    },
    /// An error of this sample, too small to be seen, takes the center that far.
    Unchecked {
        sample: usize,
        shift: f64,
    },
}

/// The samples that belong, or why that cannot be decided. With `shared`, samples belong in part before it is decided.
pub(super) fn choose<M: Model>(
    model: &M,
    options: &Options,
    shared: bool,
) -> Result<Choice, NoChoice> {
    let n = model.samples();
    let evidence = Evidence::of(model, options.sigma_t);
    let settled = settled(model, &evidence, options);
    let best = without_rival(model, &settled, options)?;
    let weights = flags(&best.keep);
    let count = best.keep.iter().filter(|k| **k).count();
    let squares = squares(model, &best.estimate);
    let variance = evidence.variance(rss(&squares, &weights), count as f64);
    let mut members = Members {
        keep: best.keep.clone(),
        estimate: best.estimate.clone(),
        squares,
        variance,
    };
    let weighed = shared && count < n;
    if weighed {
        share(model, &evidence, best.even, &mut members);
    }
    // Real noise has longer tails than the normal: what would not surprise among so many samples belongs. Not so where the classes were
    // weighed against each other sample by sample: an outlier near the others would come back in.
    let surprising = surprising(M::COMPONENTS, n);
    let gate = if weighed { None } else { Some(surprising) };
    refit(model, &evidence, gate, &mut members);
    confirmed(model, &evidence, options, &members)?;
    let kept = members.keep.iter().filter(|k| **k).count();
    Ok(Choice {
        sigmas: members
            .squares
            .iter()
            .map(|d| (d / members.variance).sqrt())
            .collect(),
        gate_sigmas: surprising.sqrt(),
        ln_choices: evidence.ln_choices(n, kept),
        keep: members.keep,
    })
}

/// Random subsets, the best of them refined, and all samples at once; the cheapest first.
fn settled<M: Model>(
    model: &M,
    evidence: &Evidence,
    options: &Options,
) -> Vec<Chosen<M::Estimate>> {
    let mut settled: Vec<Chosen<M::Estimate>> = Vec::new();
    for start in candidates(model, evidence, options) {
        if let Some(found) = settle(model, evidence, start)
            && settled.iter().all(|other| other.keep != found.keep)
        {
            settled.push(found);
        }
    }
    settled.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    // Nothing is rejected without need: outliers have to be evident.
    if let Some(all) = everything(model, evidence, settled.first().map(|c| &c.estimate))
        && settled
            .first()
            .is_some_and(|best| all.cost - best.cost < RIVAL)
    {
        settled.retain(|other| other.keep != all.keep);
        settled.insert(0, all);
    }
    settled
}

/// Estimates from random subsets, those of least cost, and the one from all samples.
fn candidates<M: Model>(model: &M, evidence: &Evidence, options: &Options) -> Vec<M::Estimate> {
    let n = model.samples();
    let mut random = Seeded::new(options.seed);
    let stride = n.div_ceil(SCORED);
    let mut candidates: Vec<(f64, M::Estimate)> = Vec::new();
    let mut scored = Vec::with_capacity(n / stride + 1);
    for _ in 0..options.subsets {
        let Some(candidate) = model.subset_fit(&mut random) else {
            continue;
        };
        scored.clear();
        scored.extend((0..n).step_by(stride).map(|k| model.square(&candidate, k)));
        scored.sort_unstable_by(f64::total_cmp);
        let Best { cost, .. } = evidence.best(&scored);
        if cost.is_finite() {
            candidates.push((cost, candidate));
        }
    }
    candidates.sort_by(|a, b| a.0.total_cmp(&b.0));
    candidates.truncate(REFINED);
    // All samples at once are a candidate too: where there are no outliers, it is the answer.
    let all = candidates
        .first()
        .and_then(|(_, start)| model.weighted(start, &vec![1.0; n]));
    candidates
        .into_iter()
        .map(|(_, estimate)| estimate)
        .chain(all)
        .collect()
}

/// The cheapest choice, unless another center is almost as likely.
fn without_rival<'a, M: Model>(
    model: &M,
    settled: &'a [Chosen<M::Estimate>],
    options: &Options,
) -> Result<&'a Chosen<M::Estimate>, NoChoice> {
    let best = settled.first().ok_or(NoChoice::NoSubset)?;
    let (center, size) = model.center(&best.estimate);
    for rival in &settled[1..] {
        let off = (model.center(&rival.estimate).0 - center).norm();
        if (rival.cost - best.cost).abs() < RIVAL && off > options.weak_fraction * size {
            return Err(NoChoice::Rival {
                off,
                cost: (rival.cost - best.cost).abs(),
            });
        }
    }
    Ok(best)
}

/// The samples that belong, with their fit.
struct Members<E> {
    keep: Vec<bool>,
    estimate: E,
    /// `|residual|²` of every sample.
    squares: Vec<f64>,
    /// Of one component.
    variance: f64,
}

fn squares<M: Model>(model: &M, estimate: &M::Estimate) -> Vec<f64> {
    (0..model.samples())
        .map(|k| model.square(estimate, k))
        .collect()
}

fn rss(squares: &[f64], weights: &[f64]) -> f64 {
    squares.iter().zip(weights).map(|(d, w)| d * w).sum()
}

fn flags(keep: &[bool]) -> Vec<f64> {
    keep.iter().map(|k| f64::from(u8::from(*k))).collect()
}

/// Expectation and maximization: every sample belongs with the probability of its odds.
fn share<M: Model>(
    model: &M,
    evidence: &Evidence,
    even: Option<f64>,
    members: &mut Members<M::Estimate>,
) {
    let n = model.samples();
    let mut estimate = members.estimate.clone();
    let mut weights = flags(&members.keep);
    let mut total: f64 = weights.iter().sum();
    for _ in 0..ROUNDS {
        // P(belongs) = 1/(1 + e^−odds)
        let next: Vec<f64> = members
            .squares
            .iter()
            .map(|d| 1.0 / (1.0 + (-evidence.odds(*d, even, members.variance, total, n)).exp()))
            .collect();
        let Some(fitted) = model.weighted(&estimate, &next) else {
            break;
        };
        let sum: f64 = next.iter().sum();
        if sum * M::COMPONENTS as f64 <= evidence.unknowns as f64 + 0.5 {
            break;
        }
        let change = next
            .iter()
            .zip(&weights)
            .map(|(a, b)| (a - b).abs())
            .fold(0.0, f64::max);
        estimate = fitted;
        weights = next;
        total = sum;
        members.squares = squares(model, &estimate);
        members.variance = evidence.variance(rss(&members.squares, &weights), total);
        if change < 1e-9 {
            break;
        }
    }
    let belongs: Vec<bool> = weights.iter().map(|w| *w > 0.5).collect();
    if belongs.iter().filter(|k| **k).count() >= evidence.fewest(n) {
        members.keep = belongs;
    }
}

/// Refits to the members; with a gate, samples within it are added until they stand still.
fn refit<M: Model>(
    model: &M,
    evidence: &Evidence,
    gate: Option<f64>,
    members: &mut Members<M::Estimate>,
) {
    for _ in 0..ROUNDS {
        let flags = flags(&members.keep);
        let Some(fitted) = model.weighted(&members.estimate, &flags) else {
            break;
        };
        members.estimate = fitted;
        members.squares = squares(model, &members.estimate);
        members.variance = evidence.variance(rss(&members.squares, &flags), flags.iter().sum());
        let grown: Vec<bool> = members
            .squares
            .iter()
            .zip(&members.keep)
            .map(|(d, kept)| *kept || gate.is_some_and(|gate| *d <= gate * members.variance))
            .collect();
        if grown == members.keep {
            break;
        }
        members.keep = grown;
    }
}

/// Where samples were rejected: enough degrees of freedom are left, and no single sample decides where the center is.
fn confirmed<M: Model>(
    model: &M,
    evidence: &Evidence,
    options: &Options,
    members: &Members<M::Estimate>,
) -> Result<(), NoChoice> {
    let n = model.samples();
    let kept = members.keep.iter().filter(|k| **k).count();
    if kept == n {
        return Ok(());
    }
    let free = (M::COMPONENTS * kept).saturating_sub(evidence.unknowns);
    if evidence.sigma.is_none() && free < evidence.unknowns {
        return Err(NoChoice::FewLeft {
            kept,
            free,
            unknowns: evidence.unknowns,
        });
    }
    // Known to one σ only: as a center whose σ is that large is weak. The fitted size may be wrong itself, what was seen is not.
    let (_, size) = model.center(&members.estimate);
    let limit = options.weak_fraction * size.min(spread(model, &members.keep));
    // |C J_k| σ/√(1 − h_k)
    let worst = model
        .influence(&members.estimate, &members.keep)
        .into_iter()
        .map(|(k, redundancy, shift)| {
            let hidden = (members.variance / redundancy.max(1e-12)).sqrt();
            (k, shift * hidden)
        })
        .max_by(|a, b| a.1.total_cmp(&b.1));
    match worst {
        Some((sample, shift)) if shift > limit => Err(NoChoice::Unchecked {
            sample,
            shift: shift * surprising(M::COMPONENTS, n).sqrt(),
        }),
        _ => Ok(()),
    }
}

/// Root mean square distance of the kept samples from their mean.
fn spread<M: Model>(model: &M, keep: &[bool]) -> f64 {
    let places = || (0..keep.len()).filter(|k| keep[*k]).map(|k| model.place(k));
    let count = places().count().max(1) as f64;
    let mean = places().sum::<Vector3<f64>>() / count;
    (places().map(|x| (x - mean).norm_squared()).sum::<f64>() / count).sqrt()
}

/// The samples that do not belong; `label` gives marker and row.
pub(super) fn rejected(choice: &Choice, label: impl Fn(usize) -> (usize, usize)) -> Vec<Rejected> {
    (0..choice.keep.len())
        .filter(|&k| !choice.keep[k])
        .map(|k| {
            let (marker, row) = label(k);
            let reason = RejectReason::Outlier {
                residual_sigmas: choice.sigmas[k],
                gate_sigmas: choice.gate_sigmas,
            };
            Rejected {
                marker,
                row,
                reason,
            }
        })
        .collect()
}

/// The outcome where there is no choice.
pub(super) fn no_choice(estimator: &'static str, n: usize, why: &NoChoice) -> Outcome {
    let reason = match why {
        NoChoice::NoSubset => {
            format!("no subset of the {n} samples gives a center that others agree with")
        }
        NoChoice::FewLeft {
            kept,
            free,
            unknowns,
        } => format!(
            "{kept} of {n} samples belong together: {free} degrees of freedom beyond {unknowns} unknowns are too few to tell the noise \
             from a lucky choice: more samples, or state the noise"
        ),
        NoChoice::Unchecked { sample, shift } => format!(
            "with outliers about, the center rests on sample {sample} (of those seen, from 0), which no other one confirms: an error of it that nobody \
             would see takes the center {shift:.3e} away"
        ),
        NoChoice::Rival { off, cost } => format!(
            "two centers {off:.3e} apart explain the {n} samples about equally well (odds {:.0} to 1, \
             100 to 1 are needed): too few samples for so many outliers, or state the noise",
            cost.exp()
        ),
    };
    Outcome::NotObservable(crate::outcome::NotObservable {
        estimator,
        verdict: Verdict::NotUnique,
        reason,
        known: crate::outcome::Known::Nothing,
    })
}
