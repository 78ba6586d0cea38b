//! A solved problem linearized in every parameter that a model could free, and the fit of any subset of them.
//!
//! ```text
//! e_s(δ) = L (w + A δ),   δ_i = x₀ − x̂ for parameters that are not in the model                    (1)
//! δ_M = −C (g_M + H_MN δ_N + Λ(x̂ − x₀)),   C = (H_MM + Λ)⁻¹                                        (2)
//! ```
//!
//! x̂ are the values at which it is linearized, M the parameters of the model, N the others. No refit is needed to score a
//! subset, to leave a sample out of it, or to fit it to some of the samples.

use nalgebra::{Cholesky, DMatrix, DVector};
use rayon::prelude::*;

use crate::analysis::estimate::Trial;
use crate::analysis::select::sample::Sample;
use crate::analysis::select::stack::Stack;
use crate::analysis::select::sums::Sums;
use crate::analysis::successive::clustered;
use crate::model::layout::Model;
use crate::solve::equations::{NormalEquations, Objective, Workspace};
use crate::solve::whitened::{Whitened, covariance_of, whitened};

/// The linearized problem.
pub(super) struct Linear<'a> {
    model: &'a Model,
    /// Samples that are looked at one by one.
    pub samples: Vec<&'a Sample>,
    /// How many samples one of them stands for.
    pub factor: f64,
    /// Σ AᵀA.
    pub h: DMatrix<f64>,
    /// Σ Aᵀw.
    g: DVector<f64>,
    /// x̂ − x₀ per column.
    pub off: DVector<f64>,
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
    /// Where a fit ended, with these weights; `model`: the same with more free; `theta`: levels of D; one by one every `step`-th sample.
    pub(super) fn at(
        at: &Trial,
        weights: &[f64],
        model: Model,
        theta: &[f64],
        step: usize,
    ) -> Option<Self> {
        let n = model.free();
        let objective = Objective {
            model: &model,
            weights,
            theta: &at.theta,
        };
        let mut work = Workspace::new(&model);
        work.cache.update(&model.problem, &at.values);
        let all: Vec<usize> = (0..model.problem.samples).collect();
        let sums = |chunk: &[usize]| {
            let mut work = work.clone();
            let of = |&sample| Some((sample, whitened(objective, &at.values, sample, &mut work)?));
            let rows: Vec<(usize, Whitened)> = chunk.iter().filter_map(of).collect();
            let dense: Vec<DMatrix<f64>> = rows.iter().map(|(_, s)| s.a.dense()).collect();
            let each: Vec<_> = dense
                .iter()
                .zip(&rows)
                .map(|(a, (_, s))| (a, &s.w))
                .collect();
            let mut sums = Sums::of(n, &each);
            let rows = rows.into_iter().zip(dense);
            let looked_at = rows.filter(|((sample, _), _)| sample % step == 0);
            let own = looked_at.map(|((sample, s), a)| Sample::of(&model, sample, (s, a), theta));
            sums.samples = own.collect();
            sums
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
                .map(|&p| at.values.0[p] - model.problem.parameters[p].nominal),
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

    /// The same on the samples that are looked at one by one, without those of each fold in turn.
    pub(super) fn without_folds(
        &self,
        folds: usize,
        fold_of: impl Fn(usize) -> Option<usize> + Sync,
    ) -> Vec<Linear<'_>> {
        let n = self.off.len();
        let sums = |samples: &[&Sample]| {
            let mut total = Sums::new(n);
            for chunk in samples.chunks(CHUNK) {
                let each: Vec<_> = chunk.iter().map(|s| (&s.a, &s.w)).collect();
                total.join(Sums::of(n, &each));
            }
            total
        };
        let of = |wanted: &dyn Fn(usize) -> bool| -> Vec<&Sample> {
            let own = self.samples.iter().filter(|s| wanted(s.number));
            own.collect()
        };
        let own: Vec<Sums> = (0..folds)
            .into_par_iter()
            .map(|fold| sums(&of(&|s| fold_of(s) == Some(fold))))
            .collect();
        let rest = sums(&of(&|s| fold_of(s).is_none_or(|fold| fold >= folds)));
        let without = |left: usize| {
            let mut total = Sums::new(n);
            total.add(&rest);
            let others = own.iter().enumerate().filter(|(fold, _)| *fold != left);
            others.for_each(|(_, own)| total.add(own));
            Linear {
                model: &self.model,
                samples: of(&|s| fold_of(s) != Some(left)),
                factor: 1.0,
                h: total.h,
                g: total.g,
                off: self.off.clone(),
                rows: total.rows,
                squares: total.squares,
            }
        };
        (0..folds).map(without).collect()
    }

    /// Samples that are looked at one by one.
    pub(super) fn samples(&self) -> &[Sample] {
        &self.samples
    }

    pub(super) fn model(&self) -> &Model {
        &self.model
    }
}

