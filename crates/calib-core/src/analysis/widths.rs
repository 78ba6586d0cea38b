//! How wide the priors of one kind of parameter should be, by evidence.
//!
//! The widths σ_i of a kind k share one unknown factor f_k. With z = (x − x₀)/σ of the parameters that have a prior, M the
//! information of the data about z once all others are integrated out, and D = diag(f):
//!
//! ```text
//! ln E(f) = −½ ln|M + D⁻²| − Σ_i ln f_i + ½ bᵀ(M + D⁻²)⁻¹b − Σ_k u_k²/2s²,   b = (M + I) ẑ,   u = ln f     (1)
//! ∂ ln E/∂u_k = Σ_i (z_i²/f_k² − share_i) − u_k/s²,   share = diag(W),   W = I − D⁻¹(M + D⁻²)⁻¹D⁻¹          (2)
//! information_kl = 2 Σ_{i in k, j in l} W_ij² + δ_kl/s²                                                    (3)
//! ```
//!
//! (1) is the restricted likelihood of a variance component (MacKay 1992), Laplace's at the minimum; ẑ is the solution at f = 1. M
//! and b follow from the covariance and the values that a solution has: no factor costs a linearization. A gauge has no part in M:
//! it adds 0 − 0 to (2), whatever the width, since its values stay at the center of the prior.
//!
//! A width that is likelier is used where it also predicts better: the values move by more than the data can miss, and left-out poses
//! are predicted better (no worse, where all widths grow). Otherwise the given one stays.

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

use calib_geometry::decompose::{inverse_root, semidefinite_eigen, solve_least_squares};

use crate::analysis::information::Information;
use crate::analysis::refit::{Start, refit};
use crate::analysis::scores::{Scores, mean};
use crate::analysis::settings::Settings;
use crate::analysis::solution::{Solution, describe_parameters};
use crate::graph::ids::ParameterId;
use crate::solve::minimize::SolveStatus;

/// Parameters whose prior widths share one factor.
#[derive(Debug, Clone, PartialEq)]
pub struct WidthKind {
    /// Which. Those without prior have no part in it.
    pub parameters: Vec<ParameterId>,
    /// The factor that their priors have already, over the widths that were given first.
    pub factor: f64,
}

impl WidthKind {
    /// Parameters with the widths that were given first.
    #[must_use]
    pub fn new(parameters: Vec<ParameterId>) -> Self {
        Self {
            parameters,
            factor: 1.0,
        }
    }
}

/// What the data say of the prior widths of one kind.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct WidthEstimate {
    /// f over the widths that were given first; 1 where those are used.
    pub factor: f64,
    /// f of equation (1); 1 where the data do not speak against the widths that were given first.
    pub likeliest: f64,
    /// Standard error of its logarithm.
    pub relative_error: f64,
    /// Σ share of equation (2): how many numbers of the kind the data determine.
    pub determined: f64,
    /// How many numbers have the width.
    pub count: usize,
}

/// The widths that the data speak for, and the solution under them.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Widened {
    /// One per kind, in the order given.
    pub widths: Vec<WidthEstimate>,
    /// The solution under them; `None` where it is the one that was given.
    pub solution: Option<Solution>,
}

/// Factors on a width, at least and at most: what is beyond is another robot or another unit, and a finding says so.
const RANGE: (f64, f64) = (0.1, 10.0);
/// s of equation (1): widths that are stated for all robots are right within a factor of three, two times in three.
const SPREAD: f64 = 1.1;
/// A width from fewer numbers is known to no better than 1/√(2·6), 29 %: one of them that is far off decides alone.
const FEWEST: usize = 6;
/// A width is changed where it is off by more than this many standard errors of ln f.
const SHOWN: f64 = 2.0;
/// No width is made so narrow that a number deviates by more than this many of it: one exchanged part must not be forced to its
/// nominal value by the many good ones.
const WITHIN: f64 = 3.0;
/// Widths that move the values by less than this squared distance, in σ of all data, change no prediction that anyone could tell.
const UNSEEN: f64 = 1.0;
/// Ratio of left-out errors from which on one is smaller than the other.
const SAME: f64 = 1.005;
/// Poses that are left out in turn at most, evenly over all.
const POSES: usize = 200;
/// Widths and values are brought together this many times…
const TURNS: usize = 3;
/// …or until no width changes by more than this, relatively.
const SETTLED: f64 = 0.05;

