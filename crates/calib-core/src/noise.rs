//! Noise levels from the residuals: restricted maximum likelihood (REML) over the groups.
//!
//! ```text
//! V_s = Σ_g θ_g V_gs,   A = L⁻¹J,   w = L⁻¹e,   B_g = L⁻¹V_gL⁻ᵀ,   Q = A C Aᵀ   (V = LLᵀ)      (1)
//! score_g  = ½ Σ_s [ wᵀB_g w − tr(B_g (I − Q)) ]                                          (2)
//! fisher_gh = ½ Σ_s tr(B_g (I − Q) B_h (I − Q))                                           (3)
//! ```
//!
//! `tr(B_g(I − Q))` instead of `tr(B_g)` is what REML adds to ML: the parameters that were fitted
//! have used up their share of the residuals. Scoring runs on log θ, so a variance stays positive.

use nalgebra::{DMatrix, DVector};

use crate::minimize::{cholesky_in_place, solve_in_place};
use crate::model::{Model, Values};
use crate::normal::{NormalEquations, Workspace, accumulate};
use crate::path::Derivatives;
use crate::rows::{SampleRows, add_block};

/// A σ may fall to this fraction of what was stated before it counts as zero.
const FLOOR: f64 = 1e-3;
/// Largest change of log θ in one step: a factor of 7 in variance.
const MAX_STEP: f64 = 2.0;

/// State of the variance components after one scoring step.
#[derive(Debug, Clone)]
pub(crate) struct Scoring {
    /// New σ² per group.
    pub theta: Vec<f64>,
    /// Largest |Δ log θ| among the groups that are still above their floor.
    pub change: f64,
    /// Standard error of each group's σ relative to σ; `None` for stated ones.
    pub relative_sigma: Vec<Option<f64>>,
}

/// (H + tiny ridge)⁻¹: directions that nothing sees have A v = 0 and do not matter in Q.
pub(crate) fn covariance_of(system: &NormalEquations) -> Option<DMatrix<f64>> {
    /// Relative ridge: far below any direction that influences a prediction.
    const RIDGE: f64 = 1e-11;
    let n = system.n;
    let scale: Vec<f64> = (0..n)
        .map(|i| {
            let d = system.h[i * n + i];
            if d > 0.0 { 1.0 / d.sqrt() } else { 1.0 }
        })
        .collect();
    let mut l = vec![0.0; n * n];
    for i in 0..n {
        for j in 0..i {
            l[i * n + j] = system.h[j * n + i] * scale[i] * scale[j];
        }
        l[i * n + i] = 1.0 + RIDGE;
    }
    let mut ridge = RIDGE;
    let full = l.clone();
    while !cholesky_in_place(&mut l, n) {
        ridge *= 10.0;
        if ridge > 1e-6 {
            return None;
        }
        l.copy_from_slice(&full);
        for i in 0..n {
            l[i * n + i] = 1.0 + ridge;
        }
    }
    let mut c = DMatrix::zeros(n, n);
    let mut y = vec![0.0; n];
    for k in 0..n {
        y.fill(0.0);
        y[k] = 1.0;
        solve_in_place(&l, n, &mut y);
        for i in 0..n {
            c[(i, k)] = y[i] * scale[i] * scale[k];
        }
    }
    Some(c)
}

/// One sample in whitened form: A (m × n), w (m), L⁻¹ (m × m) and G (m × k).
pub(crate) struct Whitened {
    pub a: DMatrix<f64>,
    pub w: DVector<f64>,
    pub l: DMatrix<f64>,
    pub l_inverse: DMatrix<f64>,
    pub g: DMatrix<f64>,
    pub log_det: f64,
    /// (observation, first row, rows)
    pub blocks: Vec<(usize, usize, usize)>,
}

