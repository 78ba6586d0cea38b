//! How large T becomes by chance: data are drawn from the model and scanned.
//!
//! ```text
//! z ~ N(0, I),   z_p ~ N(0, 0.16 I),   g = Aᵀz + Λ^½ z_p,   a = Rᵀ g,   U = Σ_{s∈S} B̃ᵀz − (Rᵀ E)ᵀ a,   F = |z|² + |z_p|² − |a|²     (1)
//! ```

use std::collections::BTreeSet;

use calib_geometry::statistics::quantile_nearest;
use nalgebra::DMatrix;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;

use super::columns::Pattern;
use super::levels::{Drawn, Levels, Tests};
use super::sums::{Design, SIMULATED};
use super::together::asked_more;
use super::{ChangeSettings, Moved};

/// What is drawn of a prior's σ: robots are nearer to their drawings than priors say, and F, which T counts from, is smaller for it. Drawn in
/// full, 1.5 % of clean recordings of six and ten poses were called changed.
const OF_PRIORS: f64 = 0.4;

/// What a scan looks at.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Scope {
    /// What may have moved.
    pub moved: Vec<Moved>,
    /// Samples.
    pub samples: usize,
    /// Levels of the noise that each change is tried with.
    pub levels: usize,
}

/// Data sets that are simulated with the same products.
const TOGETHER: usize = 10;

/// Distribution of the largest T under the model: that of all data from the same postures and markers, with the same noise and priors.
#[derive(Debug, Clone, PartialEq)]
pub struct ChanceOfChanges {
    /// What was scanned.
    design: Scope,
    /// By candidate: T that its best range exceeds in a tenth of the draws, and what is [asked beyond](asked_more).
    pub(super) quantiles: Vec<f64>,
    /// Excess over the quantiles that all candidates together exceed with the stated chance.
    pub(super) threshold: f64,
}

impl ChanceOfChanges {
    /// `seen`: T of every candidate. Where the first draws already show that chance explains them, no more are drawn:
    /// the threshold is then a rough one. Without, all are drawn.
    pub(super) fn simulate(
        design: Scope,
        (levels, tests): (&Levels, &Tests),
        seen: Option<&[f64]>,
        settings: &ChangeSettings,
    ) -> Self {
        /// Draws that decide on more.
        const FIRST: usize = 20;
        /// So many of them above what is seen: a chance of 0.3 % would bring that about once in 600 scans, a smaller one less often.
        const ABOVE: usize = 2;
        let shifts: Vec<Vec<DMatrix<f64>>> = levels.designs.iter().map(shifts).collect();
        let mut rng = ChaCha8Rng::seed_from_u64(settings.seed);
        let all = settings.draws.max(20);
        let mut draws: Vec<Vec<f64>> = Vec::with_capacity(all);
        let mut draw = |draws: &mut Vec<Vec<f64>>, until: usize| {
            while draws.len() < until {
                let mut left = FIRST.min(until - draws.len());
                let mut noise = Vec::new();
                while left > 0 {
                    let sets = left.min(TOGETHER);
                    noise.push(Noise::of(&levels.designs[0], sets, &mut rng));
                    left -= sets;
                }
                let found = noise.par_iter();
                let found = found.flat_map_iter(|noise| largest(levels, tests, &shifts, noise));
                draws.par_extend(found);
            }
        };
        draw(&mut draws, FIRST.min(all));
        let explain = |seen: &[f64]| {
            let quantiles = quantiles(&draws, &design);
            let of_data = excess(seen, &quantiles);
            let above = draws.iter().filter(|d| excess(d, &quantiles) > of_data);
            above.count() >= ABOVE
        };
        if !seen.is_some_and(explain) {
            draw(&mut draws, all);
        }
        let quantiles = quantiles(&draws, &design);
        let largest = draws.iter().map(|d| excess(d, &quantiles));
        Self {
            design,
            threshold: tail(largest.collect(), settings.level),
            quantiles,
        }
    }

    /// Whether it is also that of another scan. With several levels of the noise T depends on the data themselves. With one, the largest T of N independent
    /// ranges grows as 2 ln N: by 0.1 from 19 samples to 20.
    pub(super) fn holds_for(&self, scan: &Scope) -> bool {
        /// One sample in so many may be missing.
        const MISSING: usize = 20;
        let (a, b) = (self.design.samples, scan.samples);
        let one_level = self.design.levels == 1 && scan.levels == 1;
        one_level && self.design.moved == scan.moved && MISSING * a.abs_diff(b) <= a.max(b)
    }
}

