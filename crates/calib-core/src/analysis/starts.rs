//! From which side did a joint come before it moved for the first time in a recording?
//!
//! Backlash adds `−b a` to a joint, `a` the direction that it moved in last. Before its first motion `a` is one unknown sign for
//! the whole block of samples, not 0: a block in the middle of the backlash looks like a zero that steps by `b` at the first motion.
//!
//! ```text
//! e(δ, s) = w + A δ + Σ_r s_r D_r (x̂ + δ)       D_r = ∂²e/∂x∂s_r: the start's share of the effects' columns     (1)
//! F(s) = min over δ of |e|² + prior,   x ≥ 0 where physics asks for it                                  (2)
//! G(s) = Σ_samples min(|w + Σ_r s_r D_r x̂|², c m)                 held-out samples, c m: gross outliers     (3)
//! ```
//!
//! Signs are changed one at a time from those of the free amplitudes until none lowers F (or G). A sign is told where both the other
//! one and the middle cost more by [`CLEAR`] at the noise as found. Then next to nothing of χ² is owed to the choice.

use nalgebra::{DMatrix, DVector};

use crate::analysis::goodness::Candidate;
use crate::analysis::solution::Solution;
use crate::graph::edge::EdgeKind;
use crate::graph::parameter::ParameterKind;
use crate::graph::problem::{OpenStart, StartChange};
use crate::solve::equations::{NormalEquations, Objective, Workspace};
use crate::solve::normal::add_prior;
use crate::solve::whitened::{covariance_of, whitened};

/// Twice the log-likelihood ratio from which a direction is told: 90 to 1.
const CLEAR: f64 = 9.0;
/// Standard deviations from 0 from which an effect is there.
const CERTAIN: f64 = 4.0;
/// c of equation (3): a sample of noise alone exceeds it once in 10⁵ or less.
const GROSS: f64 = 9.0;
/// A sample that lies farther off than twice what all sides together make of it is a gross error, whatever the sides were.
const REACH: f64 = 2.0;
/// Rounds of changing signs one at a time.
const ROUNDS: usize = 4;

/// What the residuals tell of an [`OpenStart`].
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct StartDirection {
    /// Number of the start in [`Problem::open_starts`](crate::Problem::open_starts).
    pub start: usize,
    /// +1: the joint came from below; −1: from above.
    pub direction: f64,
    /// By how much the next best costs more, in χ² at the noise as found.
    pub advantage: f64,
}

/// One start's share of one effect's column.
struct Piece {
    /// Number of the start.
    start: usize,
    /// Column of the effect's coefficient among the free parameters.
    column: usize,
    /// The coefficient is not negative.
    nonnegative: bool,
    candidate: Candidate,
}

impl Solution {
    /// The starts whose direction the residuals tell: of fitted samples with all parameters free to follow, of held-out samples with
    /// the parameters as they are. Starts without a free effect that depends on the direction are left out.
    #[must_use]
    pub fn start_directions(&self) -> Vec<StartDirection> {
        let starts = self.model.problem.open_starts().iter().enumerate();
        let held_out = |start: &OpenStart| start.samples.iter().all(|s| self.model.is_held_out(*s));
        let (later, fitted): (Vec<_>, Vec<_>) = starts.partition(|(_, start)| held_out(start));
        let excess = (self.chi2 / self.degrees_of_freedom.max(1.0)).max(1.0);
        let pieces = |of: Vec<(usize, &OpenStart)>| -> Vec<Piece> {
            of.into_iter()
                .flat_map(|(r, start)| self.pieces(r, start))
                .collect()
        };
        let mut found = Vec::new();
        let (own, mut later) = (pieces(fitted), pieces(later));
        // With an effect that is hardly there, its side would be one more number to fit the held-out rows with.
        later.retain(|piece| self.is_certain(piece.column));
        // A robust fit that takes the middle rejects the rows of a large backlash: they tell the side.
        let all = self.with_rows_of(&own);
        if !own.is_empty()
            && let Some(free) = Free::new(&all, &own)
        {
            let first = free.amplitudes(&own);
            found.extend(told(&own, first, excess, |signs| free.cost(&own, signs)));
        }
        if !later.is_empty() {
            let held = Held::new(self, &later, excess);
            let first = held.amplitudes(&later);
            found.extend(told(&later, first, excess, |signs| {
                held.cost(&later, signs)
            }));
        }
        found.sort_by_key(|d| d.start);
        found
    }

