//! The sums of equation (1): those of the design from some samples, those of the residuals from all.

use std::ops::Range;

use nalgebra::{DMatrix, DVector, DVectorView, Vector3, Vector6};
use rayon::prelude::*;

use super::changed::Changed;
use super::{Moves, UntestedEffect};
use crate::analysis::looked_at::looked_at;
use crate::analysis::solution::Solution;
use crate::model::cache::State;
use crate::model::pose::Pose;
use crate::solve::equations::{NormalEquations, Workspace};
use crate::solve::normal::add_prior;
use crate::solve::rows::{dot, residual};
use crate::solve::whitened::Whitened;

/// Samples that are summed by one task.
const CHUNK: usize = 64;

/// What the effects move, each motion once.
pub(super) struct Columns<'a> {
    solution: &'a Solution,
    effects: &'a [&'a UntestedEffect],
    moves: Vec<Moves>,
    /// Place of each effect's motion in `moves`.
    of: Vec<usize>,
}

impl<'a> Columns<'a> {
    pub(super) fn new(solution: &'a Solution, effects: &'a [&'a UntestedEffect]) -> Self {
        let mut moves: Vec<Moves> = Vec::new();
        let mut of = Vec::new();
        for effect in effects {
            let known = moves.iter().position(|m| *m == effect.moves);
            of.push(known.unwrap_or(moves.len()));
            if known.is_none() {
                moves.push(effect.moves);
            }
        }
        Self {
            solution,
            effects,
            moves,
            of,
        }
    }

    /// L⁻¹ ∂e of every motion at one sample.
    fn at(&self, sample: usize, rows: &Whitened, work: &Workspace) -> DMatrix<f64> {
        let values = &self.solution.values;
        let model = &self.solution.model;
        let state = State::new(&model.problem, &work.cache, values);
        let mut out = DMatrix::zeros(rows.w.len(), self.moves.len());
        let mut twists = Vec::new();
        let mut measurement = usize::MAX;
        let mut pose = Pose::identity();
        for &(o, first, count) in &rows.blocks {
            let observation = model.observations[o];
            if observation.measurement != measurement {
                measurement = observation.measurement;
                pose = model.paths[measurement].effects(state, sample, &mut twists);
            }
            let jacobian = residual(model, values, measurement, observation.item, &pose);
            let kind = &model.problem.measurements[measurement];
            for (k, moves) in self.moves.iter().enumerate() {
                let twist = match *moves {
                    Moves::Joint(joint) => twists
                        .iter()
                        .filter(|(edge, _)| *edge == joint.index())
                        .map(|(_, twist)| twist[0])
                        .sum(),
                    Moves::Reference(frame, axis) if kind.from == frame => {
                        let v: Vector3<f64> = pose.r.row(axis).transpose();
                        Vector6::new(0.0, 0.0, 0.0, v.x, v.y, v.z)
                    }
                    Moves::Body(frame, axis) if kind.to == frame => Vector6::ith(3 + axis, 1.0),
                    _ => continue,
                };
                for i in 0..count {
                    out[(first + i, k)] += dot(&jacobian.m[i], &twist);
                }
            }
        }
        &rows.l_inverse * out
    }

    fn workspace(&self) -> Workspace {
        let model = &self.solution.model;
        let mut work = Workspace::new(model);
        work.cache.update(&model.problem, &self.solution.values);
        work
    }
}

/// What does not depend on the residuals.
pub(super) struct Design {
    fitted: DMatrix<f64>,
    held_out: DMatrix<f64>,
    /// b of every effect.
    pub b: DMatrix<f64>,
    /// Σ aᵀV⁻¹a of every effect.
    pub own: Vec<f64>,
}

impl Design {
    /// From at most about `most` of the samples, each of which stands for others of its recording.
    pub(super) fn of(
        columns: &Columns<'_>,
        weights: &[f64],
        samples: &[usize],
        most: usize,
        changes: &mut [Option<Changed<'_>>],
    ) -> Self {
        let (solution, effects) = (columns.solution, columns.effects);
        let n = solution.model.free();
        let mut out = Self {
            fitted: DMatrix::zeros(n, n),
            held_out: DMatrix::zeros(n, n),
            b: DMatrix::zeros(n, effects.len()),
            own: vec![0.0; effects.len()],
        };
        let mut places: Vec<(usize, usize)> = samples.iter().copied().zip(0..).collect();
        places.sort_unstable();
        let in_order: Vec<usize> = places.iter().map(|(sample, _)| *sample).collect();
        let drawn = looked_at(&in_order, &solution.model.problem.borders, most);
        let mut work = columns.workspace();
        for (sample, factor) in drawn.weighed() {
            let place = places[in_order.partition_point(|s| *s < sample)].1;
            let Some(s) = solution.rows_with(weights, sample, &mut work) else {
                continue;
            };
            let h = match solution.model.is_held_out(sample) {
                true => &mut out.held_out,
                false => &mut out.fitted,
            };
            s.a.add_gram(factor, h);
            let motions = columns.at(sample, &s, &work);
            // An effect is a motion times its regressor.
            let along = s.a.transposed_times(&motions);
            let concerned: Vec<Range<usize>> = along.column_iter().map(concerned).collect();
            let squares: Vec<f64> = motions.column_iter().map(|c| c.norm_squared()).collect();
            for (k, (effect, &motion)) in effects.iter().zip(&columns.of).enumerate() {
                let (value, rows) = (effect.at_samples[place], &concerned[motion]);
                if value != 0.0 && !rows.is_empty() {
                    let own = along.view((rows.start, motion), (rows.len(), 1));
                    let mut b = out.b.view_mut((rows.start, k), (rows.len(), 1));
                    b.zip_apply(&own, |sum, x| *sum += factor * value * x);
                    out.own[k] += factor * value * value * squares[motion];
                }
            }
            for changed in changes.iter_mut().flatten() {
                changed.add(solution, (sample, &s), factor, &work);
            }
        }
        out
    }

    /// H of the fitted samples, with the priors.
    pub(super) fn fitted(&self, solution: &Solution) -> NormalEquations {
        with_prior(&self.fitted, solution)
    }

    /// H of all samples.
    pub(super) fn all(&self, solution: &Solution) -> NormalEquations {
        with_prior(&(&self.fitted + &self.held_out), solution)
    }
}

/// From the first to the last entry that is not 0.
fn concerned(column: DVectorView<'_, f64>) -> Range<usize> {
    let is = |x: &f64| *x != 0.0;
    let end = column.as_slice().iter().rposition(is).map_or(0, |i| i + 1);
    column.as_slice().iter().position(is).unwrap_or(end)..end
}

fn with_prior(h: &DMatrix<f64>, solution: &Solution) -> NormalEquations {
    let mut out = NormalEquations::of(h, &DVector::zeros(h.nrows()));
    add_prior(&solution.model, &solution.values, &mut out);
    out
}

/// What the residuals say.
pub(super) struct Seen {
    /// Σ Aᵀw.
    g: DVector<f64>,
    /// Σ aᵀV⁻¹e of every effect.
    pub score: Vec<f64>,
}

impl Seen {
    pub(super) fn of(columns: &Columns<'_>, weights: &[f64], samples: &[usize]) -> Self {
        let solution = columns.solution;
        let none = || Self {
            g: DVector::zeros(solution.model.free()),
            score: vec![0.0; columns.effects.len()],
        };
        let places: Vec<(usize, usize)> = samples.iter().copied().enumerate().collect();
        let at = columns.workspace();
        let of = |places: &[(usize, usize)]| {
            let (mut sum, mut work) = (none(), at.clone());
            for &(place, sample) in places {
                if let Some(s) = solution.rows_with(weights, sample, &mut work) {
                    s.a.add_transposed_vector(&s.w, &mut sum.g);
                    let along = columns.at(sample, &s, &work).tr_mul(&s.w);
                    for (k, effect) in columns.effects.iter().enumerate() {
                        sum.score[k] += along[columns.of[k]] * effect.at_samples[place];
                    }
                }
            }
            sum
        };
        let parts: Vec<Self> = places.par_chunks(CHUNK).map(of).collect();
        parts.into_iter().fold(none(), |mut all, part| {
            all.g += part.g;
            let scores = all.score.iter_mut().zip(part.score);
            scores.for_each(|(sum, own)| *sum += own);
            all
        })
    }

    /// g, with the priors.
    pub(super) fn gradient(&self, solution: &Solution) -> DVector<f64> {
        let n = self.g.len();
        let mut system = NormalEquations::of(&DMatrix::zeros(n, n), &self.g);
        add_prior(&solution.model, &solution.values, &mut system);
        DVector::from_column_slice(&system.g)
    }
}
