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
use crate::solve::compressed::Local;
use crate::solve::minimize::{cholesky_in_place, solve_in_place};
use crate::solve::normal::{NormalEquations, Workspace, accumulate, add_prior};
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
        let mut p0 = vec![0.0; m * m];
        for i in 0..m {
            p0[i * m + i] = 1.0;
        }
        random.weigh(&mut p0, m);
        let u = rows.g[..m * k].to_vec();
        let mut pu = u.clone();
        random.weigh(&mut pu, k);
        random.weigh(&mut rows.r[..m], 1);
        random.weigh(&mut rows.j[..m * n], n);
        // Uᵀ V⁻¹ U, per pair of columns
        let mut upu = vec![0.0; k * k];
        for i in 0..m {
            for a in 0..k {
                let ua = u[i * k + a];
                if ua != 0.0 {
                    for b in 0..k {
                        upu[a * k + b] += ua * pu[i * k + b];
                    }
                }
            }
        }
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
        for (g, slots) in slots_of.iter().enumerate() {
            for &a in slots {
                let mut along = 0.0;
                let row = sums.moments[g].rows(1);
                row.fill(0.0);
                for i in 0..m {
                    let ua = u[i * k + a];
                    if ua != 0.0 {
                        along += ua * rows.r[i];
                        row.iter_mut()
                            .zip(&rows.j[i * n..(i + 1) * n])
                            .for_each(|(x, j)| *x += ua * j);
                    }
                }
                if g == count {
                    continue;
                }
                sums.squares[g] += along * along;
                sums.traces[g] += upu[a * k + a];
                for (h, others) in slots_of[..count].iter().enumerate() {
                    for &b in others {
                        sums.products[(g, h)] += upu[a * k + b] * upu[a * k + b];
                    }
                }
                for i in 0..m {
                    if let Some(h) = place[group_of[i]] {
                        let x = pu[i * k + a] * pu[i * k + a];
                        sums.products[(g, h)] += x;
                        sums.products[(h, g)] += x;
                    }
                }
            }
        }
    }
    sums.moments.iter_mut().for_each(Local::multiply);
    Some(sums)
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
mod tests {
    use super::*;
    use crate::*;
    use nalgebra::{Isometry3, Point3, Vector3};

    /// Markers and a body pose behind two noisy joints; everything that can be wrong in a sum is different here.
    fn problem() -> Problem {
        let n = 14;
        let q = |a: f64| (0..n).map(|i| (f64::from(i) * a).sin()).collect::<Vec<_>>();
        let mut p = Problem::new(n as usize);
        let base = p.frame("base");
        let a = p.frame("a");
        let b = p.frame("b");
        let c = p.frame("c");
        let d = p.frame("d");
        let x = Isometry3::new(Vector3::new(0.3, 0.1, 0.2), Vector3::new(0.2, -0.4, 0.5));
        p.unknown("first", base, a, x, Chart::full());
        let turn = p.joint("turn", a, b, Axis::Revolute(Vector3::z_axis()), q(0.9));
        p.known("elbow", b, c, x);
        let tilt = p.joint("tilt", c, d, Axis::Revolute(Vector3::x_axis()), q(0.53));
        p.free_effect(turn, EffectKind::ZeroOffset, Some(0.1));
        let joint = p.noise_group("joint", NoiseKind::Joint, 4e-3, true);
        p.joint_noise(turn, joint);
        p.joint_noise(tilt, joint);
        let marker = p.noise_group("marker", NoiseKind::Position, 2e-3, true);
        let orientation = p.noise_group("orientation", NoiseKind::Orientation, 3e-3, true);
        let position = p.noise_group("position", NoiseKind::Position, 1e-3, false);
        let points = [
            p.known_point("k", d, Point3::new(0.3, 0.1, 0.0)),
            p.unknown_point("u", d, Point3::new(0.1, -0.2, 0.3), None),
        ];
        let seen = (0..2 * n as usize)
            .map(|i| MarkerObservation {
                sample: i / 2,
                point: points[i % 2],
                position: Point3::new((i as f64).sin(), (i as f64 * 1.7).cos(), 0.1),
                shape: None,
            })
            .collect();
        p.markers("hand", base, d, marker, seen);
        let noise = PoseNoise::Split {
            orientation,
            position,
        };
        let poses = (0..n as usize)
            .map(|sample| PoseObservation { sample, pose: x })
            .collect();
        p.poses("arm", base, b, noise, poses);
        p
    }

