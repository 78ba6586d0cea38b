//! Noise levels from the residuals: restricted maximum likelihood (REML) over the groups.
//!
//! ```text
//! V_s = Σ_g θ_g V_gs,   P_s = V_s⁻¹ − V_s⁻¹ J_s C J_sᵀ V_s⁻¹,   C = H⁻¹                         (1)
//! score_g  = ½ Σ_s [ eᵀV⁻¹V_gV⁻¹e − tr(V_g P) ]
//!          = ½ Σ_s [ eᵀV⁻¹V_gV⁻¹e − tr(V_g V⁻¹) ] + ½ tr(C Σ_s JᵀV⁻¹V_gV⁻¹J)                   (2)
//! fisher_gh = ½ Σ_s tr(V_g V⁻¹ V_h V⁻¹) · √(ρ_g ρ_h),   ρ_g = Σ_s tr(V_g P) / Σ_s tr(V_g V⁻¹)    (3)
//! ```
//!
//! `tr(V_g P)` instead of `tr(V_g V⁻¹)` is what REML adds to ML: the parameters that were fitted
//! have used up their share ρ of the residuals. Equation (2) is exact; (3) only sets the length of a
//! step and the standard error of σ, and is exact for one group. The second form of (2) needs one sum
//! over the samples like the normal equations, no product over pairs of rows. Scoring runs on log θ, so a
//! variance stays positive.
//!
//! With about as many unknowns as measurements, (1) is nearly flat in the noise of the tracker, and often rises to σ = 0: residuals
//! that the unknowns have taken up altogether say nothing of it. What is stated of a tracker is then all that is known, and it is
//! seldom much too large. Below β times the stated σ₀ a log-normal prior holds it, which the data soon outweigh:
//!
//! ```text
//! score_g ← score_g − u/s²,   fisher_gg ← fisher_gg + 1/s²,   u = log(θ_g / (β σ₀)²) < 0        (4)
//! ```

use nalgebra::{DMatrix, DVector};

use calib_geometry::decompose::{solve_least_squares, symmetric_eigen};

use crate::graph::problem::{NoiseGroup, NoiseKind};
use crate::model::values::Values;
use crate::solve::components::{Sums, sums};
use crate::solve::equations::{Objective, Workspace};
use crate::solve::whitened::covariance_of;

/// A σ may fall to this fraction of the stated one before it counts as zero.
const FLOOR: f64 = 1e-3;
/// β of equation (4): trackers are up to twice as good as their data sheets say…
const BETTER: f64 = 0.5;
/// …and s: better by a factor of e in σ² beyond that once in three times.
const SPREAD: f64 = 1.0;
/// Largest change of log θ in one step: a factor of 7 in variance.
const MAX_STEP: f64 = 2.0;

/// State of the variance components after one scoring step.
#[derive(Debug, Clone)]
pub(crate) struct Scoring {
    /// New σ² per group.
    pub theta: Vec<f64>,
    /// Largest |Δ log θ| among the groups that are still above their floor.
    pub change: f64,
    /// By how much the step makes the observations likelier, nats, to second order.
    pub gain: f64,
    /// Standard error of each group's σ relative to σ; `None` for stated ones.
    pub relative_sigma: Vec<Option<f64>>,
}

/// One step of (2) and (3) at fixed values; `None` when the model cannot be evaluated.
pub(crate) fn score(
    objective: Objective,
    values: &Values,
    work: &mut Workspace,
) -> Option<Scoring> {
    let Objective { model, theta, .. } = objective;
    let groups: Vec<usize> = (0..theta.len())
        .filter(|&g| model.problem.groups[g].estimate)
        .collect();
    let mut out = Scoring {
        theta: theta.to_vec(),
        change: 0.0,
        gain: 0.0,
        relative_sigma: vec![None; theta.len()],
    };
    if groups.is_empty() {
        return Some(out);
    }
    let sums = sums(objective, values, &groups, work)?;
    let c = covariance_of(&sums.normal_equations(model, values))?;
    let (mut gradient, mut fisher) = gradient_and_fisher(&sums, &c);
    let relative = relative_sigmas(&fisher);
    for (i, &g) in groups.iter().enumerate() {
        let (slope, information) = expectation(&model.problem.groups[g], theta[g]);
        gradient[i] += slope;
        fisher[(i, i)] += information;
    }
    // Two groups that the data cannot distinguish make (3) singular: least squares shares the step.
    let solved = solve_least_squares(&fisher, &gradient, 1e-10);
    for (i, &g) in groups.iter().enumerate() {
        let step = if solved.x[i].is_finite() {
            solved.x[i].clamp(-MAX_STEP, MAX_STEP)
        } else {
            0.0
        };
        out.gain += 0.5 * gradient[i] * step;
        // θ ← θ exp(Δ log θ)
        let floor = (model.problem.groups[g].sigma * FLOOR).powi(2);
        out.theta[g] = (theta[g] * step.exp()).max(floor);
        out.change = out.change.max((out.theta[g] / theta[g]).ln().abs());
        out.relative_sigma[g] = relative[i];
    }
    Some(out)
}

/// Slope and information of equation (4).
fn expectation(group: &NoiseGroup, theta: f64) -> (f64, f64) {
    if !matches!(group.kind, NoiseKind::Position | NoiseKind::Orientation) {
        return (0.0, 0.0);
    }
    let below = (theta / (BETTER * group.sigma).powi(2)).ln();
    if below >= 0.0 {
        return (0.0, 0.0);
    }
    (-below / (SPREAD * SPREAD), 1.0 / (SPREAD * SPREAD))
}

/// Equations (2) and (3) for log θ. The sums are 1/θ too large in every factor: exactly the chain rule to log θ.
fn gradient_and_fisher(sums: &Sums, c: &DMatrix<f64>) -> (DVector<f64>, DMatrix<f64>) {
    let count = sums.squares.len();
    // tr(C Σ JᵀV⁻¹V_gV⁻¹J)
    let taken = sums.traces_with(c);
    // ρ_g = 1 − taken_g / tr(V_g V⁻¹)
    let share = |g: usize| {
        let left = 1.0 - taken[g] / sums.traces[g];
        if left.is_finite() { left.max(0.0) } else { 0.0 }
    };
    let mut gradient = DVector::zeros(count);
    let mut fisher = DMatrix::zeros(count, count);
    for g in 0..count {
        gradient[g] = 0.5 * (sums.squares[g] - sums.traces[g] + taken[g]);
        for h in 0..count {
            fisher[(g, h)] = 0.5 * sums.products[(g, h)] * (share(g) * share(h)).sqrt();
        }
    }
    (gradient, fisher)
}

/// Standard errors of log σ from (3); `None` for a group that the data cannot distinguish from another.
fn relative_sigmas(fisher: &DMatrix<f64>) -> Vec<Option<f64>> {
    let spread = symmetric_eigen(fisher);
    let largest = spread.values.iter().copied().fold(0.0, f64::max);
    let of_direction = |i: usize, k: usize| {
        let v = spread.vectors[(i, k)];
        if spread.values[k] > 1e-12 * largest {
            v * v / spread.values[k]
        } else if v.abs() > 1e-6 {
            f64::INFINITY
        } else {
            0.0
        }
    };
    let count = fisher.nrows();
    (0..count)
        .map(|i| {
            // σ(log σ) = ½ σ(log θ)
            let variance: f64 = (0..count).map(|k| of_direction(i, k)).sum();
            Some(0.5 * variance.sqrt()).filter(|x| x.is_finite())
        })
        .collect()
}

#[cfg(test)]
mod tests;
