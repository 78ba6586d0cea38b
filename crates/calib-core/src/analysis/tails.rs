//! Whether the residuals have heavier tails than normal noise, and by how much.
//!
//! The residual of a vector of d rows, whitened and over the root of what the parameters leave of it, is set beside Student's t of ν
//! degrees of freedom and scale s; what the gate could reject is known only to lie beyond c, so that a gross error counts as one value:
//!
//! ```text
//! ℓ(ν, s) = Σ_{x ≤ c} ln t_d(x; ν, s) + Σ_{x > c} ln P(x > c; ν, s),     x = |r|²,   c = χ²_d(0.999)         (1)
//! D(λ) = 2 [max_λ' ℓ − ℓ(1/λ)] / f,   ℓ(1/λ) = max_s ℓ(1/λ, s)                                              (2)
//! ```
//!
//! λ = 1/ν is 0 for normal noise. D(0) decides whether tails are heavier, D(λ) ≤ χ²₁(0.95) is the interval. f is how much more the vectors
//! of a pose agree in it than vectors on their own would.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};
use statrs::distribution::{ChiSquared, ContinuousCDF, FisherSnedecor};
use statrs::function::gamma::ln_gamma;

/// A residual vector.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ResidualVector {
    /// Sample that it belongs to.
    pub sample: usize,
    /// Its rows, d.
    pub rows: usize,
    /// x of equation (1): χ²(d) for normal noise of the level that was used.
    pub square: f64,
}

/// Degrees of freedom of Student's t that describe the residuals; infinite for normal noise.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Tails {
    /// ν that is likeliest; `None` for normal noise.
    pub degrees_of_freedom: Option<f64>,
    /// Least ν of the 95 % interval.
    pub least: f64,
    /// Largest ν of it; `None` where normal noise is within.
    pub most: Option<f64>,
    /// Probability of so much evidence for heavy tails where the noise is normal.
    pub p_value: f64,
    /// Vectors that were looked at.
    pub vectors: usize,
}

/// Fewer vectors show no tails.
const FEWEST: usize = 40;
/// Vectors that are looked at at most, evenly over all.
const MOST: usize = 2000;
/// c of equation (1): the gate of the robust fit.
const CENSORED: f64 = 0.999;
/// Values of λ that are tried: to ν = 2, below which there is no variance.
const STEPS: usize = 20;
const LARGEST: f64 = 0.5;

impl Tails {
    /// Of residual vectors; `None` of too few.
    #[must_use]
    pub fn of(vectors: &[ResidualVector]) -> Option<Self> {
        let finite = |v: &&ResidualVector| v.square.is_finite() && v.rows > 0;
        let all: Vec<ResidualVector> = vectors.iter().filter(finite).copied().collect();
        if all.len() < FEWEST {
            return None;
        }
        let step = all.len().div_ceil(MOST);
        let used: Vec<ResidualVector> = all.iter().step_by(step).copied().collect();
        let sample = Sample::new(&used)?;
        let lambda = |k: usize| LARGEST * k as f64 / STEPS as f64;
        let values: Vec<f64> = (0..=STEPS).map(|k| sample.profile(lambda(k))).collect();
        let best = (0..=STEPS).max_by(|a, b| values[*a].total_cmp(&values[*b]))?;
        // Between the neighbors of the best value of the grid.
        let (from, to) = (
            lambda(best.saturating_sub(1)),
            lambda((best + 1).min(STEPS)),
        );
        let (likeliest, mut highest) = largest(|l| sample.profile(l), (from, to));
        highest = highest.max(values[0]);
        let likeliest = if values[0] >= highest { 0.0 } else { likeliest };
        let agree = sample.agreement();
        let lost = |value: f64| 2.0 * (highest - value) / agree;
        let limit = ChiSquared::new(1.0).ok()?.inverse_cdf(0.95);
        let inside = |l: f64| lost(sample.profile(l)) <= limit;
        let most = (!inside(0.0)).then(|| border(inside, 0.0, likeliest));
        let least = if inside(LARGEST) {
            LARGEST
        } else {
            border(inside, LARGEST, likeliest)
        };
        // On the border of what is possible the evidence is χ²(1) in half of all cases, else 0.
        let evidence = lost(values[0]);
        let p_value = if evidence > 0.0 {
            0.5 * ChiSquared::new(1.0).ok()?.sf(evidence)
        } else {
            1.0
        };
        Some(Self {
            degrees_of_freedom: (likeliest > 0.0).then(|| 1.0 / likeliest),
            least: 1.0 / least,
            most: most.map(|l| 1.0 / l),
            p_value,
            vectors: used.len(),
        })
    }
}