    fn is_certain(&self, column: usize) -> bool {
        let found = &self.parameters[self.model.columns[column]];
        found
            .sigma
            .is_some_and(|sigma| found.value.abs() > CERTAIN * sigma)
    }

    /// The same solution with all observations of the fitted samples that the starts are about and that sides can explain.
    fn with_rows_of(&self, pieces: &[Piece]) -> Self {
        let mut all = self.clone();
        let mut wanted: Vec<usize> = pieces.iter().flat_map(Piece::samples).collect();
        wanted.retain(|sample| !self.model.is_held_out(*sample));
        wanted.sort_unstable();
        wanted.dedup();
        for &sample in &wanted {
            all.weights[self.model.of_sample[sample].clone()].fill(1.0);
        }
        let candidates: Vec<Candidate> = pieces.iter().map(|p| p.candidate.clone()).collect();
        let value = |p: &Piece| self.values.0[self.model.columns[p.column]];
        let values: Vec<f64> = pieces.iter().map(value).collect();
        let excess = (self.chi2 / self.degrees_of_freedom.max(1.0)).max(1.0);
        let mut out = all.clone();
        for seen in all.seen(&candidates, &wanted) {
            let (s, d) = (&seen.rows, &seen.columns);
            let sides: f64 = (0..values.len())
                .map(|k| d.column(k).norm() * values[k].abs())
                .sum();
            let noise = (GROSS * excess * s.w.len() as f64).sqrt();
            if s.w.norm() > REACH * sides + noise {
                let own = self.model.of_sample[seen.sample].clone();
                out.weights[own.clone()].copy_from_slice(&self.weights[own]);
            }
        }
        out
    }

    fn pieces(&self, number: usize, start: &OpenStart) -> Vec<Piece> {
        let model = &self.model;
        let EdgeKind::Joint(joint) = &model.problem.edges[start.joint.index()].kind else {
            return Vec::new();
        };
        let of_change = |change: &StartChange| {
            let effect = joint.effects.iter().find(|f| f.kind == change.kind)?;
            let column = model.column_of[effect.parameter.index()]?;
            let mut values = vec![0.0; model.problem.samples];
            for (sample, by) in start.samples.iter().zip(&change.by) {
                values[*sample] = *by;
            }
            let kind = model.problem.parameters[effect.parameter.index()].kind;
            Some(Piece {
                start: number,
                column,
                nonnegative: matches!(kind, ParameterKind::Effect(k) if k.effect().nonnegative),
                candidate: Candidate::of_joint(start.joint, change.kind, values),
            })
        };
        start.changes.iter().filter_map(of_change).collect()
    }
}

/// The directions that are told, by the cost of signs.
fn told(
    pieces: &[Piece],
    first: Vec<f64>,
    excess: f64,
    cost: impl Fn(&[f64]) -> f64,
) -> Vec<StartDirection> {
    let mut signs = first;
    let mut starts: Vec<usize> = pieces.iter().map(|p| p.start).collect();
    starts.dedup();
    let with = |signs: &[f64], start: usize, sign: f64| {
        let mut signs = signs.to_vec();
        signs[start] = sign;
        cost(&signs)
    };
    for _ in 0..ROUNDS {
        let mut changed = false;
        for &start in &starts {
            let other = -signs[start];
            if with(&signs, start, other) < cost(&signs) {
                signs[start] = other;
                changed = true;
            }
        }
        if !changed {
            break;
        }
    }
    let best = cost(&signs);
    let of = |&start: &usize| {
        let other = with(&signs, start, -signs[start]).min(with(&signs, start, 0.0));
        let advantage = (other - best) / excess;
        (advantage > CLEAR).then(|| StartDirection {
            start,
            direction: signs[start],
            advantage,
        })
    };
    starts.iter().filter_map(of).collect()
}