impl Solution {
    /// The widths that the data speak for, one factor for the priors of each kind, and the solution under them. `None` where this
    /// is no solution, or where it has no covariance to judge by.
    #[must_use]
    pub fn widened(&self, kinds: &[WidthKind], settings: &Settings) -> Option<Widened> {
        let mut known: Vec<f64> = kinds.iter().map(|kind| kind.factor.ln()).collect();
        let mut found: Option<Solution> = None;
        let given = known.clone();
        let mut widths = Vec::new();
        for turn in 0..TURNS {
            let now = found.as_ref().unwrap_or(self);
            if now.status != SolveStatus::Converged {
                break;
            }
            let evidence = Evidence::of(now, kinds, &known)?;
            let (logs, again) = evidence.best();
            widths = again;
            let change = |(a, b): (&f64, &f64)| (a - b).abs();
            let change = logs.iter().zip(&known).map(change).fold(0.0, f64::max);
            if change < SETTLED || (turn == 0 && evidence.moved(&logs)? < UNSEEN) {
                break;
            }
            found = Some(now.under_widths(kinds, &logs, &known, settings)?);
            known = logs;
        }
        let wider = known.iter().zip(&given).all(|(k, g)| k >= g);
        let better = |found: &Self| {
            let converged = found.status.is_converged();
            converged && found.predicts_better_than(self, wider).unwrap_or(false)
        };
        let solution = found.filter(better);
        let used = if solution.is_some() { &known } else { &given };
        for (width, used) in widths.iter_mut().zip(used) {
            width.factor = used.exp();
        }
        Some(Widened { widths, solution })
    }

    /// Whether left-out poses are predicted with a smaller error. How sure that is need not be asked again: the widths themselves are
    /// beyond doubt, and one posture that the wider priors leave to chance is most of the error and of its scatter. Wider priors claim
    /// less: they may predict alike. `None` where nothing can be left out.
    fn predicts_better_than(&self, given: &Self, wider: bool) -> Option<bool> {
        let step = self.model.problem().samples().div_ceil(POSES).max(1);
        let left_out = |of: &Self| of.leave_out(|sample| sample.is_multiple_of(step));
        let (found, given) = (left_out(self)?, left_out(given)?);
        let squares = Scores::of(&[&found, &given]).squares;
        let ratio = (mean(&squares[0]) / mean(&squares[1])).sqrt();
        Some(ratio < 1.0 / SAME || wider && ratio <= 1.0)
    }

    /// The same solution, with what the data leave open under the widths that were given first where narrower ones were found: the
    /// numbers that the data see are no evidence of those that they do not. The covariance grows by what the narrower priors took of it.
    #[must_use]
    pub fn with_given_widths(&self, kinds: &[WidthKind]) -> Option<Self> {
        let mut out = self.clone();
        for kind in kinds.iter().filter(|kind| kind.factor < 1.0) {
            for id in &kind.parameters {
                if let Some(sigma) = &mut out.model.problem.parameters[id.index()].prior_sigma {
                    *sigma /= kind.factor;
                }
            }
        }
        let at = |model| Information::at(model, &self.values, &self.weights, &self.theta);
        let hidden = at(&out.model)?;
        let more = &hidden.covariance - at(&self.model)?.covariance;
        out.information = hidden;
        out.information.covariance = &self.information.covariance + more;
        out.parameters = describe_parameters(&out.model, &out.values, &out.information);
        Some(out)
    }

