//! A solved problem linearized in every parameter that a model could free, and the fit of any subset of them.
//!
//! ```text
//! e_s(δ) = L (w + A δ),   δ_i = x₀ − x̂ for parameters that are not in the model                    (1)
//! δ_M = −C (g_M + H_MN δ_N + Λ(x̂ − x₀)),   C = (H_MM + Λ)⁻¹                                        (2)
//! ```
//!
//! x̂ are the values at which it is linearized, M the parameters of the model, N the others. No refit is needed to score a
//! subset, to leave a sample out of it, or to fit it to some of the samples.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use rayon::prelude::*;

use crate::analysis::solution::Solution;
use crate::model::layout::Model;
use crate::solve::equations::{NormalEquations, Objective, Workspace};
use crate::solve::rows::add_block;
use crate::solve::whitened::{Whitened, covariance_of, whitened};

/// One sample, whitened by its V = LLᵀ.
pub(super) struct Sample {
    pub number: usize,
    /// Rows of all parameters that a model could free.
    pub a: DMatrix<f64>,
    pub w: DVector<f64>,
    /// L.
    pub l: DMatrix<f64>,
    /// D^(-½) L, D the covariance of the measurements alone: what makes errors of different models comparable.
    pub weighted: DMatrix<f64>,
    /// (observation, first row, rows)
    pub blocks: Vec<(usize, usize, usize)>,
}

/// The linearized problem.
pub(super) struct Linear<'a> {
    model: &'a Model,
    /// Samples that are looked at one by one.
    pub samples: Vec<&'a Sample>,
    /// How many samples one of them stands for.
    pub factor: f64,
    /// Σ AᵀA.
    h: DMatrix<f64>,
    /// Σ Aᵀw.
    g: DVector<f64>,
    /// x̂ − x₀ per column.
    off: DVector<f64>,
    rows: f64,
    squares: f64,
}

/// What [`Linear`] is made of.
pub(super) struct Linearization {
    model: Model,
    samples: Vec<Sample>,
    factor: f64,
    h: DMatrix<f64>,
    g: DVector<f64>,
    off: DVector<f64>,
    rows: f64,
    squares: f64,
}

/// Samples that are summed by one task.
const CHUNK: usize = 32;

impl Linearization {
    /// At a solution, with these weights; `model`: the same with more free; `theta`: levels of D; one by one every `step`-th sample.
    pub(super) fn at(
        solution: &Solution,
        weights: &[f64],
        model: Model,
        theta: &[f64],
        step: usize,
    ) -> Option<Self> {
        let n = model.free();
        let objective = Objective {
            model: &model,
            weights,
            theta: &solution.theta,
        };
        let mut work = Workspace::new(&model);
        work.cache.update(&model.problem, &solution.values);
        let all: Vec<usize> = (0..model.problem.samples).collect();
        let sums = |chunk: &[usize]| {
            let mut work = work.clone();
            let mut sum = Sums::new(n);
            for &sample in chunk {
                if let Some(s) = whitened(objective, &solution.values, sample, &mut work) {
                    sum.add(&s);
                    if sample % step == 0 {
                        sum.samples.push(Sample::of(&model, sample, s, theta));
                    }
                }
            }
            sum
        };
        let parts: Vec<Sums> = all.par_chunks(CHUNK).map(sums).collect();
        let mut total = Sums::new(n);
        for part in parts {
            total.join(part);
        }
        let off = DVector::from_iterator(
            n,
            model
                .columns
                .iter()
                .map(|&p| solution.values.0[p] - model.problem.parameters[p].nominal),
        );
        (!total.samples.is_empty()).then(|| Self {
            factor: total.count as f64 / total.samples.len() as f64,
            samples: total.samples,
            h: total.h,
            g: total.g,
            off,
            rows: total.rows,
            squares: total.squares,
            model,
        })
    }

    /// Columns of parameters of the problem.
    pub(super) fn columns(&self, parameters: impl Iterator<Item = usize>) -> Vec<usize> {
        let mut columns: Vec<usize> = parameters.filter_map(|p| self.model.column_of[p]).collect();
        columns.sort_unstable();
        columns.dedup();
        columns
    }

