//! Outliers: which samples belong to the joint is decided by the evidence for each choice, then they are fitted plainly.
//!
//! ```text
//! h of n samples are within the noise, the others either off by any order of magnitude alike, or anywhere as far as the farthest:
//! density 1/(S_q |d|^q D) or 1/(V_q d_max^q), whichever explains them better. Residuals of q components, p unknowns, ν = qh − p, RSS their squares.  σ integrated out with the prior 1/σ:
//! cost(h) = ν/2 ln(π RSS) − ln Γ(ν/2) − Σ_out ln density + ln C(n, h)                              (1)
//! cost(h) = RSS/2σ² + ν ln(σ√2π)      − Σ_out ln density + ln C(n, h)        where σ is stated        (2)
//! S₁ = V₁ = 2,  S₃ = 4π,  V₃ = 4π/3,  D = ln 10⁴: four decades;   h ≥ (n + p/q + 1)/2
//! ```
//!
//! Subsets give candidates; each is refitted to the samples of least cost until they stand still, the cheapest wins (`consensus`).
//! `robust` then lets every sample belong in part (expectation and maximisation over the same two classes) before it decides, and fits by
//! maximum likelihood, so that the covariance is valid. For `consensus` every sample belongs in the end whose residual would not surprise among n (χ², one
//! recording in twenty). Metres or millimetres do not matter.
//!
//! Where another center explains the samples almost as well (cost within `RIVAL`) the answer is that there is none: this is where the
//! method breaks down, and it says so (nine points with three outliers leave two degrees of freedom). Likewise where, with some left out, fewer degrees of
//! freedom are left than there are unknowns and the noise is not stated; and where the center rests on one sample that no other confirms: with redundancy
//! 1 − h_k (leverage h_k) an error of σ/√(1 − h_k) hides in the noise and takes the center |C J_k|σ/√(1 − h_k) away (external reliability, Baarda 1968);
//! beyond `weak_fraction` of the size nobody can know which sample is the wrong one. A choice of h among n samples makes a circle look
//! less planar by chance: the test of one axis is therefore made at `significance / C(n, h)`.
//! Torr & Zisserman 2000 (MSAC); Moisan & Stival 2004 (a threshold from the data); Dempster et al. 1977.

use calib_estimator::{
    Verdict,
    chance::chi2_tail,
    measured::{Cloud, Pose, RowWeights},
};
use calib_geometry::decompose::symmetric_eigen_small;
use nalgebra::{Matrix3, Matrix4, Vector3, Vector4};

use crate::{
    hotspot, hotspot_ml,
    outcome::{Outcome, RejectReason, Rejected},
    seeded::Seeded,
    sphere::prepare,
    sphere_ml,
};
use calib_estimator::{EstimatorError, Input, Options, cloud_of};

/// Samples that score a subset; more would not rank subsets better.
const SCORED: usize = 1000;
/// Candidates that are refitted.
const REFINED: usize = 24;
/// Rounds of refitting a candidate, and of sharing samples between the classes.
const ROUNDS: usize = 30;
/// Difference of costs (natural logarithm of the odds) within which another center is a rival: 100 to 1.
const RIVAL: f64 = 4.6;
/// ln D: outliers spread over four decades.
const DECADES: f64 = 2.22;
/// −ln of the prior of a scale that the outliers share.
const SCALE: f64 = 3.0;
/// An outlier is never more likely than at this many σ: closer ones are not told from the noise.
const NEAREST: f64 = 3.0;
/// Part of the data's size below which residuals are rounding.
const EXACT: f64 = 1e-12;

/// Robust fit: spheres for points and markers, hot spot for poses.
///
/// # Errors
/// [`EstimatorError`] for data that are not finite, not rotations, or of another kind.
pub fn robust(input: &Input<'_>, options: &Options) -> Result<Outcome, EstimatorError> {
    dispatch("robust", input, options, true)
}

