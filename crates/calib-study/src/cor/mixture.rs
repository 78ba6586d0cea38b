//! The best that can be done about outliers: maximum likelihood by one who knows what they are.
//!
//! ```text
//! x_k = m + r u_k + ε_k, and with probability p also + U_k,  U uniform in a cube of the reach a     h_k = |x_k − m| − r   (1)
//! minimize −Σ ln( (1 − p) N(h_k; 0, σ²) + p g_k(h_k) ),   g_k: the density of h where sample k is an outlier              (2)
//! ```
//!
//! σ, p, a and each direction u_k are known, and the search starts at the truth: no one has this, and nobody who has less is expected to do better.
//! g_k is counted over a grid of the cube, with σ as its smallest detail.

use nalgebra::{Matrix4, Vector3, Vector4};

/// Steps to each side of the cube's grid.
const GRID: i32 = 10;
/// Bins of the table of g in one σ.
const BINS: f64 = 4.0;
/// Newton steps; each halves its length until the likelihood grows.
const STEPS: usize = 60;

/// (2) for one motion.
pub(crate) struct Mixture {
    sigma: f64,
    share: f64,
    /// Smallest h of the tables, and their step.
    from: f64,
    step: f64,
    /// g_k at the bins.
    outside: Vec<Vec<f64>>,
}

impl Mixture {
    /// `arms`: true positions relative to the center.
    pub fn new(arms: &[Vector3<f64>], sigma: f64, share: f64, reach: f64) -> Self {
        let step = sigma / BINS;
        let far = 3.0_f64.sqrt() * reach + 6.0 * sigma;
        let bins = (2.0 * far / step).ceil() as usize + 1;
        let kernel: Vec<f64> = (0..=(6.0 * BINS) as usize)
            .map(|j| normal(j as f64 * step, sigma))
            .collect();
        let count = f64::from(2 * GRID + 1).powi(3);
        let table = |arm: &Vector3<f64>| {
            let mut hits = vec![0.0; bins];
            let at = |i: i32| reach * f64::from(i) / (f64::from(GRID) + 0.5);
            for i in -GRID..=GRID {
                for j in -GRID..=GRID {
                    for k in -GRID..=GRID {
                        let h = (arm + Vector3::new(at(i), at(j), at(k))).norm() - arm.norm();
                        let bin = ((h + far) / step).round().max(0.0) as usize;
                        hits[bin.min(bins - 1)] += 1.0 / count;
                    }
                }
            }
            let mut density = vec![0.0; bins];
            for (bin, hit) in hits.iter().enumerate().filter(|(_, hit)| **hit > 0.0) {
                for (j, k) in kernel.iter().enumerate() {
                    if bin + j < bins {
                        density[bin + j] += hit * k;
                    }
                    if j > 0 && bin >= j {
                        density[bin - j] += hit * k;
                    }
                }
            }
            density
        };
        Self {
            sigma,
            share,
            from: -far,
            step,
            outside: arms.iter().map(table).collect(),
        }
    }

    /// g_k(h), between the bins by straight lines; far outside a trace, so that its logarithm exists.
    fn outside(&self, k: usize, h: f64) -> f64 {
        let table = &self.outside[k];
        let place = (h - self.from) / self.step;
        if place < 0.0 || place >= (table.len() - 1) as f64 {
            return 1e-12;
        }
        let bin = place as usize;
        let part = place - bin as f64;
        (table[bin] * (1.0 - part) + table[bin + 1] * part).max(1e-12)
    }

    /// Cost of (2), its slope by h, and the weight of the sample as an inlier.
    fn cost(&self, k: usize, h: f64) -> (f64, f64, f64) {
        let inside = (1.0 - self.share) * normal(h, self.sigma);
        let g = |h: f64| self.share * self.outside(k, h);
        let total = inside + g(h);
        let belongs = inside / total;
        let turn = (g(h + self.step) - g(h - self.step)) / (2.0 * self.step);
        let slope = belongs * h / (self.sigma * self.sigma) - turn / total;
        (-total.ln(), slope, belongs)
    }