/// Signs by start, from amplitudes by piece.
fn signs(pieces: &[Piece], amplitude: impl Fn(usize) -> f64) -> Vec<f64> {
    let count = pieces.iter().map(|p| p.start + 1).max().unwrap_or(0);
    let mut sums = vec![0.0; count];
    for (k, piece) in pieces.iter().enumerate() {
        sums[piece.start] += amplitude(k);
    }
    sums.iter()
        .map(|s| if *s < 0.0 { -1.0 } else { 1.0 })
        .collect()
}

/// Equation (2): sums over the fitted samples.
struct Free {
    /// AᵀA and Aᵀw with the priors, x̂ by column.
    system: NormalEquations,
    /// AᵀD, DᵀD and Dᵀw.
    ad: DMatrix<f64>,
    dd: DMatrix<f64>,
    dw: DVector<f64>,
    values: Vec<f64>,
}

impl Free {
    fn new(solution: &Solution, pieces: &[Piece]) -> Option<Self> {
        let model = &solution.model;
        let (n, count) = (model.free(), pieces.len());
        let (mut h, mut g) = (DMatrix::zeros(n, n), DVector::zeros(n));
        let mut ad = DMatrix::zeros(n, count);
        let mut dd = DMatrix::zeros(count, count);
        let mut dw = DVector::zeros(count);
        let mut squares = 0.0;
        let candidates: Vec<Candidate> = pieces.iter().map(|p| p.candidate.clone()).collect();
        solution.each_sample(&candidates, &solution.used_samples(), |s, d| {
            s.a.add_gram(1.0, &mut h);
            s.a.add_transposed_vector(&s.w, &mut g);
            s.a.add_transposed_times(1.0, d, &mut ad);
            dd.gemm(1.0, &d.transpose(), d, 1.0);
            dw += d.tr_mul(&s.w);
            squares += s.w.norm_squared();
        });
        let mut system = NormalEquations::of(&h, &g);
        add_prior(model, &solution.values, &mut system);
        system.data = squares;
        let values = model.columns.iter().map(|p| solution.values.0[*p]);
        Some(Self {
            system,
            ad,
            dd,
            dw,
            values: values.collect(),
        })
    }

    /// The amplitudes that the samples ask for with everything free: −I⁻¹U, a weak ridge on what the parameters imitate.
    fn amplitudes(&self, pieces: &[Piece]) -> Vec<f64> {
        const RIDGE: f64 = 1e-6;
        let Some(c) = covariance_of(&self.system) else {
            return signs(pieces, |_| 1.0);
        };
        let mut information = &self.dd - self.ad.tr_mul(&(&c * &self.ad));
        for k in 0..pieces.len() {
            information[(k, k)] += RIDGE * self.dd[(k, k)] + f64::MIN_POSITIVE;
        }
        let gradient = DVector::from_column_slice(&self.system.g);
        let u = &self.dw - self.ad.tr_mul(&(&c * gradient));
        let found = information.lu().solve(&u);
        signs(pieces, |k| found.as_ref().map_or(1.0, |f| -f[k]))
    }

    fn cost(&self, pieces: &[Piece], signs: &[f64]) -> f64 {
        let (cost, step) = self.minimum(pieces, signs, &[]);
        let below = |p: &&Piece| {
            let at = step
                .as_ref()
                .map_or(0.0, |step| self.values[p.column] + step[p.column]);
            p.nonnegative && at < 0.0
        };
        let mut held: Vec<usize> = pieces.iter().filter(below).map(|p| p.column).collect();
        held.sort_unstable();
        held.dedup();
        if held.is_empty() {
            cost
        } else {
            self.minimum(pieces, signs, &held).0
        }
    }