/// Consensus alone, inliers refitted: spheres for points and markers, the linear hot spot for poses
/// (what the field calls RANSAC pivot calibration).
///
/// # Errors
/// As [`robust`].
pub fn consensus(input: &Input<'_>, options: &Options) -> Result<Outcome, EstimatorError> {
    dispatch("consensus", input, options, false)
}

fn dispatch(
    estimator: &'static str,
    input: &Input<'_>,
    options: &Options,
    reweight: bool,
) -> Result<Outcome, EstimatorError> {
    options.check()?;
    match input {
        Input::Poses(poses) => poses_fit(estimator, poses, options, reweight),
        _ => points_fit(estimator, input, options, reweight),
    }
}

/// A model that can be fitted with weights and measured against each sample.
trait Model {
    type Estimate: Clone;
    /// Components of a residual.
    const COMPONENTS: usize;
    /// Unknowns.
    fn unknowns(&self) -> usize;
    fn samples(&self) -> usize;
    /// Where sample k is.
    fn place(&self, k: usize) -> Vector3<f64>;
    fn subset_fit(&self, random: &mut Seeded) -> Option<Self::Estimate>;
    /// `|residual|²` of sample k, as of one of weight 1.
    fn square(&self, estimate: &Self::Estimate, k: usize) -> f64;
    fn weighted(&self, start: &Self::Estimate, weights: &[f64]) -> Option<Self::Estimate>;
    /// What an error of one of the samples that are kept does, where a single one may decide: for each (sample, redundancy, shift).
    /// Redundancy is the part of the error's square that its own residual shows, shift how far an error of one unit takes the center.
    fn influence(&self, estimate: &Self::Estimate, keep: &[bool]) -> Vec<(usize, f64, f64)>;
    /// The center, and the size of the joint: a center further off than a tenth of it is another one.
    fn center(&self, estimate: &Self::Estimate) -> (Vector3<f64>, f64);
}

/// Costs (1) and (2).
struct Evidence {
    components: usize,
    unknowns: usize,
    sigma: Option<f64>,
    /// ln S_q + ln D.
    spread: f64,
    /// ln V_q.
    volume: f64,
    /// Smallest square that is not rounding.
    floor: f64,
    /// ln Γ(k/2), k = 0, 1, …
    half_gamma: Vec<f64>,
}

impl Evidence {
    fn of<M: Model>(model: &M, stated: Option<f64>) -> Self {
        let n = model.samples();
        let middle =
            Vector3::from_fn(|i, _| median(&(0..n).map(|k| model.place(k)[i]).collect::<Vec<_>>()));
        let reach = (0..n)
            .map(|k| (model.place(k) - middle).norm())
            .fold(0.0, f64::max);
        let region = (2.0 * reach).max(f64::MIN_POSITIVE.sqrt());
        let mut half_gamma = vec![0.0, std::f64::consts::PI.sqrt().ln(), 0.0];
        for k in 3..=(M::COMPONENTS.max(2) * n + 2) {
            let x: f64 = half_gamma[k - 2] + (k as f64 / 2.0 - 1.0).ln();
            half_gamma.push(x);
        }
        Self {
            components: M::COMPONENTS,
            unknowns: model.unknowns(),
            sigma: if M::COMPONENTS == 1 { stated } else { None },
            spread: DECADES
                + if M::COMPONENTS == 1 {
                    2.0_f64.ln()
                } else {
                    (4.0 * std::f64::consts::PI).ln()
                },
            volume: if M::COMPONENTS == 1 {
                2.0_f64.ln()
            } else {
                (4.0 * std::f64::consts::PI / 3.0).ln()
            },
            floor: (EXACT * region).powi(2),
            half_gamma,
        }
    }

    /// Fewest samples that can be called the majority: those left out are no more than what the others have to spare.
    fn fewest(&self, n: usize) -> usize {
        (n + self.unknowns.div_ceil(self.components))
            .div_ceil(2)
            .min(n)
    }