/// Rows of a sample, whitened by their V; `None` when V is not positive definite or there are none.
pub(crate) fn whitened(
    model: &Model,
    values: &Values,
    weights: &[f64],
    theta: &[f64],
    sample: usize,
    work: &mut Workspace,
) -> Option<Whitened> {
    let rows: &mut SampleRows = &mut work.rows;
    rows.fill(
        model,
        &work.cache,
        values,
        weights,
        sample,
        Derivatives::All,
    );
    if rows.m == 0 {
        return None;
    }
    let (m, n, k) = (rows.m, rows.n, rows.k);
    let g = DMatrix::from_row_slice(m, k, &rows.g[..m * k]);
    rows.covariance(model, weights, theta);
    let log_det = rows.factor()?;
    rows.whiten(true);
    let mut l = DMatrix::zeros(m, m);
    let mut l_inverse = DMatrix::zeros(m, m);
    for i in 0..m {
        for j in 0..=i {
            l[(i, j)] = rows.v[i * m + j];
        }
    }
    for c in 0..m {
        for i in c..m {
            let mut sum = if i == c { 1.0 } else { 0.0 };
            for j in c..i {
                sum -= l[(i, j)] * l_inverse[(j, c)];
            }
            l_inverse[(i, c)] = sum / l[(i, i)];
        }
    }
    Some(Whitened {
        a: DMatrix::from_row_slice(m, n, &rows.j[..m * n]),
        w: DVector::from_row_slice(&rows.r[..m]),
        l,
        l_inverse,
        g,
        log_det,
        blocks: rows.blocks.clone(),
    })
}

/// B_g of equation (1) for the groups that are to be estimated.
fn components(model: &Model, weights: &[f64], groups: &[usize], s: &Whitened) -> Vec<DMatrix<f64>> {
    let m = s.w.len();
    groups
        .iter()
        .map(|&g| {
            let mut v = DMatrix::zeros(m, m);
            let mut any = false;
            for &(o, first, _) in &s.blocks {
                add_block(model, o, |i, j, group, shape| {
                    if group == g {
                        v[(first + i, first + j)] = shape / weights[o];
                        v[(first + j, first + i)] = shape / weights[o];
                        any = true;
                    }
                });
            }
            let mut b = if any {
                &s.l_inverse * v * s.l_inverse.transpose()
            } else {
                v
            };
            for (k, slot) in model.slots.iter().enumerate() {
                if slot.group == Some(g) {
                    let u = &s.l_inverse * s.g.column(k);
                    b.ger(1.0, &u, &u, 1.0);
                }
            }
            b
        })
        .collect()
}