/// A model fitted by equation (2).
pub(super) struct Fitted<'a> {
    pub linear: &'a Linear<'a>,
    /// M, sorted.
    pub active: Vec<usize>,
    /// C.
    pub c: DMatrix<f64>,
    /// δ of all columns.
    pub delta: DVector<f64>,
}

impl Linear<'_> {
    /// 1/σ² of a column's prior.
    pub(super) fn prior(&self, column: usize) -> f64 {
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

    /// `of` each sample, with what its rows say of it, and its place there.
    pub(super) fn of_each<T: Send>(&self, of: impl Fn(&Stack<'_>, usize) -> T + Sync) -> Vec<T> {
        let chunks = self.linear.samples.par_chunks(CHUNK);
        let each = chunks.flat_map_iter(|chunk| {
            let stack = Stack::new(&self.active, &self.c, chunk);
            (0..chunk.len()).map(|i| of(&stack, i)).collect::<Vec<T>>()
        });
        each.collect()
    }

    /// Whitened error of each sample predicted from the others; `None` where it cannot be.
    pub(super) fn predicted(&self) -> Vec<Option<DVector<f64>>> {
        self.of_each(|stack, i| Some(stack.left_out(i)? * self.residual(stack.samples[i])))
    }

    /// Losses of each sample predicted from the others, and for each block of the columns `beside`: losses of the model with it, and
    /// the matrix K of its shares.
    pub(super) fn extended(&self, beside: &Beside, blocks: &[Vec<usize>]) -> Extended {
        let steps: Vec<Option<Extension>> = blocks.iter().map(|b| beside.extension(b)).collect();
        let of_sample = |stack: &Stack<'_>, i: usize| {
            let s = stack.samples[i];
            let w = self.residual(s);
            let b = s.a.select_columns(&beside.columns) - stack.own(i) * &beside.taken;
            let g = stack.left_out(i);
            let base = g.as_ref().map(|g| s.loss(&(g * &w)));
            let each = blocks.iter().zip(&steps).map(|(block, step)| {
                let b = b.select_columns(block);
                let Some(step) = step else {
                    return (None, DVector::zeros(block.len()));
                };
                let share = b.tr_mul(&(&w + &b * &step.free));
                let loss = g.as_ref().and_then(|g| step.loss(s, g, &w, &b));
                (loss, share)
            });
            (base, each.collect::<Vec<_>>())
        };
        let per_sample = self.of_each(of_sample);
        let collect = |k: usize| {
            let shares = per_sample.iter().map(|(_, sample)| sample[k].1.clone());
            let clusters = clustered(&shares.collect::<Vec<_>>(), blocks[k].len());
            let clusters = clusters * self.linear.factor;
            (per_sample.iter().map(|s| s.1[k].0).collect(), clusters)
        };
        Extended {
            base: per_sample.iter().map(|s| s.0).collect(),
            with: (0..blocks.len()).map(collect).collect(),
        }
    }
}

/// Loss of each sample; `None` where it cannot be predicted from the others.
pub(super) type Losses = Vec<Option<f64>>;

/// What [`Fitted::extended`] gives.
pub(super) struct Extended {
    /// Of the model itself.
    pub base: Losses,
    /// Of the model with each block, and K.
    pub with: Vec<(Losses, DMatrix<f64>)>,
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