    /// F and δ, with some coefficients held at 0.
    fn minimum(
        &self,
        pieces: &[Piece],
        signs: &[f64],
        held: &[usize],
    ) -> (f64, Option<DVector<f64>>) {
        /// Information that holds a coefficient, against that of the data.
        const HOLD: f64 = 1e6;
        let n = self.system.n;
        let count = pieces.len();
        let start = DVector::from_fn(count, |k, _| {
            signs[pieces[k].start] * self.values[pieces[k].column]
        });
        // w' = w + D S x̂,   A' = A + D S
        let (ad, dd) = (&self.ad * &start, &self.dd * &start);
        let mut cost = self.system.cost() + 2.0 * self.dw.dot(&start) + start.dot(&dd);
        let mut h = DMatrix::zeros(n, n);
        for i in 0..n {
            for j in i..n {
                h[(i, j)] = self.system.h[i * n + j];
                h[(j, i)] = h[(i, j)];
            }
        }
        let mut g = DVector::from_column_slice(&self.system.g) + ad;
        for (k, piece) in pieces.iter().enumerate() {
            let (column, sign) = (piece.column, signs[piece.start]);
            g[column] += sign * (self.dw[k] + dd[k]);
            for i in 0..n {
                h[(i, column)] += sign * self.ad[(i, k)];
                h[(column, i)] += sign * self.ad[(i, k)];
            }
            for (l, other) in pieces.iter().enumerate() {
                h[(column, other.column)] += sign * signs[other.start] * self.dd[(k, l)];
            }
        }
        for &column in held {
            let weight = HOLD * h[(column, column)];
            h[(column, column)] += weight;
            g[column] += weight * self.values[column];
            cost += weight * self.values[column].powi(2);
        }
        let Some(c) = covariance_of(&NormalEquations::of(&h, &g)) else {
            return (f64::INFINITY, None);
        };
        let step = -(c * &g);
        (cost + g.dot(&step), Some(step))
    }
}

/// Equation (3): w and D x̂ of every held-out sample.
struct Held {
    samples: Vec<(DVector<f64>, DMatrix<f64>)>,
    /// c of equation (3) for one row.
    gross: f64,
}

impl Held {
    fn new(solution: &Solution, pieces: &[Piece], excess: f64) -> Self {
        let model = &solution.model;
        let mut work = Workspace::new(model);
        work.cache.update(&model.problem, &solution.values);
        let weights = vec![1.0; model.observations.len()];
        let objective = Objective {
            weights: &weights,
            ..solution.objective()
        };
        let candidates: Vec<Candidate> = pieces.iter().map(|p| p.candidate.clone()).collect();
        let mut wanted: Vec<usize> = pieces.iter().flat_map(Piece::samples).collect();
        wanted.sort_unstable();
        wanted.dedup();
        let mut samples = Vec::new();
        for sample in wanted {
            let Some(s) = whitened(objective, &solution.values, sample, &mut work) else {
                continue;
            };
            let rows = solution.effect_rows(&candidates, sample, &s.blocks, s.w.len(), &work);
            let mut d = &s.l_inverse * rows;
            for (k, piece) in pieces.iter().enumerate() {
                let value = solution.values.0[model.columns[piece.column]];
                d.column_mut(k).scale_mut(value);
            }
            samples.push((s.w, d));
        }
        Self {
            samples,
            gross: GROSS * excess,
        }
    }

    /// Signs of the amplitudes of least squares.
    fn amplitudes(&self, pieces: &[Piece]) -> Vec<f64> {
        const RIDGE: f64 = 1e-6;
        let count = pieces.len();
        let mut dd = DMatrix::zeros(count, count);
        let mut dw = DVector::zeros(count);
        for (w, d) in &self.samples {
            dd += d.tr_mul(d);
            dw += d.tr_mul(w);
        }
        for k in 0..count {
            dd[(k, k)] += RIDGE * dd[(k, k)] + f64::MIN_POSITIVE;
        }
        let found = dd.lu().solve(&dw);
        signs(pieces, |k| found.as_ref().map_or(1.0, |f| -f[k]))
    }

    fn cost(&self, pieces: &[Piece], signs: &[f64]) -> f64 {
        let of = DVector::from_fn(pieces.len(), |k, _| signs[pieces[k].start]);
        let cost = |(w, d): &(DVector<f64>, DMatrix<f64>)| {
            let limit = self.gross * w.len() as f64;
            (w + d * &of).norm_squared().min(limit)
        };
        self.samples.iter().map(cost).sum()
    }
}

impl Piece {
    /// Samples that the start is about.
    fn samples(&self) -> impl Iterator<Item = usize> + '_ {
        let values = self.candidate.values().iter().enumerate();
        values.filter(|(_, v)| **v != 0.0).map(|(s, _)| s)
    }
}