    pub(super) fn all(&self) -> Linear<'_> {
        Linear {
            model: &self.model,
            samples: self.samples.iter().collect(),
            factor: self.factor,
            h: self.h.clone(),
            g: self.g.clone(),
            off: self.off.clone(),
            rows: self.rows,
            squares: self.squares,
        }
    }

    /// The same on some of the samples that are looked at one by one.
    pub(super) fn of_samples(&self, wanted: impl Fn(usize) -> bool) -> Linear<'_> {
        let n = self.off.len();
        let samples: Vec<&Sample> = self.samples.iter().filter(|s| wanted(s.number)).collect();
        let mut h = DMatrix::zeros(n, n);
        let mut g = DVector::zeros(n);
        let (mut rows, mut squares) = (0.0, 0.0);
        for s in &samples {
            h.gemm_tr(1.0, &s.a, &s.a, 1.0);
            g.gemv_tr(1.0, &s.a, &s.w, 1.0);
            rows += s.w.len() as f64;
            squares += s.w.norm_squared();
        }
        Linear {
            model: &self.model,
            samples,
            factor: 1.0,
            h,
            g,
            off: self.off.clone(),
            rows,
            squares,
        }
    }

    /// Samples that are looked at one by one.
    pub(super) fn samples(&self) -> &[Sample] {
        &self.samples
    }

    pub(super) fn model(&self) -> &Model {
        &self.model
    }
}

impl Sample {
    fn of(model: &Model, number: usize, s: Whitened, theta: &[f64]) -> Self {
        let m = s.w.len();
        let mut weighted = DMatrix::zeros(m, m);
        for &(o, first, rows) in &s.blocks {
            let own = s.l.view((first, 0), (rows, m)).into_owned();
            let half = half_of(model, o, rows, theta, &own);
            if let Some(e) = half.solve_lower_triangular(&own) {
                weighted.view_mut((first, 0), (rows, m)).copy_from(&e);
            }
        }
        Self {
            number,
            a: s.a,
            w: s.w,
            l: s.l,
            weighted,
            blocks: s.blocks,
        }
    }

    /// εᵀLᵀD⁻¹Lε per row.
    pub(super) fn loss(&self, whitened: &DVector<f64>) -> f64 {
        (&self.weighted * whitened).norm_squared() / whitened.len() as f64
    }
}

/// R of D = RRᵀ of one observation; where it has no noise of its own, of what the rest gives it.
fn half_of(model: &Model, o: usize, rows: usize, theta: &[f64], l: &DMatrix<f64>) -> DMatrix<f64> {
    let d = measured_covariance(model, o, rows, theta);
    let factor = Cholesky::new(d).or_else(|| Cholesky::new(l * l.transpose()));
    factor.map_or_else(|| DMatrix::identity(rows, rows), |c| c.l())
}

/// D of one observation.
pub(super) fn measured_covariance(
    model: &Model,
    observation: usize,
    rows: usize,
    theta: &[f64],
) -> DMatrix<f64> {
    let mut d = DMatrix::zeros(rows, rows);
    add_block(model, observation, |i, j, group, shape| {
        d[(i, j)] += theta[group] * shape;
        if i != j {
            d[(j, i)] += theta[group] * shape;
        }
    });
    d
}

/// Sums over samples.
struct Sums {
    h: DMatrix<f64>,
    g: DVector<f64>,
    rows: f64,
    squares: f64,
    count: usize,
    samples: Vec<Sample>,
}

impl Sums {
    fn new(n: usize) -> Self {
        Self {
            h: DMatrix::zeros(n, n),
            g: DVector::zeros(n),
            rows: 0.0,
            squares: 0.0,
            count: 0,
            samples: Vec::new(),
        }
    }

    fn add(&mut self, s: &Whitened) {
        self.h.gemm_tr(1.0, &s.a, &s.a, 1.0);
        self.g.gemv_tr(1.0, &s.a, &s.w, 1.0);
        self.rows += s.w.len() as f64;
        self.squares += s.w.norm_squared();
        self.count += 1;
    }

    fn join(&mut self, other: Self) {
        self.h += other.h;
        self.g += other.g;
        self.rows += other.rows;
        self.squares += other.squares;
        self.count += other.count;
        self.samples.extend(other.samples);
    }
}

/// A model fitted by equation (2).
pub(super) struct Fitted<'a> {
    linear: &'a Linear<'a>,
    /// M, sorted.
    active: Vec<usize>,
    /// C.
    c: DMatrix<f64>,
    /// δ of all columns.
    pub delta: DVector<f64>,
}

