//! Levenberg–Marquardt for a handful of unknowns on a manifold.
//!
//! ```text
//! minimize c(x) = Σ rᵢ(x)²,   (H + λ diag H) δ = −g,   x ← x ⊞ δ,   H = JᵀJ, g = Jᵀr      (1)
//! ```
//!
//! The problem says how to linearize, solve and step, so that an estimator may eliminate its own
//! nuisance unknowns (a radius, an angle for each frame); the loop here only decides how bold to be.
//! Nielsen 1999 (damping by gain ratio). It finds the nearest minimum and does not prove that it is the global one.

/// What the loop needs to know about a problem.
pub trait Problem {
    /// A point of the manifold.
    type Point: Clone;
    /// Cost, gradient and Hessian approximation at a point.
    type Normal;
    /// A tangent step.
    type Step;

    /// Linearizes at `x`.
    fn linearize(&self, x: &Self::Point) -> Self::Normal;
    /// c(x); not finite where x is outside the domain.
    fn cost(&self, normal: &Self::Normal) -> f64;
    /// The damped step and the decrease of c that the model predicts; `None` where the system is singular.
    fn solve(&self, normal: &Self::Normal, damping: f64) -> Option<(Self::Step, f64)>;
    /// x ⊞ δ.
    fn retract(&self, x: &Self::Point, step: &Self::Step) -> Self::Point;
    /// True when a step is below what the unknowns can resolve.
    fn is_negligible(&self, x: &Self::Point, step: &Self::Step) -> bool;
}

/// Why the loop ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Stop {
    /// The step, or the decrease still to be had, is below rounding.
    Converged,
    /// Iterations used up.
    MaxIterations,
    /// No finite step could be taken.
    Broken,
}

/// Where the loop ended.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Minimum<P: Problem> {
    /// The last accepted point.
    pub x: P::Point,
    /// Its linearization.
    pub normal: P::Normal,
    /// Accepted and rejected steps.
    pub iterations: usize,
    /// Why it ended.
    pub stop: Stop,
}

/// Starting damping: nearly Gauss–Newton, since every caller starts from a closed form.
const FIRST_DAMPING: f64 = 1e-6;
/// Predicted decrease, relative to the cost, that rounding of the cost swallows.
const ROUNDING: f64 = 1e-13;
/// Relative growth of the cost that is rounding of its sum.
const HARMLESS: f64 = 1e-12;

/// Runs the loop from `start`.
pub fn minimize<P: Problem>(problem: &P, start: P::Point, max_iterations: usize) -> Minimum<P> {
    let mut x = start;
    let mut normal = problem.linearize(&x);
    let mut damping = FIRST_DAMPING;
    let mut growth = 2.0;
    let mut last_predicted = f64::INFINITY;
    for iterations in 0..max_iterations {
        let cost = problem.cost(&normal);
        let Some((step, predicted)) = problem.solve(&normal, damping) else {
            if damping > 1e12 {
                return Minimum {
                    x,
                    normal,
                    iterations,
                    stop: Stop::Broken,
                };
            }
            damping = damping.max(1e-9) * 10.0;
            continue;
        };
        if predicted <= ROUNDING * cost || problem.is_negligible(&x, &step) {
            // The cost can no longer judge a step, the gradient still can: follow it while steps shrink.
            let trial = problem.retract(&x, &step);
            let trial_normal = problem.linearize(&trial);
            let harmless = problem.cost(&trial_normal) <= cost * (1.0 + HARMLESS);
            let settled = problem.is_negligible(&x, &step) || predicted > 0.25 * last_predicted;
            if harmless {
                x = trial;
                normal = trial_normal;
            }
            if settled || !harmless {
                return Minimum {
                    x,
                    normal,
                    iterations,
                    stop: Stop::Converged,
                };
            }
            last_predicted = predicted;
            continue;
        }
        let trial = problem.retract(&x, &step);
        let trial_normal = problem.linearize(&trial);
        let gain = (cost - problem.cost(&trial_normal)) / predicted;
        if gain.is_finite() && gain > 0.0 {
            x = trial;
            normal = trial_normal;
            damping *= (1.0 - (2.0 * gain - 1.0).powi(3)).clamp(1.0 / 10.0, 2.0);
            damping = damping.max(1e-15);
            growth = 2.0;
        } else {
            damping *= growth;
            growth *= 2.0;
            if damping > 1e12 {
                // Not even the smallest step goes down: the minimum, unless the cost means nothing.
                let stop = if cost.is_finite() {
                    Stop::Converged
                } else {
                    Stop::Broken
                };
                return Minimum {
                    x,
                    normal,
                    iterations,
                    stop,
                };
            }
        }
    }
    Minimum {
        x,
        normal,
        iterations: max_iterations,
        stop: Stop::MaxIterations,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rosenbrock's valley: r = (10 (y − x²), 1 − x).
    struct Valley;

    impl Problem for Valley {
        type Point = [f64; 2];
        type Normal = ([f64; 2], [[f64; 2]; 2], f64);
        type Step = [f64; 2];

        fn linearize(&self, x: &[f64; 2]) -> Self::Normal {
            let r = [10.0 * (x[1] - x[0] * x[0]), 1.0 - x[0]];
            let j = [[-20.0 * x[0], 10.0], [-1.0, 0.0]];
            let g = [0, 1].map(|c| j[0][c] * r[0] + j[1][c] * r[1]);
            let h = [0, 1].map(|a| [0, 1].map(|b| j[0][a] * j[0][b] + j[1][a] * j[1][b]));
            (g, h, r[0] * r[0] + r[1] * r[1])
        }
        fn cost(&self, n: &Self::Normal) -> f64 {
            n.2
        }
        fn solve(&self, (g, h, _): &Self::Normal, damping: f64) -> Option<([f64; 2], f64)> {
            let (a, b, d) = (
                h[0][0] * (1.0 + damping),
                h[0][1],
                h[1][1] * (1.0 + damping),
            );
            let det = a * d - b * b;
            let step = [(-d * g[0] + b * g[1]) / det, (b * g[0] - a * g[1]) / det];
            let predicted = -(step[0] * g[0] + step[1] * g[1]);
            det.is_normal().then_some((step, predicted))
        }
        fn retract(&self, x: &[f64; 2], s: &[f64; 2]) -> [f64; 2] {
            [x[0] + s[0], x[1] + s[1]]
        }
        fn is_negligible(&self, _: &[f64; 2], s: &[f64; 2]) -> bool {
            s[0].abs().max(s[1].abs()) < 1e-14
        }
    }

    #[test]
    fn it_walks_down_rosenbrocks_valley() {
        let end = minimize(&Valley, [-1.2, 1.0], 100);
        assert_eq!(
            end.stop,
            Stop::Converged,
            "{:?} after {}",
            end.x,
            end.iterations
        );
        assert!(
            (end.x[0] - 1.0).abs() < 1e-10 && (end.x[1] - 1.0).abs() < 1e-10,
            "{:?}",
            end.x
        );
    }

    #[test]
    fn a_point_that_is_not_finite_does_not_loop_for_ever() {
        let end = minimize(&Valley, [f64::NAN, 1.0], 100);
        assert_ne!(end.stop, Stop::Converged);
    }
}
