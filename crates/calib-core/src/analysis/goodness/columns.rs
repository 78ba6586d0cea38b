//! The columns of effects that the model does not have, sample by sample.

use std::sync::Arc;

use nalgebra::{DMatrix, Vector3, Vector6};
use rayon::prelude::*;

use super::{Candidate, Effect};
use crate::analysis::solution::Solution;
use crate::model::cache::State;
use crate::model::path::DRIVEN;
use crate::model::pose::Pose;
use crate::solve::equations::Workspace;
use crate::solve::rows::{dot, residual};
use crate::solve::whitened::Whitened;

/// Samples that are looked at one after the other, and those that are held at once.
const TOGETHER: usize = 8;
const AT_ONCE: usize = 4 * TOGETHER;

/// A sample in whitened form with the columns L⁻¹a of candidates.
pub(crate) struct Seen {
    /// Its number.
    pub sample: usize,
    pub rows: Arc<Whitened>,
    pub columns: DMatrix<f64>,
}

/// The twist of what stands at `pose` where everything is displaced by `d` in the measuring frame.
fn moved(pose: &Pose, d: &Vector3<f64>) -> Vector6<f64> {
    let v = pose.r.tr_mul(d);
    Vector6::new(0.0, 0.0, 0.0, v.x, v.y, v.z)
}

impl Solution {
    /// Calls `see` with the whitened rows of each of `samples` and the candidates' whitened columns L⁻¹a, side by side.
    pub(crate) fn each_sample(
        &self,
        candidates: &[Candidate],
        samples: &[usize],
        mut see: impl FnMut(&Whitened, &DMatrix<f64>),
    ) {
        for seen in self.seen(candidates, samples) {
            see(&seen.rows, &seen.columns);
        }
    }

    /// The rows and columns of each of `samples` that has any, in their order; some at a time, on all cores.
    pub(crate) fn seen<'a>(
        &'a self,
        candidates: &'a [Candidate],
        samples: &'a [usize],
    ) -> impl Iterator<Item = Seen> + 'a {
        let model = &self.model;
        let mut work = Workspace::new(model);
        work.cache.update(&model.problem, &self.values);
        let of = move |work: &Workspace, some: &[usize]| -> Vec<Seen> {
            let mut work = Workspace::with(model, work.cache.clone());
            let seen = some.iter().filter_map(|&sample| {
                let rows = self.rows_of(sample, &mut work)?;
                let own = self.effect_rows(candidates, sample, &rows.blocks, rows.w.len(), &work);
                Some(Seen {
                    sample,
                    columns: &rows.l_inverse * own,
                    rows,
                })
            });
            seen.collect()
        };
        samples.chunks(AT_ONCE).flat_map(move |some| {
            let pieces = some.par_chunks(TOGETHER);
            let pieces: Vec<Vec<Seen>> = pieces.map(|piece| of(&work, piece)).collect();
            pieces.into_iter().flatten()
        })
    }

    /// a of equation (1) for every candidate at one sample.
    pub(crate) fn effect_rows(
        &self,
        candidates: &[Candidate],
        sample: usize,
        blocks: &[(usize, usize, usize)],
        rows: usize,
        work: &Workspace,
    ) -> DMatrix<f64> {
        let model = &self.model;
        let mut out = DMatrix::zeros(rows, candidates.len());
        let mut twists = Vec::new();
        let mut measurement = usize::MAX;
        let mut pose = Pose::identity();
        for &(o, first, count) in blocks {
            let observation = model.observations[o];
            if observation.measurement != measurement {
                measurement = observation.measurement;
                let at = State::new(&model.problem, &work.cache, &self.values);
                pose = model.paths[measurement].effects(at, sample, &mut twists);
            }
            let jacobian = residual(model, &self.values, measurement, observation.item, &pose);
            for (k, candidate) in candidates.iter().enumerate() {
                let twist = match &candidate.effect {
                    Effect::Joints(parts) => parts
                        .iter()
                        .flat_map(|(edge, drives, values)| {
                            let which = DRIVEN.iter().position(|d| d == drives).unwrap_or(0);
                            twists
                                .iter()
                                .filter(move |(e, _)| e == edge)
                                .map(move |(_, t)| t[which] * values[sample])
                        })
                        .sum::<Vector6<f64>>(),
                    Effect::Drift(axis, values) => {
                        let mut e = Vector3::zeros();
                        e[*axis] = values[sample];
                        moved(&pose, &e)
                    }
                    Effect::Place(bend) => {
                        let point = jacobian.point.map_or_else(Vector3::zeros, |(p, _)| {
                            model.point_position(p.index(), &self.values).coords
                        });
                        let from = model.problem.measurements[measurement].from;
                        moved(&pose, &bend.at(from, &(pose.t + pose.r * point)))
                    }
                };
                for i in 0..count {
                    out[(first + i, k)] = dot(&jacobian.m[i], &twist);
                }
            }
        }
        out
    }
}