    fn ln_choices(&self, n: usize, h: usize) -> f64 {
        let ln_factorial = |k: usize| self.half_gamma[2 * k + 2];
        ln_factorial(n) - ln_factorial(h) - ln_factorial(n - h)
    }

    /// −ln density of an outlier of any order of magnitude.
    fn outside(&self, square: f64) -> f64 {
        self.spread + self.ln_length(square)
    }

    /// ln |d|^q.
    fn ln_length(&self, square: f64) -> f64 {
        0.5 * self.components as f64 * square.max(self.floor).ln()
    }

    /// `outside` is the cost of those left out.
    fn cost(&self, rss: f64, outside: f64, h: usize, n: usize) -> f64 {
        let free = self.components * h - self.unknowns;
        let rss = rss.max(self.floor * h as f64);
        let noise = match self.sigma {
            None => 0.5 * free as f64 * (std::f64::consts::PI * rss).ln() - self.half_gamma[free],
            Some(sigma) => {
                rss / (2.0 * sigma * sigma)
                    + free as f64 * (sigma * (2.0 * std::f64::consts::PI).sqrt()).ln()
            }
        };
        noise + outside + self.ln_choices(n, h)
    }

    /// Least cost over the number of samples, those of least residual first.
    fn best(&self, sorted: &[f64]) -> Best {
        let n = sorted.len();
        let fewest = self.fewest(n);
        let farthest = sorted.last().copied().unwrap_or(0.0);
        let even = self.volume + self.ln_length(farthest);
        let mut rss = 0.0;
        let mut outside: f64 = sorted.iter().map(|d| self.outside(*d)).sum();
        let mut best = Best {
            cost: f64::INFINITY,
            count: n,
            even: None,
        };
        for (k, square) in sorted.iter().enumerate() {
            rss += square;
            outside -= self.outside(*square);
            let count = k + 1;
            if count < fewest || self.components * count <= self.unknowns {
                continue;
            }
            let left = (n - count) as f64;
            let evenly = if count < n {
                left * even + (self.components as f64 * left).ln() + SCALE
            } else {
                f64::INFINITY
            };
            let cost = self.cost(rss, outside.min(evenly), count, n);
            if cost < best.cost {
                best = Best {
                    cost,
                    count,
                    even: (evenly < outside).then_some(even),
                };
            }
        }
        best
    }

    /// ln of the odds that a sample belongs, when `total` of n do.
    fn odds(&self, square: f64, even: Option<f64>, variance: f64, total: f64, n: usize) -> f64 {
        let out = (n as f64 - total).max(0.5);
        (total / out).ln()
            - 0.5 * self.components as f64 * (2.0 * std::f64::consts::PI * variance).ln()
            - square / (2.0 * variance)
            + even.unwrap_or_else(|| self.outside(square.max(NEAREST * NEAREST * variance)))
    }

    /// Variance of one component among the chosen.
    fn variance(&self, rss: f64, count: f64) -> f64 {
        match self.sigma {
            Some(sigma) => sigma * sigma,
            None => rss / (self.components as f64 * count - self.unknowns as f64).max(0.5),
        }
        .max(self.floor)
        .max(f64::MIN_POSITIVE)
    }
}

/// The best number of samples.
struct Best {
    cost: f64,
    count: usize,
    /// −ln density of the outliers where they are spread evenly, else by orders of magnitude.
    even: Option<f64>,
}

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
struct Choice {
    keep: Vec<bool>,
    /// Residuals over the noise.
    sigmas: Vec<f64>,
    gate_sigmas: f64,
    /// ln of the number of ways to choose as many samples.
    ln_choices: f64,
}