/// By candidate: T that a tenth of the draws exceed, and what is asked beyond.
fn quantiles(draws: &[Vec<f64>], design: &Scope) -> Vec<f64> {
    let of = |(k, moved): (usize, &Moved)| {
        quantile(draws.iter().map(|d| d[k]).collect(), 0.9) + asked_more(*moved)
    };
    design.moved.iter().enumerate().map(of).collect()
}

/// The largest excess of T over its quantile.
fn excess(scores: &[f64], quantiles: &[f64]) -> f64 {
    let each = scores.iter().zip(quantiles).map(|(t, q)| t - q);
    each.fold(f64::NEG_INFINITY, f64::max)
}

/// z and z_p of equation (1) of some simulated data sets, one in each column.
struct Noise {
    samples: Vec<DMatrix<f64>>,
    priors: DMatrix<f64>,
}

impl Noise {
    fn of(design: &Design, sets: usize, rng: &mut ChaCha8Rng) -> Self {
        let rows = design.kept.iter().map(|kept| kept.rows.a.nrows());
        let mut samples: Vec<_> = rows.map(|rows| DMatrix::zeros(rows, sets)).collect();
        let mut priors = DMatrix::zeros(design.priors.len(), sets);
        for set in 0..sets {
            for z in &mut samples {
                for z in z.column_mut(set).iter_mut() {
                    *z = StandardNormal.sample(rng);
                }
            }
            for z in priors.column_mut(set).iter_mut() {
                let drawn: f64 = StandardNormal.sample(rng);
                *z = OF_PRIORS * drawn;
            }
        }
        Self { samples, priors }
    }
}

/// The largest T of every candidate in each of some simulated data sets: drawn with the noise that was found, seen at every level.
fn largest(
    levels: &Levels,
    tests: &Tests,
    shifts: &[Vec<DMatrix<f64>>],
    noise: &Noise,
) -> Vec<Vec<f64>> {
    let own = &levels.designs[0];
    let (z, priors) = (&noise.samples, &noise.priors);
    let by_level = levels.designs.iter().zip(shifts).enumerate();
    let by_level = by_level.map(|(level, (design, shifts))| match level {
        0 => drawn(design, shifts, z, priors),
        _ => {
            // e = L₀ z, as this level whitens it.
            let pairs = own.kept.iter().zip(&design.kept).zip(z);
            let z: Vec<DMatrix<f64>> = pairs
                .map(|((own, kept), z)| &kept.rows.l_inverse * (&own.rows.l * z))
                .collect();
            drawn(design, shifts, &z, priors)
        }
    });
    let mut by_level: Vec<_> = by_level.map(Vec::into_iter).collect();
    let of_set = |_| {
        let drawn: Vec<Drawn> = by_level.iter_mut().filter_map(Iterator::next).collect();
        let best = levels.best(tests, &drawn).into_iter();
        best.map(|best| best.map_or(0.0, |best| best.score))
            .collect()
    };
    (0..priors.ncols()).map(of_set).collect()
}

/// (Rᵀ E)ᵀ of all edges of a candidate, one below the other: one product instead of many.
fn shifts(design: &Design) -> Vec<DMatrix<f64>> {
    let n = design.root.nrows();
    let of_candidate = |k: usize| {
        let (sums, d) = (&design.cumulative[k], design.columns[k].len());
        let mut all = DMatrix::zeros(sums.len() * d, n);
        for (edge, sum) in sums.iter().enumerate() {
            all.rows_mut(edge * d, d).tr_copy_from(&sum.f);
        }
        all
    };
    (0..design.columns.len()).map(of_candidate).collect()
}