/// One step of (2) and (3) at fixed values; `None` when the model cannot be evaluated.
pub(crate) fn score(
    model: &Model,
    values: &Values,
    weights: &[f64],
    theta: &[f64],
    work: &mut Workspace,
    system: &mut NormalEquations,
) -> Option<Scoring> {
    let groups: Vec<usize> = (0..theta.len())
        .filter(|&g| model.problem.groups[g].estimate)
        .collect();
    let mut relative_sigma = vec![None; theta.len()];
    if groups.is_empty() {
        return Some(Scoring {
            theta: theta.to_vec(),
            change: 0.0,
            relative_sigma,
        });
    }
    if !accumulate(model, values, weights, theta, work, system) {
        return None;
    }
    let c = covariance_of(system)?;
    let count = groups.len();
    let mut gradient = DVector::zeros(count);
    let mut fisher = DMatrix::zeros(count, count);
    for sample in 0..model.problem.samples {
        let Some(s) = whitened(model, values, weights, theta, sample, work) else {
            continue;
        };
        let m = s.w.len();
        let mut left = DMatrix::identity(m, m);
        left -= &s.a * &c * s.a.transpose();
        let b = components(model, weights, &groups, &s);
        let reduced: Vec<DMatrix<f64>> = b.iter().map(|b| b * &left).collect();
        for g in 0..count {
            gradient[g] += 0.5 * (s.w.dot(&(&b[g] * &s.w)) - reduced[g].trace());
            for h in 0..=g {
                let t = 0.5 * reduced[g].dot(&reduced[h].transpose());
                fisher[(g, h)] += t;
                if h != g {
                    fisher[(h, g)] += t;
                }
            }
        }
    }
    // In log θ: chain rule by θ on both sides.
    for g in 0..count {
        gradient[g] *= theta[groups[g]];
        for h in 0..count {
            fisher[(g, h)] *= theta[groups[g]] * theta[groups[h]];
        }
    }
    let floor = |g: usize| (model.problem.groups[g].sigma * FLOOR).powi(2);
    let mut next = theta.to_vec();
    let mut change: f64 = 0.0;
    // Two groups that the data cannot tell apart make (3) singular: least squares shares the step.
    let solved = calib_geometry::decompose::solve_least_squares(&fisher, &gradient, 1e-10);
    for (i, &g) in groups.iter().enumerate() {
        let step = if solved.x[i].is_finite() {
            solved.x[i].clamp(-MAX_STEP, MAX_STEP)
        } else {
            0.0
        };
        next[g] = (theta[g] * step.exp()).max(floor(g));
        change = change.max((next[g] / theta[g]).ln().abs());
    }
    let spread = calib_geometry::decompose::symmetric_eigen(&fisher);
    let largest = spread.values.iter().copied().fold(0.0, f64::max);
    for (i, &g) in groups.iter().enumerate() {
        // σ(log σ) = ½ σ(log θ)
        let variance: f64 = (0..count)
            .map(|k| {
                let v = spread.vectors[(i, k)];
                if spread.values[k] > 1e-12 * largest {
                    v * v / spread.values[k]
                } else if v.abs() > 1e-6 {
                    f64::INFINITY
                } else {
                    0.0
                }
            })
            .sum();
        relative_sigma[g] = Some(0.5 * variance.sqrt()).filter(|x| x.is_finite());
    }
    Some(Scoring {
        theta: next,
        change,
        relative_sigma,
    })
}

/// Covariance of the parameters that does not trust the noise model: clusters are samples (CR2).
///
/// ```text
/// C (Σ_s Aᵀ(I − Q)^(-½) w wᵀ (I − Q)^(-½) A + Λ) C                                         (4)
/// ```
///
/// Bell & McCaffrey 2002. The prior enters as if it were right. `None` when the model cannot be
/// evaluated.
#[must_use]
pub fn sandwich(
    model: &Model,
    values: &Values,
    weights: &[f64],
    theta: &[f64],
) -> Option<DMatrix<f64>> {
    let n = model.free();
    let mut work = Workspace::new(model);
    let mut system = NormalEquations::new(n);
    if !accumulate(model, values, weights, theta, &mut work, &mut system) {
        return None;
    }
    let c = covariance_of(&system)?;
    let mut meat = DMatrix::zeros(n, n);
    for (i, &p) in model.columns.iter().enumerate() {
        if let Some(sigma) = model.problem.parameters[p].prior_sigma {
            meat[(i, i)] = 1.0 / (sigma * sigma);
        }
    }
    for sample in 0..model.problem.samples {
        let Some(s) = whitened(model, values, weights, theta, sample, &mut work) else {
            continue;
        };
        let m = s.w.len();
        let left = DMatrix::identity(m, m) - &s.a * &c * s.a.transpose();
        let eigen = calib_geometry::decompose::symmetric_eigen(&left);
        // (I − Q)^(-½) w; a direction with leverage 1 carries no residual.
        let mut coefficients = eigen.vectors.tr_mul(&s.w);
        for k in 0..m {
            coefficients[k] = if eigen.values[k] > 1e-10 {
                coefficients[k] / eigen.values[k].sqrt()
            } else {
                0.0
            };
        }
        let adjusted = &eigen.vectors * coefficients;
        let score = s.a.tr_mul(&adjusted);
        meat.ger(1.0, &score, &score, 1.0);
    }
    Some(&c * meat * &c)
}