/// Why there is none.
enum NoChoice {
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

fn choose<M: Model>(model: &M, options: &Options, shared: bool) -> Result<Choice, NoChoice> {
    let n = model.samples();
    let evidence = Evidence::of(model, options.sigma_t);
    let mut random = Seeded::new(options.seed);
    let stride = n.div_ceil(SCORED);
    // All samples at once are a candidate too: where there are no outliers, it is the answer.
    let mut candidates: Vec<(f64, M::Estimate)> = Vec::new();
    let mut scored = Vec::with_capacity(n / stride + 1);
    let mut offer = |candidate: M::Estimate, candidates: &mut Vec<(f64, M::Estimate)>| {
        scored.clear();
        scored.extend((0..n).step_by(stride).map(|k| model.square(&candidate, k)));
        scored.sort_unstable_by(f64::total_cmp);
        let Best { cost, .. } = evidence.best(&scored);
        if cost.is_finite() {
            candidates.push((cost, candidate));
        }
    };
    for _ in 0..options.subsets {
        if let Some(candidate) = model.subset_fit(&mut random) {
            offer(candidate, &mut candidates);
        }
    }
    candidates.sort_by(|a, b| a.0.total_cmp(&b.0));
    candidates.truncate(REFINED);
    if let Some(all) = candidates
        .first()
        .and_then(|(_, start)| model.weighted(start, &vec![1.0; n]))
    {
        candidates.push((0.0, all));
    }
    let mut settled: Vec<Chosen<M::Estimate>> = Vec::new();
    for (_, start) in candidates {
        if let Some(found) = settle(model, &evidence, start)
            && settled.iter().all(|other| other.keep != found.keep)
        {
            settled.push(found);
        }
    }
    settled.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    // Nothing is left out without need: outliers have to be evident.
    if let Some(all) = everything(model, &evidence, settled.first().map(|c| &c.estimate))
        && settled
            .first()
            .is_some_and(|best| all.cost - best.cost < RIVAL)
    {
        settled.retain(|other| other.keep != all.keep);
        settled.insert(0, all);
    }
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

    let count = best.keep.iter().filter(|k| **k).count();
    let mut squares: Vec<f64> = (0..n).map(|k| model.square(&best.estimate, k)).collect();
    let rss = |squares: &[f64], weights: &[f64]| -> f64 {
        squares.iter().zip(weights).map(|(d, w)| d * w).sum()
    };
    let mut weights: Vec<f64> = best.keep.iter().map(|k| f64::from(u8::from(*k))).collect();
    let mut total = count as f64;
    let mut variance = evidence.variance(rss(&squares, &weights), total);
    let mut keep = best.keep.clone();
    if shared && count < n {
        let mut estimate = best.estimate.clone();
        for _ in 0..ROUNDS {
            let next: Vec<f64> = squares
                .iter()
                .map(|d| 1.0 / (1.0 + (-evidence.odds(*d, best.even, variance, total, n)).exp()))
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
            squares = (0..n).map(|k| model.square(&estimate, k)).collect();
            variance = evidence.variance(rss(&squares, &weights), total);
            if change < 1e-9 {
                break;
            }
        }
        let belongs: Vec<bool> = weights.iter().map(|w| *w > 0.5).collect();
        if belongs.iter().filter(|k| **k).count() >= evidence.fewest(n) {
            keep = belongs;
        }
    }
    // Real noise has longer tails than the normal: what would not surprise among so many samples belongs. Not so where the classes were
    // weighed against each other sample by sample: an outlier near the others would come back in.
    let grows = !(shared && count < n);
    let surprising = surprising(M::COMPONENTS, n);
    let mut estimate = best.estimate.clone();
    for _ in 0..ROUNDS {
        let flags: Vec<f64> = keep.iter().map(|k| f64::from(u8::from(*k))).collect();
        let Some(fitted) = model.weighted(&estimate, &flags) else {
            break;
        };
        estimate = fitted;
        squares = (0..n).map(|k| model.square(&estimate, k)).collect();
        variance = evidence.variance(rss(&squares, &flags), flags.iter().sum());
        let grown: Vec<bool> = squares
            .iter()
            .zip(&keep)
            .map(|(d, kept)| *kept || (grows && *d <= surprising * variance))
            .collect();
        if grown == keep {
            break;
        }
        keep = grown;
    }
    let kept = keep.iter().filter(|k| **k).count();
    if kept < n {
        let free = (M::COMPONENTS * kept).saturating_sub(evidence.unknowns);
        if evidence.sigma.is_none() && free < evidence.unknowns {
            return Err(NoChoice::FewLeft {
                kept,
                free,
                unknowns: evidence.unknowns,
            });
        }
        // Known to one σ only: as a center whose σ is that large is weak. The fitted size may be wrong itself, what was seen is not.
        let (_, size) = model.center(&estimate);
        let limit = options.weak_fraction * size.min(spread(model, &keep));
        let worst = model
            .influence(&estimate, &keep)
            .into_iter()
            .map(|(k, redundancy, shift)| (k, shift * (variance / redundancy.max(1e-12)).sqrt()))
            .max_by(|a, b| a.1.total_cmp(&b.1));
        if let Some((sample, shift)) = worst
            && shift > limit
        {
            let shift = shift * surprising.sqrt();
            return Err(NoChoice::Unchecked { sample, shift });
        }
    }
    Ok(Choice {
        sigmas: squares.iter().map(|d| (d / variance).sqrt()).collect(),
        gate_sigmas: surprising.sqrt(),
        ln_choices: evidence.ln_choices(n, kept),
        keep,
    })
}

/// Root mean square distance of the kept samples from their mean.
fn spread<M: Model>(model: &M, keep: &[bool]) -> f64 {
    let places = || (0..keep.len()).filter(|k| keep[*k]).map(|k| model.place(k));
    let count = places().count().max(1) as f64;
    let mean = places().sum::<Vector3<f64>>() / count;
    (places().map(|x| (x - mean).norm_squared()).sum::<f64>() / count).sqrt()
}

/// The square of a normal residual of so many components that the largest of n exceeds once in twenty recordings.
fn surprising(components: usize, n: usize) -> f64 {
    let chance = 0.05 / n.max(1) as f64;
    let (mut low, mut high) = (0.0, 1000.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if chi2_tail(middle, components as f64) > chance {
            low = middle;
        } else {
            high = middle;
        }
    }
    high
}

fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    let middle = sorted.len() / 2;
    if sorted.is_empty() {
        return f64::NAN;
    }
    *sorted.select_nth_unstable_by(middle, f64::total_cmp).1
}

