//! How large T becomes by chance: data are drawn from the model and scanned.
//!
//! ```text
//! z ~ N(0, I),   g = Aᵀz + Λ^½ z_p,   δ = −C g,   U = Σ_{s∈S} B̃ᵀz + Eᵀδ,   F = |z|² + |z_p|² − gᵀ C g     (1)
//! ```

use calib_geometry::statistics::quantile_nearest;
use nalgebra::DVector;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::ChangeSettings;
use super::columns::Pattern;
use super::sums::{Design, Test, score};

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
    pub(super) fn simulate(design: &Design, seen: &[f64], settings: &ChangeSettings) -> Self {
        /// Draws that decide on more.
        const FIRST: usize = 20;
        /// So many of them above what is seen: a chance of 0.3 % would bring that about once in 600 scans, a smaller one less often.
        const ABOVE: usize = 2;
        let count = design.columns.len();
        let tests: Vec<Vec<Test>> = (0..count).map(|k| design.tests(k)).collect();
        let mut rng = ChaCha8Rng::seed_from_u64(settings.seed);
        let all = settings.draws.max(20);
        let mut draws: Vec<Vec<f64>> = Vec::with_capacity(all);
        let mut draw = |draws: &mut Vec<Vec<f64>>, until: usize| {
            while draws.len() < until {
                draws.push(largest(design, &tests, &mut rng));
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

/// The largest T of every candidate in one simulated data set.
fn largest(design: &Design, tests: &[Vec<Test>], rng: &mut ChaCha8Rng) -> Vec<f64> {
    let n = design.covariance.nrows();
    let mut g = DVector::zeros(n);
    let mut cost = 0.0;
    let width = design.kept.first().map_or(0, |k| k.b.ncols());
    // Σ B̃ᵀz up to each sample, and the same in proportion to the place: all columns.
    let mut steps = vec![DVector::<f64>::zeros(width)];
    let mut linear = DVector::<f64>::zeros(width);
    let count = design.kept.len();
    for (place, kept) in design.kept.iter().enumerate() {
        let z = DVector::<f64>::from_fn(kept.a.nrows(), |_, _| StandardNormal.sample(rng));
        g.gemv_tr(1.0, &kept.a, &z, 1.0);
        let own = kept.b.tr_mul(&z);
        linear.axpy(place as f64 / (count - 1) as f64 - 0.5, &own, 1.0);
        steps.push(&steps[place] + own);
        cost += z.norm_squared();
    }
    for &(c, weight) in &design.priors {
        let z: f64 = StandardNormal.sample(rng);
        g[c] += weight * z;
        cost += z * z;
    }
    let step = -(&design.covariance * &g);
    cost += g.dot(&step);
    let of_candidate = |(k, tests): (usize, &Vec<Test>)| {
        let own = |u: &DVector<f64>| u.rows_range(design.columns[k].clone()).into_owned();
        let mut u: Vec<DVector<f64>> = match design.patterns[k] {
            Pattern::Step => steps.iter().map(own).collect(),
            Pattern::Linear => vec![DVector::zeros(design.columns[k].len()), own(&linear)],
            Pattern::Constant => vec![own(&steps[0]), own(&steps[count])],
        };
        // U ← U + Eᵀ δ
        for (u, sum) in u.iter_mut().zip(&design.cumulative[k]) {
            *u += sum.e.tr_mul(&step);
        }
        let best = design.best(k, tests, &u);
        score(design.rows, cost, best.map_or(0.0, |b| b.gain))
    };
    tests.iter().enumerate().map(of_candidate).collect()
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
