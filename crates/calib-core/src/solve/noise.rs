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

use nalgebra::{DMatrix, DVector};

use crate::model::layout::Model;
use crate::model::path::Derivatives;
use crate::model::values::Values;
use crate::solve::minimize::{cholesky_in_place, solve_in_place};
use crate::solve::normal::{NormalEquations, Workspace, accumulate, add_prior};
use crate::solve::panel::Local;
use crate::solve::rows::{SampleRows, add_block};

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

/// One sample in whitened form, V = LLᵀ: A = L⁻¹J (m × n), w (m), L⁻¹ (m × m).
pub(crate) struct Whitened {
    pub a: DMatrix<f64>,
    pub w: DVector<f64>,
    pub l: DMatrix<f64>,
    pub l_inverse: DMatrix<f64>,
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
    let (m, n) = (rows.m, rows.n);
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
        log_det,
        blocks: rows.blocks.clone(),
    })
}

/// Group of every row of a sample, in the order of its rows.
fn row_groups(model: &Model, blocks: &[(usize, usize, usize)], out: &mut Vec<usize>) {
    out.clear();
    for &(o, first, count) in blocks {
        out.resize(first + count, 0);
        add_block(model, o, |i, j, group, _| {
            if i == j {
                out[first + i] = group;
            }
        });
    }
}

/// Sums of (2) and (3) over the samples, for the groups that are to be estimated.
struct Sums {
    /// eᵀV⁻¹V_gV⁻¹e
    squares: DVector<f64>,
    /// tr(V_g V⁻¹)
    traces: DVector<f64>,
    /// tr(V_g V⁻¹ V_h V⁻¹)
    products: DMatrix<f64>,
    /// JᵀV⁻¹V_gV⁻¹J, and last the same of everything that is not to be estimated. Their sum is JᵀV⁻¹J.
    moments: Vec<Local>,
}

impl Sums {
    /// H of the sums and the prior; without gradient and cost.
    fn normal_equations(&self, model: &Model, values: &Values) -> NormalEquations {
        let n = model.free();
        let mut system = NormalEquations::new(n);
        for moment in &self.moments {
            for a in 0..n {
                for b in a..n {
                    system.h[a * n + b] += moment.h[(a, b)];
                }
            }
        }
        add_prior(model, values, &mut system);
        system
    }
}

/// One pass over the samples; `None` when the model cannot be evaluated.
///
/// In block-whitened rows (D = L_D L_Dᵀ) a group of measurement noise is V_g = E_g/θ_g with E_g the unit matrix on its
/// rows, a group of random effects V_u = u uᵀ/θ_u summed over its columns u, and V⁻¹ the weighing of
/// [`structured`](crate::solve::structured), equation (3).
fn sums(
    model: &Model,
    values: &Values,
    weights: &[f64],
    theta: &[f64],
    groups: &[usize],
    work: &mut Workspace,
) -> Option<Sums> {
    let n = model.free();
    let count = groups.len();
    let most = model.max_rows.max(model.slots.len());
    let mut sums = Sums {
        squares: DVector::zeros(count),
        traces: DVector::zeros(count),
        products: DMatrix::zeros(count, count),
        moments: (0..=count).map(|_| Local::new(n, most)).collect(),
    };
    // Random effects of every group, and last those of none.
    let mut slots_of = vec![Vec::new(); count + 1];
    for (k, slot) in model.slots.iter().enumerate() {
        let group = groups.iter().position(|g| slot.group == Some(*g));
        slots_of[group.unwrap_or(count)].push(k);
    }
    let place: Vec<Option<usize>> = (0..theta.len())
        .map(|g| groups.iter().position(|h| *h == g))
        .collect();
    let mut group_of = Vec::new();
    work.cache.update(&model.problem, values);
    let Workspace {
        cache,
        rows,
        random,
        ..
    } = work;
    for sample in 0..model.problem.samples {
        rows.fill(model, cache, values, weights, sample, Derivatives::All);
        let (m, k) = (rows.m, rows.k);
        if m == 0 {
            continue;
        }
        rows.whiten_blocks(model, weights, theta, true)?;
        rows.random_part(random)?;
        row_groups(model, &rows.blocks, &mut group_of);
        // V⁻¹ in block-whitened rows, and what it makes of e, J and U.
        let mut p0 = unit_matrix(m);
        random.weigh(&mut p0, m);
        let u = rows.g[..m * k].to_vec();
        let mut pu = u.clone();
        random.weigh(&mut pu, k);
        random.weigh(&mut rows.r[..m], 1);
        random.weigh(&mut rows.j[..m * n], n);
        let upu = inner_products(&u, &pu, k);
        for i in 0..m {
            let group = place[group_of[i]];
            sums.moments[group.unwrap_or(count)]
                .rows(1)
                .copy_from_slice(&rows.j[i * n..(i + 1) * n]);
            let Some(g) = group else { continue };
            sums.squares[g] += rows.r[i] * rows.r[i];
            sums.traces[g] += p0[i * m + i];
            for j in 0..m {
                if let Some(h) = place[group_of[j]] {
                    sums.products[(g, h)] += p0[i * m + j] * p0[i * m + j];
                }
            }
        }
        let weighed = Weighed {
            u: &u,
            pu: &pu,
            upu: &upu,
            r: &rows.r[..m],
            j: &rows.j[..m * n],
        };
        let places: Vec<Option<usize>> = group_of.iter().map(|&g| place[g]).collect();
        sums.add_random(&weighed, &slots_of, &places);
    }
    sums.moments.iter_mut().for_each(Local::multiply);
    Some(sums)
}