fn rejected(choice: &Choice, label: impl Fn(usize) -> (usize, usize)) -> Vec<Rejected> {
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

fn no_choice(estimator: &'static str, n: usize, why: &NoChoice) -> Outcome {
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

// ---- spheres -------------------------------------------------------------------------------------------

struct Spheres<'a> {
    cloud: &'a Cloud,
    marker_of: Vec<usize>,
}

impl Model for Spheres<'_> {
    type Estimate = (Vector3<f64>, Vec<f64>);
    const COMPONENTS: usize = 1;

    fn unknowns(&self) -> usize {
        3 + self.cloud.markers()
    }

    fn samples(&self) -> usize {
        self.cloud.points.len()
    }

    fn place(&self, k: usize) -> Vector3<f64> {
        self.cloud.points[k]
    }

    fn center(&self, (center, radii): &Self::Estimate) -> (Vector3<f64>, f64) {
        (
            *center,
            radii.iter().sum::<f64>() / radii.len().max(1) as f64,
        )
    }

    /// Four samples of one marker give a center; the radii are the medians of the distances.
    fn subset_fit(&self, random: &mut Seeded) -> Option<Self::Estimate> {
        let marker = self.marker_of[random.below(self.samples())];
        let points = self.cloud.marker(marker);
        if points.len() < 4 {
            return None;
        }
        let chosen = random.subset::<4>(points.len());
        // 2 m·x − c = |x|²
        let a = Matrix4::from_fn(|i, j| {
            if j < 3 {
                2.0 * points[chosen[i]][j]
            } else {
                -1.0
            }
        });
        let b = Vector4::from_fn(|i, _| points[chosen[i]].norm_squared());
        let x = a.lu().solve(&b)?;
        let center: Vector3<f64> = x.fixed_rows::<3>(0).into();
        let radii = (0..self.cloud.markers())
            .map(|p| {
                let lengths: Vec<f64> = self
                    .cloud
                    .marker(p)
                    .iter()
                    .map(|x| (x - center).norm())
                    .collect();
                median(&lengths)
            })
            .collect();
        Some((center, radii))
    }

    fn square(&self, (center, radii): &Self::Estimate, k: usize) -> f64 {
        let e = (self.cloud.points[k] - center).norm() - radii[self.marker_of[k]];
        self.cloud.weight(k) * e * e
    }

    /// Unknowns are the center and the radius of each marker, so that a sample's line is `[−u, 0, …, −1, …, 0]`.
    fn influence(&self, (center, _): &Self::Estimate, keep: &[bool]) -> Vec<(usize, f64, f64)> {
        let mut kept: Vec<(usize, Vector3<f64>)> = Vec::new();
        let mut means = vec![(Vector3::zeros(), 0.0); self.cloud.markers()];
        for k in (0..self.samples()).filter(|k| keep[*k]) {
            let u = (self.cloud.points[k] - center)
                .try_normalize(0.0)
                .unwrap_or_default();
            let w = self.cloud.weight(k);
            let (sum, total) = &mut means[self.marker_of[k]];
            *sum += u * w;
            *total += w;
            kept.push((k, u));
        }
        let off = |k: usize, u: &Vector3<f64>| {
            let (sum, total) = means[self.marker_of[k]];
            (u - sum / total, total)
        };
        let information: Matrix3<f64> = kept
            .iter()
            .map(|(k, u)| {
                let d = off(*k, u).0;
                d * (d * self.cloud.weight(*k)).transpose()
            })
            .sum();
        let Some(inverse) = information.cholesky().map(|c| c.inverse()) else {
            return Vec::new();
        };
        kept.iter()
            .map(|(k, u)| {
                let (d, total) = off(*k, u);
                let pull = inverse * d * self.cloud.weight(*k);
                let leverage = self.cloud.weight(*k) / total + d.dot(&pull);
                (*k, (1.0 - leverage).max(0.0), pull.norm())
            })
            .collect()
    }

    fn weighted(&self, (start, _): &Self::Estimate, weights: &[f64]) -> Option<Self::Estimate> {
        let center = sphere_ml::isotropic(self.cloud, *start, weights);
        let radii = sphere_ml::weighted_radii(self.cloud, &center, weights);
        (center.iter().chain(&radii).all(|x| x.is_finite())).then_some((center, radii))
    }
}