    /// The same observations under priors with other widths: ln of the factors now, and of those that this solution has.
    fn under_widths(
        &self,
        kinds: &[WidthKind],
        logs: &[f64],
        known: &[f64],
        settings: &Settings,
    ) -> Option<Self> {
        let mut problem = self.model.problem().clone();
        for (k, kind) in kinds.iter().enumerate() {
            for id in &kind.parameters {
                if let Some(sigma) = &mut problem.parameter_mut(*id).prior_sigma {
                    *sigma *= (logs[k] - known[k]).exp();
                }
            }
        }
        let start = Start {
            values: self.values.clone(),
            weights: self.weights.clone(),
            theta: self.theta.clone(),
            iterations: self.iterations,
        };
        refit(&problem, start, settings).ok()
    }
}

/// M of equation (1) from S = C in units of the priors: S⁻¹ − 1, where no direction is known less than the prior alone knows it.
fn information(s: &DMatrix<f64>) -> DMatrix<f64> {
    /// What the data know better than this, relative to the prior's variance, they know.
    const KNOWN: f64 = 1e-10;
    /// Where S⁻¹ is no less than 1 by more than its rounding, it is all there is to ask for.
    const ROUNDING: f64 = 1e-5;
    let n = s.nrows();
    let one = DMatrix::identity(n, n);
    // No eigenvalue of S⁻¹ is larger than its trace.
    let all_known = |inverse: &DMatrix<f64>| inverse.trace() * KNOWN < 1.0;
    let inverse = inverse_root(s).map(|root| root.inverse());
    if let Some(inverse) = inverse.filter(all_known) {
        let m = inverse - &one;
        if inverse_root(&(&m + one * ROUNDING)).is_some() {
            return m;
        }
    }
    let eigen = semidefinite_eigen(s);
    let mut scaled = eigen.vectors.clone();
    for (mut column, value) in scaled.column_iter_mut().zip(&eigen.values) {
        column.scale_mut(1.0 / value.clamp(KNOWN, 1.0) - 1.0);
    }
    scaled * eigen.vectors.transpose()
}

/// Equations (1) to (3) of one solution.
struct Evidence {
    /// M.
    m: DMatrix<f64>,
    b: DVector<f64>,
    /// Kind of each number, `None` for those whose width is not in question.
    kind: Vec<Option<usize>>,
    /// ln f of the solution, per kind.
    known: Vec<f64>,
    /// Least ln f that [`WITHIN`] allows, per kind.
    least: Vec<f64>,
}

/// Equations (1) to (3) at some factors.
struct At {
    z: DVector<f64>,
    value: f64,
    gradient: DVector<f64>,
    information: DMatrix<f64>,
    determined: Vec<f64>,
}

impl Evidence {
    fn of(solution: &Solution, kinds: &[WidthKind], known: &[f64]) -> Option<Self> {
        let parameters = solution.model.problem().parameters();
        // A number at its nominal value because physics allows no less (compliance, backlash) says as much as one that is 0; one that
        // a stated limit stopped would be farther out: it takes no part, and the others are judged beside it.
        let stopped = |p: usize| {
            solution.parameters[p].at_bound && solution.values.0[p] != parameters[p].nominal
        };
        let used: Vec<(usize, usize, f64)> = (0..parameters.len())
            .filter(|&p| !stopped(p))
            .filter_map(|p| Some((p, solution.column_of(p)?, parameters[p].prior_sigma?)))
            .collect();
        let covariance = &solution.information.covariance;
        let n = used.len();
        let scaled = DMatrix::from_fn(n, n, |i, j| {
            covariance[(used[i].1, used[j].1)] / (used[i].2 * used[j].2)
        });
        let z = DVector::from_iterator(
            n,
            used.iter()
                .map(|&(p, _, sigma)| (solution.values.0[p] - parameters[p].nominal) / sigma),
        );
        let m = information(&scaled);
        let b = &m * &z + &z;
        let of = |p: usize| {
            let id = ParameterId::of(p);
            kinds.iter().position(|kind| kind.parameters.contains(&id))
        };
        let kind: Vec<Option<usize>> = used.iter().map(|u| of(u.0)).collect();
        let mut least = vec![RANGE.0.ln(); kinds.len()];
        for (k, z) in kind.iter().zip(z.iter()) {
            if let Some(k) = *k {
                least[k] = least[k].max((z.abs() / WITHIN).ln() + known[k]).min(0.0);
            }
        }
        Some(Self {
            m,
            b,
            kind,
            known: known.to_vec(),
            least,
        })
    }

