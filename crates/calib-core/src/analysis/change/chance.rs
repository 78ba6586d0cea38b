//! How large T becomes by chance: data are drawn from the model and scanned.
//!
//! ```text
//! z ~ N(0, I),   z_p ~ N(0, 0.16 I),   g = Aᵀz + Λ^½ z_p,   δ = −C g,   U = Σ_{s∈S} B̃ᵀz + Eᵀδ,   F = |z|² + |z_p|² − gᵀ C g     (1)
//! ```

use calib_geometry::statistics::quantile_nearest;
use nalgebra::{DMatrix, DVector};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::ChangeSettings;
use super::columns::Pattern;
use super::levels::{Drawn, Levels, Tests};
use super::sums::Design;

/// What is drawn of a prior's σ: robots are nearer to their drawings than priors say, and F, which T counts from, is smaller for it. Drawn in
/// full, 1.5 % of clean recordings of six and ten poses were called changed.
const OF_PRIORS: f64 = 0.4;

/// Distribution of the largest T under the model.
pub(super) struct Chance {
    /// By candidate: T that its best range exceeds in a tenth of the draws.
    pub quantiles: Vec<f64>,
    /// Excess over the quantiles that all candidates together exceed with the stated chance.
    pub threshold: f64,
}

impl Chance {
    /// `seen`: T of every candidate. Where the first draws already show that chance explains them, no more are drawn:
    /// the threshold is then a rough one.
    pub(super) fn simulate(
        levels: &Levels,
        tests: &Tests,
        seen: &[f64],
        settings: &ChangeSettings,
    ) -> Self {
        /// Draws that decide on more.
        const FIRST: usize = 20;
        /// So many of them above what is seen: a chance of 0.3 % would bring that about once in 600 scans, a smaller one less often.
        const ABOVE: usize = 2;
        let count = levels.designs[0].columns.len();
        let shifts: Vec<Vec<DMatrix<f64>>> = levels.designs.iter().map(shifts).collect();
        let mut rng = ChaCha8Rng::seed_from_u64(settings.seed);
        let all = settings.draws.max(20);
        let mut draws: Vec<Vec<f64>> = Vec::with_capacity(all);
        let mut draw = |draws: &mut Vec<Vec<f64>>, until: usize| {
            while draws.len() < until {
                draws.push(largest(levels, tests, &shifts, &mut rng));
            }
        };
        draw(&mut draws, FIRST.min(all));
        let quantiles = quantiles(&draws, count);
        let of_data = excess(seen, &quantiles);
        let above = draws.iter().filter(|d| excess(d, &quantiles) > of_data);
        if above.count() < ABOVE {
            draw(&mut draws, all);
        }
        Self::of(&draws, count, settings.level)
    }

    fn of(draws: &[Vec<f64>], count: usize, level: f64) -> Self {
        let quantiles = quantiles(draws, count);
        let largest = draws.iter().map(|d| excess(d, &quantiles));
        Self {
            threshold: tail(largest.collect(), level),
            quantiles,
        }
    }
}

/// By candidate: T that a tenth of the draws exceed.
fn quantiles(draws: &[Vec<f64>], count: usize) -> Vec<f64> {
    let of = |k: usize| quantile(draws.iter().map(|d| d[k]).collect(), 0.9);
    (0..count).map(of).collect()
}

/// The largest excess of T over its quantile.
fn excess(scores: &[f64], quantiles: &[f64]) -> f64 {
    let each = scores.iter().zip(quantiles).map(|(t, q)| t - q);
    each.fold(f64::NEG_INFINITY, f64::max)
}