fn points_fit(
    estimator: &'static str,
    input: &Input<'_>,
    options: &Options,
    reweight: bool,
) -> Result<Outcome, EstimatorError> {
    let cloud = cloud_of(input, options)?;
    if let Err(answer) = prepare(estimator, &cloud, false) {
        return Ok(answer);
    }
    let marker_of = (0..cloud.markers())
        .flat_map(|p| vec![p; cloud.starts[p + 1] - cloud.starts[p]])
        .collect();
    let model = Spheres {
        cloud: &cloud,
        marker_of,
    };
    let choice = match choose(&model, options, reweight) {
        Ok(choice) => choice,
        Err(why) => return Ok(no_choice(estimator, cloud.points.len(), &why)),
    };
    let out = rejected(&choice, |k| cloud.labels[k]);
    let options = Options {
        significance: (options.significance * (-choice.ln_choices).exp()).max(f64::MIN_POSITIVE),
        ..options.clone()
    };
    Ok(sphere_ml::fit_cloud(
        estimator,
        &cloud.select(&choice.keep),
        &options,
        out,
    ))
}

// ---- hot spot ------------------------------------------------------------------------------------------

struct HotSpots<'a> {
    /// Row, pose and weight.
    poses: Vec<(usize, &'a Pose, f64)>,
}