    fn kinds(&self) -> usize {
        self.known.len()
    }

    /// How far the values move under other widths, squared, in σ of the data.
    fn moved(&self, logs: &[f64]) -> Option<f64> {
        let step = self.at(logs)?.z - self.at(&self.known)?.z;
        Some(step.dot(&(&self.m * &step)))
    }

    fn count(&self, k: usize) -> usize {
        self.kind.iter().filter(|of| **of == Some(k)).count()
    }

    /// At ln f per kind.
    fn at(&self, logs: &[f64]) -> Option<At> {
        let n = self.kind.len();
        // D⁻¹ against the widths that the solution has
        let inverse: Vec<f64> = self
            .kind
            .iter()
            .map(|k| k.map_or(1.0, |k| (self.known[k] - logs[k]).exp()))
            .collect();
        let mut precision = self.m.clone();
        for (i, d) in inverse.iter().enumerate() {
            precision[(i, i)] += d * d;
        }
        let root = inverse_root(&precision)?;
        let half_log_det = 0.5 * root.log_det;
        let covariance = root.inverse();
        let z = &covariance * &self.b;
        let w = DMatrix::from_fn(n, n, |i, j| {
            f64::from(u8::from(i == j)) - inverse[i] * covariance[(i, j)] * inverse[j]
        });
        let mut out = At {
            value: 0.5 * self.b.dot(&z) - half_log_det
                + inverse.iter().map(|d| d.ln()).sum::<f64>(),
            gradient: DVector::zeros(self.kinds()),
            information: DMatrix::zeros(self.kinds(), self.kinds()),
            determined: vec![0.0; self.kinds()],
            z,
        };
        for (i, k) in self.kind.iter().enumerate() {
            let Some(k) = *k else { continue };
            out.gradient[k] += (out.z[i] * inverse[i]).powi(2) - w[(i, i)];
            out.determined[k] += w[(i, i)];
            for (j, l) in self.kind.iter().enumerate() {
                if let Some(l) = *l {
                    out.information[(k, l)] += 2.0 * w[(i, j)].powi(2);
                }
            }
        }
        for (k, u) in logs.iter().enumerate() {
            out.value -= 0.5 * (u / SPREAD).powi(2);
            out.gradient[k] -= u / (SPREAD * SPREAD);
            out.information[(k, k)] += 1.0 / (SPREAD * SPREAD);
        }
        Some(out)
    }

    /// The likeliest ln f of the kinds that are `open`, the others 0.
    fn likeliest(&self, open: &[bool]) -> Option<(Vec<f64>, At)> {
        /// Steps at most; ten are usual.
        const STEPS: usize = 50;
        /// Largest step of ln f: a factor of e.
        const LONGEST: f64 = 1.0;
        /// ln f is near enough.
        const NEAR: f64 = 1e-3;
        let inside = |k: usize, u: f64| u.clamp(self.least[k], RANGE.1.ln());
        let mut logs: Vec<f64> = (0..open.len())
            .map(|k| {
                if open[k] {
                    inside(k, self.known[k])
                } else {
                    0.0
                }
            })
            .collect();
        let mut at = self.at(&logs)?;
        for _ in 0..STEPS {
            // A kind that is closed, or on its end of the range and drawn beyond it, stays.
            let moves: Vec<usize> = (0..open.len())
                .filter(|&k| {
                    open[k] && inside(k, logs[k] + at.gradient[k].signum() * NEAR) != logs[k]
                })
                .collect();
            let information = DMatrix::from_fn(moves.len(), moves.len(), |i, j| {
                at.information[(moves[i], moves[j])]
            });
            let gradient =
                DVector::from_iterator(moves.len(), moves.iter().map(|&k| at.gradient[k]));
            let mut step = solve_least_squares(&information, &gradient, 1e-12).x;
            let longest = step.amax();
            if moves.is_empty() || longest < NEAR {
                break;
            }
            step *= (LONGEST / longest).min(1.0);
            let (tried, next) = loop {
                let mut tried = logs.clone();
                for (i, &k) in moves.iter().enumerate() {
                    tried[k] = inside(k, logs[k] + step[i]);
                }
                match self.at(&tried) {
                    Some(next) if next.value >= at.value => break (tried, next),
                    _ if step.amax() < NEAR => return Some((logs, at)),
                    _ => step *= 0.5,
                }
            };
            (logs, at) = (tried, next);
        }
        Some((logs, at))
    }