/// The vectors that are looked at.
struct Sample {
    vectors: Vec<ResidualVector>,
    /// c of equation (1) by number of rows.
    censored: BTreeMap<usize, f64>,
    /// The same vectors by number of rows.
    sizes: BTreeMap<usize, Size>,
}

/// Vectors of one number of rows.
struct Size {
    /// Neighbors in order of x: their mean and number, of those that do not lie beyond c.
    groups: Vec<(f64, f64)>,
    /// Number of those.
    within: f64,
    /// Number of those that lie beyond c.
    beyond: f64,
}

impl Size {
    fn new(mut squares: Vec<f64>, censored: f64) -> Self {
        /// Groups in which ℓ is summed: the mean of a hundredth of all is as good as its members.
        const GROUPS: usize = 128;
        squares.sort_by(f64::total_cmp);
        let within = squares.partition_point(|x| *x <= censored);
        let group = |of: &[f64]| (of.iter().sum::<f64>() / of.len() as f64, of.len() as f64);
        let size = within.div_ceil(GROUPS).max(1);
        Self {
            groups: squares[..within].chunks(size).map(group).collect(),
            within: within as f64,
            beyond: (squares.len() - within) as f64,
        }
    }
}

impl Sample {
    /// Squares in units of their median, as it would be of normal noise: what lies beyond c does not depend on the level that was stated.
    fn new(vectors: &[ResidualVector]) -> Option<Self> {
        let (mut censored, mut middle) = (BTreeMap::new(), BTreeMap::new());
        for d in vectors.iter().map(|v| v.rows).collect::<BTreeSet<_>>() {
            let chi = ChiSquared::new(d as f64).ok()?;
            censored.insert(d, chi.inverse_cdf(CENSORED));
            middle.insert(d, chi.inverse_cdf(0.5));
        }
        let mut levels: Vec<f64> = vectors.iter().map(|v| v.square / middle[&v.rows]).collect();
        levels.sort_by(f64::total_cmp);
        let level = levels[levels.len() / 2];
        if level <= 0.0 {
            return None;
        }
        let scaled = vectors.iter().map(|v| ResidualVector {
            square: v.square / level,
            ..*v
        });
        let vectors: Vec<ResidualVector> = scaled.collect();
        let size = |(d, c): (&usize, &f64)| {
            let own = vectors.iter().filter(|v| v.rows == *d);
            (*d, Size::new(own.map(|v| v.square).collect(), *c))
        };
        Some(Self {
            sizes: censored.iter().map(size).collect(),
            vectors,
            censored,
        })
    }

    /// max over s of ℓ.
    fn profile(&self, lambda: f64) -> f64 {
        /// ln s² that is looked for: the median is right to begin with.
        const SCALES: (f64, f64) = (-1.5, 1.0);
        largest(|log| self.log_likelihood(lambda, log.exp()), SCALES).1
    }

    /// Equation (1) at 1/ν and s².
    fn log_likelihood(&self, lambda: f64, scale: f64) -> f64 {
        let of = |(d, size): (&usize, &Size)| {
            let rows = *d as f64;
            let kernel = |square: f64| {
                let x = square / scale;
                if lambda > 0.0 {
                    0.5 * (1.0 / lambda + rows) * (lambda * x).ln_1p()
                } else {
                    0.5 * x
                }
            };
            let kernels: f64 = size.groups.iter().map(|(x, n)| n * kernel(*x)).sum();
            let constant = ln_constant(rows, lambda) - 0.5 * rows * scale.ln();
            let mut sum = size.within * constant - kernels;
            if size.beyond > 0.0 {
                sum += size.beyond * ln_beyond(rows, lambda, self.censored[d] / scale);
            }
            sum
        };
        self.sizes.iter().map(of).sum()
    }

    /// f of equation (2): of ψ = x²/d(d + 2) − 2x/d + 1, the slope of ℓ at λ = 0 of which nothing shows in s.
    fn agreement(&self) -> f64 {
        let mut by_sample: BTreeMap<usize, f64> = BTreeMap::new();
        let mut squares = 0.0;
        for v in &self.vectors {
            let (d, x) = (v.rows as f64, v.square.min(self.censored[&v.rows]));
            let slope = x * x / (d * (d + 2.0)) - 2.0 * x / d + 1.0;
            *by_sample.entry(v.sample).or_default() += slope;
            squares += slope * slope;
        }
        let together: f64 = by_sample.values().map(|sum| sum * sum).sum();
        (together / squares.max(f64::MIN_POSITIVE)).max(1.0)
    }
}

