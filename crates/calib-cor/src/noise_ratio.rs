//! A hot spot from few poses: the ratio of both noises is integrated over, not maximized.
//!
//! ```text
//! λ = 1 + x²,  x = |p| σ_r/σ_t      variance across the lever over that along it
//! S_λ = min over (o, p) of Σ e² + (arc)²/λ,   H_λ its curvature,   ν = 3n − 6
//! ln w = −½ [ν ln S + 2n ln λ + ln|H|] + ln p(x),   p: half-Cauchy(1), in d ln x                    (1)
//! mean = Σ w θ_λ,   C = Σ w [S/ν · H⁻¹ + (ν−2)/ν (θ_λ − mean)(…)ᵀ],   intervals by F(3, ν)             (2)
//! ```
//!
//! The six unknowns can bring six of the residuals along the lever to zero: with eight poses two are left, the likelihood peaks where σ_t
//! vanishes, and its σ is too small by any factor. Where one σ is stated it fixes the scale of S:
//!
//! ```text
//! σ_t stated: ln w = −½ [S/σ_t² + 2n ln λ + ln|H|] + ln p(x),                C = Σ w [σ_t² H⁻¹ + …]        (3)
//! σ_r stated: s² = |p|²σ_r²/x²,  ln w = −½ [S/s² + ν ln s² + 2n ln λ + ln|H|],  C = Σ w [s² H⁻¹ + …]         (4)
//! ```

use calib_estimator::{
    Options,
    levenberg::{Problem as _, Stop, minimize},
    measured::Pose,
};
use nalgebra::{Matrix6, Vector6};

use crate::{
    hotspot::{HotSpot, stack},
    pivot::Likelihood,
};

/// Points of the grid in ln x.
const GRID: usize = 41;
/// Smallest and largest x: orientation noise of a twentieth of the position noise cannot be seen, and beyond 300 only spheres are left.
const RANGE: [f64; 2] = [0.05, 300.0];
/// Steps to the minimum for each ratio: it starts at that of the ratio before.
const STEPS: usize = 20;

/// The center and body point over all ratios of the noises.
pub(crate) struct Mixture {
    /// `[center; body point]`, the center relative to the mean position.
    pub mean: Vector6<f64>,
    covariance: Matrix6<f64>,
    /// `None` where both noises were stated.
    pub degrees_of_freedom: Option<f64>,
}

impl Mixture {
    /// Second moment about another estimate: what it is off by where it differs from the mean.
    pub fn about(&self, spot: &HotSpot) -> Matrix6<f64> {
        let other = stack(&(spot.center - spot.sums.mean_t), &spot.body_point);
        let off = self.mean - other;
        self.covariance + off * off.transpose()
    }
}

/// One ratio.
struct Node {
    ln_weight: f64,
    at: Vector6<f64>,
    /// σ² H⁻¹.
    covariance: Matrix6<f64>,
}

/// The mixture (2) to (4); `None` where the poses do not fix the center at any ratio.
pub(crate) fn mixture(
    poses: &[(&Pose, f64)],
    spot: &HotSpot,
    options: &Options,
) -> Option<Mixture> {
    let n = spot.sums.n as f64;
    let freedom = 3.0 * n - 6.0;
    if freedom <= 2.0 {
        return None;
    }
    let reach = spot.body_point.norm();
    let mut at = stack(&(spot.center - spot.sums.mean_t), &spot.body_point);
    let mut nodes = Vec::with_capacity(GRID);
    for x in ratios(reach, options) {
        let problem = Likelihood {
            poses: poses.to_vec(),
            origin: spot.sums.mean_t,
            sigma_t: 1.0,
            sigma_r: x / reach,
            scale: reach,
        };
        let end = minimize(&problem, at, STEPS);
        if end.stop == Stop::Broken || !end.x.iter().all(|v| v.is_finite()) {
            continue;
        }
        at = end.x;
        let normal = problem.linearize(&at);
        let Some(curvature) = normal.hessian.cholesky() else {
            continue;
        };
        let lambda = 1.0 + x * x;
        let (square, ln_h) = (
            normal.cost.max(f64::MIN_POSITIVE),
            curvature.ln_determinant(),
        );
        let ln_prior = (x / (1.0 + x * x)).ln();
        let common = 2.0 * n * lambda.ln() + ln_h;
        let (ln_weight, variance) = match (options.sigma_t, options.sigma_r) {
            (Some(sigma_t), _) => {
                let s2 = sigma_t * sigma_t;
                (-0.5 * (square / s2 + common) + ln_prior, s2)
            }
            (None, Some(sigma_r)) => {
                let s2 = (reach * sigma_r / x).powi(2);
                (-0.5 * (square / s2 + freedom * s2.ln() + common), s2)
            }
            (None, None) => (
                -0.5 * (freedom * square.ln() + common) + ln_prior,
                square / freedom,
            ),
        };
        nodes.push(Node {
            ln_weight,
            at,
            covariance: curvature.inverse() * variance,
        });
    }
    let degrees_of_freedom = match (options.sigma_t, options.sigma_r) {
        (Some(_), Some(_)) => None,
        (Some(_), None) => Some(2.0 * n - 4.0),
        (None, Some(_)) => Some(n - 2.0),
        (None, None) => Some(freedom),
    };
    Some(Mixture {
        degrees_of_freedom,
        ..mixed(&nodes, (freedom - 2.0) / freedom)?
    })
}

/// The ratios x to go through: one where both noises are stated.
fn ratios(reach: f64, options: &Options) -> Vec<f64> {
    if let (Some(sigma_t), Some(sigma_r)) = (options.sigma_t, options.sigma_r) {
        return vec![reach * sigma_r / sigma_t];
    }
    let part = |k: usize| k as f64 / (GRID - 1) as f64;
    let all = (0..GRID).map(|k| RANGE[0] * (RANGE[1] / RANGE[0]).powf(part(k)));
    all.collect()
}

/// (2); `spread` multiplies the scatter of the nodes.
fn mixed(nodes: &[Node], spread: f64) -> Option<Mixture> {
    let most = nodes
        .iter()
        .map(|n| n.ln_weight)
        .fold(f64::NEG_INFINITY, f64::max);
    if !most.is_finite() {
        return None;
    }
    let weights: Vec<f64> = nodes.iter().map(|n| (n.ln_weight - most).exp()).collect();
    let total: f64 = weights.iter().sum();
    let weighed = || nodes.iter().zip(weights.iter().map(|w| w / total));
    let mean: Vector6<f64> = weighed().map(|(n, w)| n.at * w).sum();
    let covariance: Matrix6<f64> = weighed()
        .map(|(n, w)| {
            let off = n.at - mean;
            (n.covariance + off * off.transpose() * spread) * w
        })
        .sum();
    Some(Mixture {
        mean,
        covariance,
        degrees_of_freedom: None,
    })
}