/// F and U of equation (1) of each data set, for residuals z of the samples and of the priors.
fn drawn(
    design: &Design,
    shifts: &[DMatrix<f64>],
    z: &[DMatrix<f64>],
    priors: &DMatrix<f64>,
) -> Vec<Drawn> {
    let (n, sets) = (design.root.nrows(), priors.ncols());
    let mut g = DMatrix::zeros(n, sets);
    let mut costs = vec![0.0; sets];
    let width = design.kept.first().map_or(0, |k| k.b.nrows());
    // Σ B̃ᵀz up to each sample, and the same with the factors of each drift: all columns.
    let mut steps = vec![DMatrix::<f64>::zeros(width, sets)];
    let mut drifts = [Pattern::Linear, Pattern::Settling]
        .map(|pattern| (pattern, DMatrix::<f64>::zeros(width, sets)));
    let count = design.kept.len();
    let squares = |costs: &mut [f64], of: &DMatrix<f64>| {
        let columns = costs.iter_mut().zip(of.column_iter());
        columns.for_each(|(cost, z)| *cost += z.norm_squared());
    };
    for (place, (kept, z)) in design.kept.iter().zip(z).enumerate() {
        kept.rows.a.add_transposed_times(1.0, z, &mut g);
        let own = &kept.b * z;
        for (pattern, sums) in &mut drifts {
            let factor = pattern.factor(place, count);
            sums.zip_apply(&own, |sum, x| *sum += factor * x);
        }
        steps.push(&steps[place] + own);
        squares(&mut costs, z);
    }
    for (&(c, weight), z) in design.priors.iter().zip(priors.row_iter()) {
        let mut row = g.row_mut(c);
        row += z * weight;
    }
    squares(&mut costs, priors);
    let along = &design.root * &g;
    let shifted: Vec<DMatrix<f64>> = shifts.iter().map(|shift| shift * &along).collect();
    let of_set = |set: usize| {
        let of_candidate = |k: usize| {
            let (columns, edges) = (&design.columns[k], design.cumulative[k].len());
            let own = |u: &DMatrix<f64>, i: usize| u[(columns.start + i, set)];
            let shifted = shifted[k].column(set);
            DMatrix::from_fn(columns.len(), edges, |i, edge| {
                let u = match (design.patterns[k], edge) {
                    (Pattern::Step, _) => own(&steps[edge], i),
                    (_, 0) => 0.0,
                    (Pattern::Linear, _) => own(&drifts[0].1, i),
                    (Pattern::Settling, _) => own(&drifts[1].1, i),
                    (Pattern::Constant, _) => own(&steps[count], i),
                };
                u - shifted[edge * columns.len() + i]
            })
        };
        Drawn {
            cost: costs[set] - along.column(set).norm_squared(),
            u: (0..design.columns.len()).map(of_candidate).collect(),
        }
    };
    (0..sets).map(of_set).collect()
}

fn quantile(mut values: Vec<f64>, p: f64) -> f64 {
    quantile_nearest(&mut values, p).unwrap_or(0.0)
}

/// The value that is exceeded with chance `level`: the empirical quantile of the highest fifth, continued by an exponential tail,
/// which two hundred draws fix better than their second largest.
fn tail(values: Vec<f64>, level: f64) -> f64 {
    /// Part of the draws that the tail is fitted to.
    const PART: f64 = 0.2;
    /// A χ² falls like exp(−T/2): its mean excess is 2 at least.
    const LEAST_MEAN: f64 = 2.0;
    let start = quantile(values.clone(), 1.0 - PART);
    let above: Vec<f64> = values
        .iter()
        .filter(|v| **v > start)
        .map(|v| v - start)
        .collect();
    let mean = above.iter().sum::<f64>() / above.len().max(1) as f64;
    start + mean.max(LEAST_MEAN) * (PART / level).ln()
}

/// Samples that are simulated in place of all: every recording has one, for what other recordings on the other side gain by chance grows with
/// their number, not with that of their samples.
pub(super) fn thinned(used: &[usize], borders: &[usize]) -> Vec<usize> {
    let recording = |sample: &usize| borders.partition_point(|b| b <= sample);
    let mut out = every(used, used.len().div_ceil(SIMULATED));
    let mut seen: BTreeSet<usize> = out.iter().map(recording).collect();
    out.extend(used.iter().filter(|s| seen.insert(recording(s))));
    out.sort_unstable();
    out
}

pub(super) fn every(samples: &[usize], stride: usize) -> Vec<usize> {
    samples.iter().step_by(stride).copied().collect()
}

#[cfg(test)]
mod tests {
    use super::thinned;

    /// 100 recordings of 2 and 200 of 9 samples, of which some were not used.
    #[test]
    fn every_recording_is_simulated() {
        let starts: Vec<usize> = (0..100).map(|r| 2 * r).collect();
        let mut borders = starts[1..].to_vec();
        borders.extend((0..200).map(|r| 200 + 9 * r));
        let used: Vec<usize> = (0..2000).filter(|s| s % 9 != 4).collect();
        let recording = |s: &usize| borders.partition_point(|b| b <= s);
        let all: Vec<usize> = used.iter().map(recording).collect();
        let mut simulated: Vec<usize> = thinned(&used, &borders).iter().map(recording).collect();
        simulated.dedup();
        let mut expected = all;
        expected.dedup();
        assert_eq!(simulated, expected);
        // Where every recording has one already, nothing is added.
        assert_eq!(thinned(&used[..240], &[100]), used[..240]);
    }
}