    /// A model at its start, with the noise that was stated; every observation of its own weight.
    struct Case {
        model: Model,
        values: Values,
        weights: Vec<f64>,
        theta: Vec<f64>,
        work: Workspace,
    }

    impl Case {
        fn new(weight: impl Fn(usize) -> f64) -> Self {
            let model = Model::new(&problem()).unwrap();
            let sigmas = model.problem.groups.iter().map(|g| g.sigma);
            Self {
                values: model.start(),
                weights: (0..model.observation_count()).map(weight).collect(),
                theta: sigmas.map(|s| s.powi(2)).collect(),
                work: Workspace::new(&model),
                model,
            }
        }

        fn system(&mut self) -> NormalEquations {
            let mut system = NormalEquations::new(self.model.free());
            let (model, values, work) = (&self.model, &self.values, &mut self.work);
            assert!(accumulate(
                model,
                values,
                &self.weights,
                &self.theta,
                work,
                &mut system
            ));
            system
        }

        /// Every sample in dense factors, at other variances than the stated ones.
        fn dense(&mut self, theta: &[f64]) -> Vec<Whitened> {
            let (model, values, work) = (&self.model, &self.values, &mut self.work);
            work.cache.update(&model.problem, values);
            (0..model.problem.samples)
                .map(|s| whitened(model, values, &self.weights, theta, s, work).unwrap())
                .collect()
        }

        /// Variances of which one is `factor` times what was stated.
        fn scaled(&self, group: usize, factor: f64) -> Vec<f64> {
            let mut theta = self.theta.clone();
            theta[group] *= factor;
            theta
        }

        /// Diagonal of the prior's information.
        fn prior(&self, column: usize) -> f64 {
            let sigma = self.model.problem.parameters[self.model.columns[column]].prior_sigma;
            sigma.map_or(0.0, |s| 1.0 / (s * s))
        }

        /// −½ [ Σ log det V + log det H + Σ eᵀV⁻¹e ] by dense factors: what (2) is the gradient of at fixed values.
        fn likelihood(&mut self, theta: &[f64]) -> f64 {
            let n = self.model.free();
            let mut h = DMatrix::from_fn(n, n, |i, j| if i == j { self.prior(i) } else { 0.0 });
            let mut sum = 0.0;
            for s in self.dense(theta) {
                h += s.a.tr_mul(&s.a);
                sum += s.log_det + s.w.norm_squared();
            }
            let cholesky = nalgebra::Cholesky::new(h).unwrap();
            -0.5 * (sum + 2.0 * cholesky.l().diagonal().map(f64::ln).sum())
        }
    }

    /// Groups of [`problem`] that are estimated: joint, marker, orientation.
    const GROUPS: [usize; 3] = [0, 1, 2];

    fn unequal_weights(observation: usize) -> f64 {
        [1.0, 0.3, 2.0][observation % 3]
    }

    fn sums_of(case: &mut Case) -> Sums {
        let (model, values) = (&case.model, &case.values);
        sums(
            model,
            values,
            &case.weights,
            &case.theta,
            &GROUPS,
            &mut case.work,
        )
        .unwrap()
    }