/// The largest T of every candidate in one simulated data set: drawn with the noise that was found, seen at every level.
fn largest(
    levels: &Levels,
    tests: &Tests,
    shifts: &[Vec<DMatrix<f64>>],
    rng: &mut ChaCha8Rng,
) -> Vec<f64> {
    let own = &levels.designs[0];
    let rows = own.kept.iter().map(|kept| kept.a.nrows());
    let z: Vec<DVector<f64>> = rows
        .map(|rows| DVector::from_fn(rows, |_, _| StandardNormal.sample(rng)))
        .collect();
    let priors: Vec<f64> = own
        .priors
        .iter()
        .map(|_| {
            let z: f64 = StandardNormal.sample(rng);
            OF_PRIORS * z
        })
        .collect();
    let drawn: Vec<Drawn> = levels
        .designs
        .iter()
        .zip(shifts)
        .enumerate()
        .map(|(level, (design, shifts))| match level {
            0 => drawn(design, shifts, &z, &priors),
            _ => {
                // e = L₀ z, as this level whitens it.
                let pairs = own.kept.iter().zip(&design.kept).zip(&z);
                let z: Vec<DVector<f64>> = pairs
                    .map(|((own, kept), z)| &kept.l_inverse * (&own.l * z))
                    .collect();
                drawn(design, shifts, &z, &priors)
            }
        })
        .collect();
    let best = levels.best(tests, &drawn);
    best.into_iter()
        .map(|best| best.map_or(0.0, |best| best.score))
        .collect()
}

/// Eᵀ of all edges of a candidate, one below the other: one product instead of many.
fn shifts(design: &Design) -> Vec<DMatrix<f64>> {
    let n = design.covariance.nrows();
    let of_candidate = |k: usize| {
        let (sums, d) = (&design.cumulative[k], design.columns[k].len());
        let mut all = DMatrix::zeros(sums.len() * d, n);
        for (edge, sum) in sums.iter().enumerate() {
            all.rows_mut(edge * d, d).tr_copy_from(&sum.e);
        }
        all
    };
    (0..design.columns.len()).map(of_candidate).collect()
}

/// F and U of equation (1) for residuals z of the samples and of the priors.
fn drawn(design: &Design, shifts: &[DMatrix<f64>], z: &[DVector<f64>], priors: &[f64]) -> Drawn {
    let n = design.covariance.nrows();
    let mut g = DVector::zeros(n);
    let mut cost = 0.0;
    let width = design.kept.first().map_or(0, |k| k.b.ncols());
    // Σ B̃ᵀz up to each sample, and the same in proportion to the place: all columns.
    let mut steps = vec![DVector::<f64>::zeros(width)];
    let mut linear = DVector::<f64>::zeros(width);
    let count = design.kept.len();
    for (place, (kept, z)) in design.kept.iter().zip(z).enumerate() {
        kept.a.add_transposed_vector(z, &mut g);
        let own = kept.b.tr_mul(z);
        linear.axpy(place as f64 / (count - 1) as f64 - 0.5, &own, 1.0);
        steps.push(&steps[place] + own);
        cost += z.norm_squared();
    }
    for (&(c, weight), &z) in design.priors.iter().zip(priors) {
        g[c] += weight * z;
        cost += z * z;
    }
    let step = -(&design.covariance * &g);
    cost += g.dot(&step);
    let of_candidate = |k: usize| {
        let own = |u: &DVector<f64>| u.rows_range(design.columns[k].clone()).into_owned();
        let mut u: Vec<DVector<f64>> = match design.patterns[k] {
            Pattern::Step => steps.iter().map(own).collect(),
            Pattern::Linear => vec![DVector::zeros(design.columns[k].len()), own(&linear)],
            Pattern::Constant => vec![own(&steps[0]), own(&steps[count])],
        };
        // U ← U + Eᵀ δ
        let shift = &shifts[k] * &step;
        let edges = design.cumulative[k].len();
        for (u, edge) in u.iter_mut().zip(0..edges) {
            *u += shift.rows(edge * u.len(), u.len());
        }
        u
    };
    let u = (0..design.columns.len()).map(of_candidate).collect();
    Drawn { cost, u }
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