    /// ln f of every kind, 0 where the data do not speak against the width.
    fn best(&self) -> (Vec<f64>, Vec<WidthEstimate>) {
        let mut open: Vec<bool> = (0..self.kinds()).map(|k| self.count(k) >= FEWEST).collect();
        let stay = || (vec![0.0; self.kinds()], self.at(&vec![0.0; self.kinds()]));
        let mut found = stay();
        while open.contains(&true) {
            let Some((logs, at)) = self.likeliest(&open) else {
                found = stay();
                break;
            };
            let shown = |k: usize| logs[k].abs() > SHOWN / at.information[(k, k)].sqrt();
            let again: Vec<bool> = (0..open.len()).map(|k| open[k] && shown(k)).collect();
            let settled = again == open;
            found = if settled { (logs, Some(at)) } else { stay() };
            open = again;
            if settled {
                break;
            }
        }
        let (logs, at) = found;
        let widths = (0..self.kinds())
            .map(|k| WidthEstimate {
                factor: logs[k].exp(),
                likeliest: logs[k].exp(),
                relative_error: at
                    .as_ref()
                    .map_or(SPREAD, |at| at.information[(k, k)].sqrt().recip()),
                determined: at.as_ref().map_or(0.0, |at| at.determined[k]),
                count: self.count(k),
            })
            .collect();
        (logs, widths)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two kinds of numbers beside one of neither, seen through rows that mix them.
    fn evidence() -> Evidence {
        let kind = vec![Some(0), Some(1), Some(0), None, Some(1), Some(0), Some(1)];
        let n = kind.len();
        let rows = DMatrix::from_fn(9, n, |i, j| {
            (1.0 + 3.0 * i as f64 + 1.7 * (i * j) as f64).sin() * 2.0
        });
        Evidence {
            m: rows.tr_mul(&rows),
            b: DVector::from_fn(n, |i, _| 20.0 * (i as f64 + 0.3).cos()),
            kind,
            known: vec![0.2, -0.1],
            least: vec![RANGE.0.ln(); 2],
        }
    }

    #[test]
    fn the_gradient_is_the_slope() {
        let of = evidence();
        let logs = [0.4, -0.7];
        let at = of.at(&logs).expect("positive");
        for k in 0..2 {
            let value = |step: f64| {
                let mut moved = logs;
                moved[k] += step;
                of.at(&moved).expect("positive").value
            };
            let slope = (value(1e-5) - value(-1e-5)) / 2e-5;
            assert!((slope - at.gradient[k]).abs() < 1e-6 * (1.0 + slope.abs()));
        }
    }

    /// y = z + e: the marginal of y is N(0, f² + v), whose likelihood needs no integral.
    #[test]
    fn the_value_is_the_marginal_likelihood() {
        let y = [0.8, -2.5, 1.9, 3.3];
        let v = 0.3;
        let of = Evidence {
            m: DMatrix::from_diagonal_element(4, 4, 1.0 / v),
            b: DVector::from_row_slice(&y) / v,
            kind: vec![Some(0); 4],
            known: vec![0.0],
            least: vec![RANGE.0.ln()],
        };
        let value = |u: f64| of.at(&[u]).expect("positive").value;
        let exact = |u: f64| {
            let s = (2.0 * u).exp() + v;
            y.map(|y| -0.5 * (y * y / s + s.ln())).iter().sum::<f64>() - 0.5 * (u / SPREAD).powi(2)
        };
        assert!((value(0.6) - value(0.0) - exact(0.6) + exact(0.0)).abs() < 1e-12);
    }
}