impl Model for HotSpots<'_> {
    type Estimate = (Vector3<f64>, Vector3<f64>);
    const COMPONENTS: usize = 3;

    fn unknowns(&self) -> usize {
        6
    }

    fn samples(&self) -> usize {
        self.poses.len()
    }

    fn place(&self, k: usize) -> Vector3<f64> {
        self.poses[k].1.translation
    }

    fn center(&self, (center, body_point): &Self::Estimate) -> (Vector3<f64>, f64) {
        (*center, body_point.norm())
    }

    fn subset_fit(&self, random: &mut Seeded) -> Option<Self::Estimate> {
        let chosen = random.subset::<3>(self.samples());
        solve(chosen.iter().map(|&k| (self.poses[k].1, self.poses[k].2)))
    }

    fn square(&self, (center, body_point): &Self::Estimate, k: usize) -> f64 {
        let (_, pose, w) = self.poses[k];
        w * (pose.transform(body_point) - center).norm_squared()
    }

    /// Two poses about different axes determine a center, and each has three components: no single one decides.
    fn influence(&self, _: &Self::Estimate, _: &[bool]) -> Vec<(usize, f64, f64)> {
        Vec::new()
    }

    fn weighted(&self, _: &Self::Estimate, weights: &[f64]) -> Option<Self::Estimate> {
        solve(
            self.poses
                .iter()
                .zip(weights)
                .map(|((_, pose, own), w)| (*pose, own * w)),
        )
    }
}

/// Weighted linear hot spot; `None` where the rotations share an axis.
fn solve<'a>(
    poses: impl Iterator<Item = (&'a Pose, f64)> + Clone,
) -> Option<(Vector3<f64>, Vector3<f64>)> {
    let (mut total, mut mean_r, mut mean_t) = (0.0, Matrix3::zeros(), Vector3::zeros());
    for (pose, w) in poses.clone() {
        total += w;
        mean_r += pose.rotation * w;
        mean_t += pose.translation * w;
    }
    mean_r /= total;
    mean_t /= total;
    let (mut m, mut b) = (Matrix3::zeros(), Vector3::zeros());
    for (pose, w) in poses {
        let d = pose.rotation - mean_r;
        m += d.tr_mul(&d) * w;
        b -= d.tr_mul(&(pose.translation - mean_t)) * w;
    }
    let eigen = symmetric_eigen_small(&m);
    // A shared axis to within 10⁻⁵ rad: what it determines is rounding.
    if eigen.values[0] <= 1e-10 * eigen.values[2] {
        return None;
    }
    let p: Vector3<f64> = (0..3)
        .map(|k| {
            let v = eigen.vectors.column(k);
            v * (v.dot(&b) / eigen.values[k])
        })
        .sum();
    let center = mean_r * p + mean_t;
    center.iter().all(|x| x.is_finite()).then_some((center, p))
}

fn poses_fit(
    estimator: &'static str,
    poses: &[Option<Pose>],
    options: &Options,
    reweight: bool,
) -> Result<Outcome, EstimatorError> {
    if let Err(answer) = hotspot::prepare(estimator, poses, options)? {
        return Ok(answer);
    }
    let weights = RowWeights(&options.weights);
    let seen: Vec<(usize, &Pose, f64)> = poses
        .iter()
        .enumerate()
        .filter_map(|(row, p)| Some((row, p.as_ref()?, weights.of(row))))
        .filter(|(.., w)| *w > 0.0)
        .collect();
    let model = HotSpots { poses: seen };
    let choice = match choose(&model, options, reweight) {
        Ok(choice) => choice,
        Err(why) => return Ok(no_choice(estimator, model.samples(), &why)),
    };
    let mut kept = poses.to_vec();
    for (k, (row, ..)) in model.poses.iter().enumerate() {
        if !choice.keep[k] {
            kept[*row] = None;
        }
    }
    let out = rejected(&choice, |k| (0, model.poses[k].0));
    if reweight {
        hotspot_ml::fit_poses(estimator, &kept, options, out)
    } else {
        hotspot::linear(estimator, &kept, options, out, |sums, _| sums.body_point(0))
    }
}