    #[test]
    fn the_score_is_the_gradient_of_the_restricted_likelihood() {
        let mut case = Case::new(unequal_weights);
        let system = case.system();
        let c = covariance_of(&system).unwrap();
        let sums = sums_of(&mut case);
        // Position noise is stated here: it goes into the rest, and the sum is still all of H.
        let own = sums.normal_equations(&case.model, &case.values);
        let scale = system.h.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        for (a, b) in own.h.iter().zip(&system.h) {
            assert!((a - b).abs() < 1e-10 * scale);
        }
        for (i, &g) in GROUPS.iter().enumerate() {
            let taken = sums.moments[i].h.dot(&c);
            let score = 0.5 * (sums.squares[i] - sums.traces[i] + taken);
            const STEP: f64 = 1e-4;
            let mut at = |step: f64| {
                let theta = case.scaled(g, step.exp());
                case.likelihood(&theta)
            };
            let slope = (at(STEP) - at(-STEP)) / (2.0 * STEP);
            assert!(
                (score - slope).abs() < 1e-5 * slope.abs().max(1.0),
                "{g}: {score} {slope}"
            );
        }
    }

    /// The sums of (3) against dense factors: tr(V_g V⁻¹) and tr(V_g V⁻¹ V_h V⁻¹), in log θ.
    #[test]
    fn the_expected_information_is_that_of_dense_factors() {
        let mut case = Case::new(unequal_weights);
        let sums = sums_of(&mut case);
        let at = case.dense(&case.theta.clone());
        // B_g = L⁻¹ (∂V/∂log θ_g) L⁻ᵀ; V is linear in θ, so the difference to twice θ_g is the derivative.
        let changes: Vec<Vec<DMatrix<f64>>> = GROUPS
            .iter()
            .map(|&g| {
                let twice = case.dense(&case.scaled(g, 2.0));
                let of_sample = |(s, twice): (&Whitened, &Whitened)| {
                    let change = &twice.l * twice.l.transpose() - &s.l * s.l.transpose();
                    &s.l_inverse * change * s.l_inverse.transpose()
                };
                at.iter().zip(&twice).map(of_sample).collect()
            })
            .collect();
        for g in 0..GROUPS.len() {
            let trace: f64 = changes[g].iter().map(DMatrix::trace).sum();
            assert!((sums.traces[g] - trace).abs() < 1e-9 * trace, "{g}");
            for h in 0..GROUPS.len() {
                // tr(B_g B_h) of symmetric matrices
                let pairs = changes[g].iter().zip(&changes[h]);
                let dense: f64 = pairs.map(|(a, b)| a.dot(b)).sum();
                let found = sums.products[(g, h)];
                assert!(
                    dense > 0.0,
                    "groups {g} and {h} share no row: nothing is tested"
                );
                assert!(
                    (found - dense).abs() < 1e-9 * dense,
                    "{g} {h}: {found} {dense}"
                );
            }
        }
    }

    #[test]
    fn dense_and_structured_whitening_give_the_same_normal_equations() {
        let mut case = Case::new(|_| 0.7);
        let system = case.system();
        let n = case.model.free();
        let (mut h, mut g, mut cost) = (DMatrix::zeros(n, n), DVector::zeros(n), 0.0);
        for s in case.dense(&case.theta.clone()) {
            h += s.a.tr_mul(&s.a);
            g += s.a.tr_mul(&s.w);
            cost += s.w.norm_squared();
        }
        let scale = h.amax();
        for a in 0..n {
            for b in a..n {
                let prior = if a == b { case.prior(a) } else { 0.0 };
                assert!((system.h[a * n + b] - prior - h[(a, b)]).abs() < 1e-11 * scale);
            }
            assert!((system.g[a] - g[a]).abs() < 1e-10 * g.amax());
        }
        assert!((system.data - cost).abs() < 1e-11 * cost);
        // A step is judged by the V that proposed it.
        let (model, values, work) = (&case.model, &case.values, &mut case.work);
        let again = crate::solve::normal::cost(model, values, &case.weights, &case.theta, work);
        assert!((again - system.cost()).abs() < 1e-11 * cost);
    }
}