    /// The center of (2) nearest to a true center and radius.
    pub fn center(
        &self,
        points: &[Vector3<f64>],
        truth: &Vector3<f64>,
        radius: f64,
    ) -> Vector3<f64> {
        let mut at = truth.push(radius);
        let cost = |x: &Vector4<f64>| -> f64 {
            let heights = points.iter().map(|p| (p - x.xyz()).norm() - x.w);
            heights.enumerate().map(|(k, h)| self.cost(k, h).0).sum()
        };
        let mut now = cost(&at);
        for _ in 0..STEPS {
            let (mut gradient, mut hessian) = (Vector4::zeros(), Matrix4::zeros());
            for (k, point) in points.iter().enumerate() {
                let d = point - at.xyz();
                let (_, slope, belongs) = self.cost(k, d.norm() - at.w);
                let j = (-d.normalize()).push(-1.0);
                gradient += j * slope;
                hessian += j * (j * (belongs / (self.sigma * self.sigma))).transpose();
            }
            for i in 0..4 {
                hessian[(i, i)] *= 1.0 + 1e-6;
            }
            let Some(step) = hessian.cholesky().map(|c| -c.solve(&gradient)) else {
                break;
            };
            let mut length = 1.0;
            let better = loop {
                let next = at + step * length;
                let cost = cost(&next);
                if cost < now {
                    break Some((next, cost));
                }
                length *= 0.5;
                if length < 1e-4 {
                    break None;
                }
            };
            let Some((next, cost)) = better else { break };
            let done = (next - at).norm() < 1e-9 * radius;
            (at, now) = (next, cost);
            if done {
                break;
            }
        }
        at.xyz()
    }
}

fn normal(x: f64, sigma: f64) -> f64 {
    let z = x / sigma;
    (-0.5 * z * z).exp() / (sigma * (2.0 * std::f64::consts::PI).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{motion::Range, noise::Noise};

    fn arms() -> Vec<Vector3<f64>> {
        let turns = Range::Hand.turns(16);
        turns
            .iter()
            .map(|r| r * Vector3::new(0.0, -0.1, 0.0))
            .collect()
    }

    #[test]
    fn densities_are_densities_and_slopes_are_slopes() {
        let mixture = Mixture::new(&arms(), 1e-3, 0.3, 0.02);
        for (k, table) in mixture.outside.iter().enumerate() {
            let total: f64 = table.iter().map(|g| g * mixture.step).sum();
            assert!((total - 1.0).abs() < 1e-3, "{total}");
            for h in [-0.012, -0.002, 0.0, 0.0007, 0.02] {
                let d = mixture.step;
                let slope = (mixture.cost(k, h + d).0 - mixture.cost(k, h - d).0) / (2.0 * d);
                let (_, stated, belongs) = mixture.cost(k, h);
                assert!(
                    (slope - stated).abs() < 0.1 * stated.abs() + 30.0,
                    "{h}: {slope} {stated}"
                );
                assert!((0.0..=1.0).contains(&belongs));
            }
        }
    }

    /// Without outliers it is least squares; with gross ones it is least squares of the rest.
    #[test]
    fn who_knows_is_not_fooled() {
        let arms = arms();
        let mixture = Mixture::new(&arms, 1e-3, 0.3, 0.02);
        for seed in 0..20 {
            let mut noise = Noise::of_trial(seed, "mixture", 0);
            let truth = Vector3::new(0.3, -0.2, 1.0);
            let mut points: Vec<_> = arms
                .iter()
                .map(|a| truth + a + noise.vector(1e-3))
                .collect();
            points[3] += arms[3] * 0.15;
            let found = mixture.center(&points, &truth, 0.1);
            let error = (found - truth).norm();
            assert!(error < 4e-3, "{error}");
            points[3] += arms[3] * 0.01;
            let other = mixture.center(&points, &truth, 0.1);
            assert!((found - other).norm() < 1e-4, "{}", (found - other).norm());
        }
    }
}