impl Linear<'_> {
    /// 1/σ² of a column's prior.
    fn prior(&self, column: usize) -> f64 {
        let parameter = &self.model.problem.parameters[self.model.columns[column]];
        parameter.prior_sigma.map_or(0.0, |sigma| sigma.powi(-2))
    }

    /// Whether a physical limit allows a parameter to differ from its nominal value by this much.
    pub(super) fn allows(&self, column: usize, change: f64) -> bool {
        let parameter = &self.model.problem.parameters[self.model.columns[column]];
        let value = parameter.nominal + change;
        let inside = |(low, high): (f64, f64)| value > low && value < high;
        parameter.bounds.is_none_or(inside)
    }

    /// The model with these columns. `None` where it cannot be evaluated.
    pub(super) fn fit(&self, active: Vec<usize>) -> Option<Fitted<'_>> {
        let k = active.len();
        let mut delta = -self.off.clone();
        for &c in &active {
            delta[c] = 0.0;
        }
        let gradient = &self.g + &self.h * &delta;
        let mut system = NormalEquations::new(k);
        for (i, &a) in active.iter().enumerate() {
            for (j, &b) in active.iter().enumerate().skip(i) {
                system.h[i * k + j] = self.h[(a, b)];
            }
            system.h[i * k + i] += self.prior(a);
            system.g[i] = gradient[a] + self.prior(a) * self.off[a];
        }
        let c = covariance_of(&system)?;
        let step = -(&c * DVector::from_column_slice(&system.g));
        for (i, &a) in active.iter().enumerate() {
            delta[a] = step[i];
        }
        delta.iter().all(|d| d.is_finite()).then_some(Fitted {
            linear: self,
            active,
            c,
            delta,
        })
    }
}

/// Columns that a model does not have, given those that it has.
pub(super) struct Beside {
    /// Sorted columns.
    pub columns: Vec<usize>,
    /// C H_MB.
    taken: DMatrix<f64>,
    /// U.
    pub u: DVector<f64>,
    /// I = H_BB − H_BM C H_MB.
    pub information: DMatrix<f64>,
    /// Diagonal of H_BB.
    pub raw: Vec<f64>,
    /// 1/σ² of their priors.
    pub prior: Vec<f64>,
}

impl Fitted<'_> {
    /// Σ wᵀw per degree of freedom, at least 1.
    pub(super) fn excess(&self) -> f64 {
        let linear = self.linear;
        let h_delta = &linear.h * &self.delta;
        let chi2 = linear.squares + 2.0 * linear.g.dot(&self.delta) + self.delta.dot(&h_delta);
        let freedom = (linear.rows - self.active.len() as f64).max(1.0);
        (chi2 / freedom).max(1.0)
    }

    pub(super) fn beside(&self, columns: Vec<usize>) -> Beside {
        let h = &self.linear.h;
        let pick = |rows: &[usize], columns: &[usize]| {
            DMatrix::from_fn(rows.len(), columns.len(), |i, j| h[(rows[i], columns[j])])
        };
        let shared = pick(&self.active, &columns);
        let taken = &self.c * &shared;
        let information = pick(&columns, &columns) - shared.tr_mul(&taken);
        let gradient = &self.linear.g + h * &self.delta;
        Beside {
            u: DVector::from_iterator(columns.len(), columns.iter().map(|&c| gradient[c])),
            raw: columns.iter().map(|&c| h[(c, c)]).collect(),
            prior: columns.iter().map(|&c| self.linear.prior(c)).collect(),
            information,
            taken,
            columns,
        }
    }

    /// w of the fitted model.
    pub(super) fn residual(&self, s: &Sample) -> DVector<f64> {
        &s.w + &s.a * &self.delta
    }

    /// A_M of a sample.
    fn own(&self, s: &Sample) -> DMatrix<f64> {
        s.a.select_columns(&self.active)
    }

    /// (I − Q)⁻¹, Q = A_M C A_Mᵀ; `None` where the sample alone determines something.
    fn left_out(&self, own: &DMatrix<f64>) -> Option<DMatrix<f64>> {
        let m = own.nrows();
        let q = own * &self.c * own.transpose();
        // A direction of leverage 1 has no Cholesky factor, or a pivot of rounding.
        const LEVERAGE_LEFT: f64 = 1e-9;
        let factor = Cholesky::<f64, Dyn>::new(DMatrix::identity(m, m) - q)?;
        let least = factor.l_dirty().diagonal().min();
        (least * least > LEVERAGE_LEFT).then(|| factor.inverse())
    }

    /// Whitened error of a sample predicted from the others; `None` where it cannot be.
    pub(super) fn predicted(&self, s: &Sample) -> Option<DVector<f64>> {
        Some(self.left_out(&self.own(s))? * self.residual(s))
    }

    /// Losses of each sample predicted from the others.
    pub(super) fn losses(&self) -> Vec<Option<f64>> {
        let loss = |s: &&Sample| Some(s.loss(&self.predicted(s)?));
        self.linear.samples.par_iter().map(loss).collect()
    }

    /// For each block of the columns `beside`: losses of the model with it, and the matrix K of its shares.
    pub(super) fn extended(
        &self,
        beside: &Beside,
        blocks: &[Vec<usize>],
    ) -> Vec<(Vec<Option<f64>>, DMatrix<f64>)> {
        let steps: Vec<Option<Extension>> = blocks.iter().map(|b| beside.extension(b)).collect();
        let of_sample = |s: &&Sample| -> Vec<(Option<f64>, DVector<f64>)> {
            let own = self.own(s);
            let w = self.residual(s);
            let b = s.a.select_columns(&beside.columns) - &own * &beside.taken;
            let g = self.left_out(&own);
            let each = blocks.iter().zip(&steps);
            each.map(|(block, step)| {
                let b = b.select_columns(block);
                let Some(step) = step else {
                    return (None, DVector::zeros(block.len()));
                };
                let share = b.tr_mul(&(&w + &b * &step.free));
                let loss = g.as_ref().and_then(|g| step.loss(s, g, &w, &b));
                (loss, share)
            })
            .collect()
        };
        let per_sample: Vec<_> = self.linear.samples.par_iter().map(of_sample).collect();
        let collect = |k: usize| {
            let size = blocks[k].len();
            let mut clusters = DMatrix::zeros(size, size);
            for sample in &per_sample {
                clusters.ger(self.linear.factor, &sample[k].1, &sample[k].1, 1.0);
            }
            (per_sample.iter().map(|s| s[k].0).collect(), clusters)
        };
        (0..blocks.len()).map(collect).collect()
    }
}

