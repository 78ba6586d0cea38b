//! The evidence for a choice of samples, costs (1) and (2).

use calib_estimator::chance::chi2_tail;
use calib_geometry::statistics::upper_median;
use nalgebra::Vector3;

use super::Model;

/// ln D: outliers spread over four decades.
const DECADES: f64 = 2.22;
/// −ln of the prior of a scale that the outliers share.
const SCALE: f64 = 3.0;
/// An outlier is never more likely than at this many σ: closer ones are not distinguished from the noise.
const NEAREST: f64 = 3.0;
/// Part of the data's size below which residuals are rounding.
const EXACT: f64 = 1e-12;

/// Costs (1) and (2).
pub(super) struct Evidence {
    pub components: usize,
    pub unknowns: usize,
    pub sigma: Option<f64>,
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
    pub fn of<M: Model>(model: &M, stated: Option<f64>) -> Self {
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
    pub fn fewest(&self, n: usize) -> usize {
        (n + self.unknowns.div_ceil(self.components))
            .div_ceil(2)
            .min(n)
    }

    pub fn ln_choices(&self, n: usize, h: usize) -> f64 {
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
    pub fn cost(&self, rss: f64, outside: f64, h: usize, n: usize) -> f64 {
        // ν = qh − p
        let free = self.components * h - self.unknowns;
        let rss = rss.max(self.floor * h as f64);
        let noise = match self.sigma {
            // (1): ν/2 ln(π RSS) − ln Γ(ν/2)
            None => 0.5 * free as f64 * (std::f64::consts::PI * rss).ln() - self.half_gamma[free],
            // (2): RSS/2σ² + ν ln(σ√2π)
            Some(sigma) => {
                rss / (2.0 * sigma * sigma)
                    + free as f64 * (sigma * (2.0 * std::f64::consts::PI).sqrt()).ln()
            }
        };
        noise + outside + self.ln_choices(n, h)
    }

    /// Least cost over the number of samples, those of least residual first.
    pub fn best(&self, sorted: &[f64]) -> Best {
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
    pub fn odds(&self, square: f64, even: Option<f64>, variance: f64, total: f64, n: usize) -> f64 {
        let out = (n as f64 - total).max(0.5);
        (total / out).ln()
            - 0.5 * self.components as f64 * (2.0 * std::f64::consts::PI * variance).ln()
            - square / (2.0 * variance)
            + even.unwrap_or_else(|| self.outside(square.max(NEAREST * NEAREST * variance)))
    }

    /// Variance of one component among the chosen.
    pub fn variance(&self, rss: f64, count: f64) -> f64 {
        match self.sigma {
            Some(sigma) => sigma * sigma,
            None => rss / (self.components as f64 * count - self.unknowns as f64).max(0.5),
        }
        .max(self.floor)
        .max(f64::MIN_POSITIVE)
    }
}

/// The best number of samples.
pub(super) struct Best {
    pub cost: f64,
    pub count: usize,
    /// −ln density of the outliers where they are spread evenly, else by orders of magnitude.
    pub even: Option<f64>,
}

/// The square of a normal residual of so many components that the largest of n exceeds once in twenty recordings.
pub(super) fn surprising(components: usize, n: usize) -> f64 {
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

pub(super) fn median(values: &[f64]) -> f64 {
    upper_median(&mut values.to_vec()).unwrap_or(f64::NAN)
}