/// One sample in block-whitened rows, row-major: its random effects U, and V⁻¹ applied to what is needed.
struct Weighed<'a> {
    /// U, m × k.
    u: &'a [f64],
    /// V⁻¹U, m × k.
    pu: &'a [f64],
    /// UᵀV⁻¹U, k × k.
    upu: &'a [f64],
    /// V⁻¹e, m.
    r: &'a [f64],
    /// V⁻¹J, m × n.
    j: &'a [f64],
}

impl Sums {
    /// The share of the random effects, `slots_of` those of each group and last those of none; `places`: the group of
    /// each row, where it is estimated. With V_u = u uᵀ:
    ///
    /// ```text
    /// (uᵀV⁻¹e)²,   uᵀV⁻¹u,   tr(V_u V⁻¹ V_w V⁻¹) = (uᵀV⁻¹w)²,   tr(V_u V⁻¹ E_g V⁻¹) = Σ_{i ∈ g} (V⁻¹u)_i²
    /// ```
    fn add_random(
        &mut self,
        sample: &Weighed<'_>,
        slots_of: &[Vec<usize>],
        places: &[Option<usize>],
    ) {
        let m = sample.r.len();
        if m == 0 {
            return;
        }
        let (n, k) = (sample.j.len() / m, sample.u.len() / m);
        let count = slots_of.len() - 1;
        for (g, slots) in slots_of.iter().enumerate() {
            for &a in slots {
                let mut along = 0.0;
                let row = self.moments[g].rows(1);
                row.fill(0.0);
                for i in 0..m {
                    let ua = sample.u[i * k + a];
                    if ua != 0.0 {
                        along += ua * sample.r[i];
                        row.iter_mut()
                            .zip(&sample.j[i * n..(i + 1) * n])
                            .for_each(|(x, j)| *x += ua * j);
                    }
                }
                if g == count {
                    continue;
                }
                self.squares[g] += along * along;
                self.traces[g] += sample.upu[a * k + a];
                for (h, others) in slots_of[..count].iter().enumerate() {
                    for &b in others {
                        self.products[(g, h)] += sample.upu[a * k + b] * sample.upu[a * k + b];
                    }
                }
                for (i, place) in places.iter().enumerate() {
                    if let Some(h) = *place {
                        let x = sample.pu[i * k + a] * sample.pu[i * k + a];
                        self.products[(g, h)] += x;
                        self.products[(h, g)] += x;
                    }
                }
            }
        }
    }
}

fn unit_matrix(m: usize) -> Vec<f64> {
    let mut unit = vec![0.0; m * m];
    unit.iter_mut().step_by(m + 1).for_each(|x| *x = 1.0);
    unit
}

/// Uᵀ V⁻¹ U per pair of columns, from U and V⁻¹U of k columns each.
fn inner_products(u: &[f64], pu: &[f64], k: usize) -> Vec<f64> {
    let mut upu = vec![0.0; k * k];
    for (u, pu) in u.chunks_exact(k.max(1)).zip(pu.chunks_exact(k.max(1))) {
        for (a, &ua) in u.iter().enumerate() {
            if ua != 0.0 {
                for (b, &pb) in pu.iter().enumerate() {
                    upu[a * k + b] += ua * pb;
                }
            }
        }
    }
    upu
}

/// One step of (2) and (3) at fixed values; `None` when the model cannot be evaluated.
pub(crate) fn score(
    model: &Model,
    values: &Values,
    weights: &[f64],
    theta: &[f64],
    work: &mut Workspace,
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
    let count = groups.len();
    let sums = sums(model, values, weights, theta, &groups, work)?;
    let c = covariance_of(&sums.normal_equations(model, values))?;
    // Everything above is 1/θ too large in every factor: exactly the chain rule to log θ.
    let moments = sums.moments[..count].iter();
    let taken = DVector::from_iterator(count, moments.map(|m| m.h.dot(&c)));
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
/// A = L⁻¹J,   w = L⁻¹e,   Q = A C Aᵀ   (V = LLᵀ)
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

#[cfg(test)]
mod tests;