/// ln of what does not depend on x in the density of a vector of d rows, of scale 1.
fn ln_constant(d: f64, lambda: f64) -> f64 {
    if lambda <= 0.0 {
        return -0.5 * d * (2.0 * std::f64::consts::PI).ln();
    }
    let nu = 1.0 / lambda;
    ln_gamma(0.5 * (nu + d)) - ln_gamma(0.5 * nu) - 0.5 * d * (nu * std::f64::consts::PI).ln()
}

/// ln of the probability that x is beyond c, of scale 1.
fn ln_beyond(d: f64, lambda: f64, c: f64) -> f64 {
    let beyond = if lambda > 0.0 {
        FisherSnedecor::new(d, 1.0 / lambda).map_or(f64::NAN, |f| f.sf(c / d))
    } else {
        ChiSquared::new(d).map_or(f64::NAN, |chi| chi.sf(c))
    };
    beyond.max(f64::MIN_POSITIVE).ln()
}

/// Place and value of the maximum of a function that rises to it and falls behind it, by golden sections.
fn largest(f: impl Fn(f64) -> f64, (mut from, mut to): (f64, f64)) -> (f64, f64) {
    /// Sections: to 1e-5 of the range.
    const SECTIONS: usize = 24;
    let golden = 0.5 * (5f64.sqrt() - 1.0);
    let (mut a, mut b) = (to - golden * (to - from), from + golden * (to - from));
    let (mut at_a, mut at_b) = (f(a), f(b));
    for _ in 0..SECTIONS {
        if at_a > at_b {
            (to, b, at_b) = (b, a, at_a);
            a = to - golden * (to - from);
            at_a = f(a);
        } else {
            (from, a, at_a) = (a, b, at_b);
            b = from + golden * (to - from);
            at_b = f(b);
        }
    }
    if at_a > at_b { (a, at_a) } else { (b, at_b) }
}

/// Where `inside` begins between a place outside and one inside.
fn border(inside: impl Fn(f64) -> bool, mut outside: f64, mut within: f64) -> f64 {
    /// Halvings: to a thousandth of the range.
    const HALVINGS: usize = 10;
    for _ in 0..HALVINGS {
        let middle = 0.5 * (outside + within);
        if inside(middle) {
            within = middle;
        } else {
            outside = middle;
        }
    }
    0.5 * (outside + within)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{ChiSquared as Chi, Distribution, StandardNormal};

    /// Vectors of three rows of Student's t with ν degrees of freedom (normal where infinite), two to a sample.
    fn vectors(seed: u64, count: usize, nu: f64) -> Vec<ResidualVector> {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        let of = |i: usize| {
            let normal = |rng: &mut rand_chacha::ChaCha8Rng| -> f64 { StandardNormal.sample(rng) };
            let x: f64 = (0..3).map(|_| normal(&mut rng).powi(2)).sum();
            let by = if nu.is_finite() {
                Chi::new(nu).expect("positive").sample(&mut rng) / nu
            } else {
                1.0
            };
            ResidualVector {
                sample: i / 2,
                rows: 3,
                square: 0.8 * x / by,
            }
        };
        (0..count).map(of).collect()
    }

    #[test]
    fn normal_noise_has_no_heavy_tails() {
        let found: Vec<Tails> = (0..40)
            .map(|seed| Tails::of(&vectors(seed, 200, f64::INFINITY)).expect("enough"))
            .collect();
        // One of a hundred may be beyond 0.01; normal noise is within the interval of nineteen of twenty or more.
        assert!(found.iter().filter(|t| t.p_value < 0.01).count() <= 2);
        assert!(found.iter().filter(|t| t.most.is_none()).count() >= 36);
        assert!(Tails::of(&vectors(1, FEWEST - 1, 4.0)).is_none());
    }

    #[test]
    fn heavy_tails_are_found_with_their_degrees_of_freedom() {
        for nu in [3.0, 5.0] {
            let found: Vec<Tails> = (100..140)
                .map(|seed| Tails::of(&vectors(seed, 300, nu)).expect("enough"))
                .collect();
            let shown = found.iter().filter(|t| t.p_value < 1e-3).count();
            let covered = found
                .iter()
                .filter(|t| t.least <= nu && t.most.is_none_or(|most| nu <= most));
            let covered = covered.count();
            assert!(shown >= 34, "{nu}: {shown} of 40 shown");
            // 38 of 40 with a standard error of 1.4.
            assert!(covered >= 34, "{nu}: {covered} of 40 covered");
        }
    }

    #[test]
    fn a_gross_error_is_no_heavy_tail() {
        let mut all = vectors(7, 300, f64::INFINITY);
        all[11].square = 1e6;
        let found = Tails::of(&all).expect("enough");
        assert!(found.p_value > 1e-3, "{found:?}");
    }
}