/// What a block adds to a model.
struct Extension {
    /// Coefficients without their prior: −I⁺U.
    free: DVector<f64>,
    /// Coefficients with it.
    held: DVector<f64>,
    /// I + Λ.
    precision: DMatrix<f64>,
}

impl Beside {
    /// Part of it, by places in `columns`.
    pub(super) fn part(&self, block: &[usize]) -> (DVector<f64>, DMatrix<f64>, Vec<f64>) {
        let u = DVector::from_iterator(block.len(), block.iter().map(|&i| self.u[i]));
        let information = DMatrix::from_fn(block.len(), block.len(), |i, j| {
            self.information[(block[i], block[j])]
        });
        let raw = block.iter().map(|&i| self.raw[i]).collect();
        (u, information, raw)
    }

    fn extension(&self, block: &[usize]) -> Option<Extension> {
        /// In units of a column's own information: far below what can be tested.
        const RIDGE: f64 = 1e-9;
        let (u, information, raw) = self.part(block);
        let mut with_ridge = information.clone();
        let mut precision = information;
        for (i, &place) in block.iter().enumerate() {
            let ridge = RIDGE * raw[i].max(f64::MIN_POSITIVE);
            with_ridge[(i, i)] += ridge;
            precision[(i, i)] += ridge + self.prior[place];
        }
        let free = -Cholesky::new(with_ridge)?.solve(&u);
        let held = -Cholesky::new(precision.clone())?.solve(&u);
        Some(Extension {
            free,
            held,
            precision,
        })
    }
}

impl Extension {
    /// Loss of a sample predicted from the others with the block in the model, by Woodbury's formula:
    ///
    /// ```text
    /// (I − Q − B P⁻¹ Bᵀ)⁻¹ = G + G B (P − BᵀGB)⁻¹ BᵀG,   G = (I − Q)⁻¹,   P = I_B + Λ
    /// ```
    fn loss(
        &self,
        s: &Sample,
        g: &DMatrix<f64>,
        w: &DVector<f64>,
        b: &DMatrix<f64>,
    ) -> Option<f64> {
        let w = w + b * &self.held;
        let gb = g * b;
        let inner = Cholesky::new(&self.precision - b.tr_mul(&gb))?;
        let error = g * &w + &gb * inner.solve(&gb.tr_mul(&w));
        let loss = s.loss(&error);
        loss.is_finite().then_some(loss)
    }
}
