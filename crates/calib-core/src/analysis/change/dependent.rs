//! How large T becomes by chance where successive rows share a part of their errors: a filter in the tracker, warming, joints that stop off their
//! readings while many rows are taken, an effect that the model lacks.
//!
//! Asked only where something seems to have changed, of what the fit leaves beside it: the change itself is no memory.
//!
//! ```text
//! δ = −C (Σ Aᵀw + E ĉ),   r_s = w_s + A_s δ + B̃_s ĉ f_s,   U_b = Σ_{s∈b} B̃ᵀ r                          (1)
//! M = Σ_b Wᵀ U_b U_bᵀ W / (s² (1 − t)),   G⁻¹ = W Wᵀ,   t = tr(G⁻¹ Σ_b E_bᵀ C E_b) / d + T_q / (d n)      (2)
//! T_γ ← ν m (exp(T_γ / ν) − 1),   h = (tr M)² / tr M²,   m = tr M / h,   ν = h n (1 − t)                 (3)
//! T_γ ← T_γ κ (1 + 2 c ρ / (1 − ρ))                                                                      (4)
//! ```
//!
//! f_s is how much of the change holds in a sample, s² the mean square of r, and d the rank of G = Σ B̃ᵀB̃. Without memory the sums over n blocks of
//! successive samples have the variance of the samples, M = 1, but for the part t that the parameters take and that a change takes which is the best of
//! many, T_q. M is how much more they have in each direction, whatever it comes from; a sum of squares of such sums is m times a χ² of h degrees of freedom
//! (Satterthwaite 1946), and as m is known from ν of them, (3) is what F is to χ² (Künsch 1989 for the blocks). (4) has the memory c ρ^l that r shows from
//! one sample to the next ([`Dependence`](crate::Dependence)), which fewer samples
//! show. What asks for the larger T decides.

use std::sync::Arc;

use calib_geometry::decompose::symmetric_eigen;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::chance::ChanceOfChanges;
use super::columns::Pattern;
use super::exact::Scanned;
use super::sums::Found;
use crate::analysis::dependence::Dependence;
use crate::analysis::solution::Solution;
use crate::analysis::successive::is_shown;
use crate::solve::equations::Workspace;
use crate::solve::whitened::Whitened;

/// Counts of blocks that the samples are cut into. More blocks show their variance better, fewer a longer memory.
const BLOCKS: [usize; 3] = [48, 24, 12];
/// Samples in a block, at least: of 40 poses in blocks of three, a slip of twice the noise lost to a joint in one of ten recordings.
const LEAST: usize = 4;
/// What the parameters and a change leave of the sums of blocks, at least, for m to be known.
const LEFT: f64 = 0.5;
/// A direction with less than this share of a column's information is none.
const NONE: f64 = 1e-6;
/// Samples that are looked at one after the other: the same bits for any number of cores.
const TOGETHER: usize = 16;

/// A change that a scan found.
pub(super) struct Seen<'a> {
    pub scanned: &'a Scanned<'a>,
    pub candidate: usize,
    pub found: &'a Found,
}

impl Solution {
    /// How many times as large T is under the memory that successive samples show beside a change: equation (4). 1 where they show none.
    pub(super) fn memory_beside_change(&self, seen: &Seen<'_>) -> f64 {
        let left = Left::of(self, seen);
        let memory = self.dependence_beside(seen.scanned.borders, &|sample, rows, work| {
            left.beside_change(sample, rows, work);
        });
        let memory = memory.filter(Dependence::is_significant);
        memory.as_ref().map_or(1.0, Dependence::of_sums)
    }

    /// The variance of sums over blocks of samples beside a change, over what it is without memory, and its degrees of freedom: m and ν of equation (3), where
    /// they show more than chance.
    pub(super) fn memory_in_blocks(
        &self,
        seen: &Seen<'_>,
        chance: &ChanceOfChanges,
    ) -> Vec<(f64, f64)> {
        Left::of(self, seen).of_blocks(chance.quantiles[seen.candidate])
    }
}

/// T of equation (3).
pub(super) fn in_blocks(largest: f64, (m, freedom): (f64, f64)) -> f64 {
    m * freedom * (largest / freedom).exp_m1()
}

/// What the fit leaves beside the change: equation (1).
struct Left<'a> {
    solution: &'a Solution,
    seen: &'a Seen<'a>,
    step: DVector<f64>,
    jump: DVector<f64>,
}

impl<'a> Left<'a> {
    fn of(solution: &'a Solution, seen: &'a Seen<'a>) -> Self {
        Self {
            solution,
            seen,
            step: seen.scanned.design.step_beside(seen.candidate, seen.found),
            jump: DVector::from_column_slice(&seen.found.jump),
        }
    }

    /// w ← r, and B̃ of the candidate.
    fn beside_change(&self, sample: usize, rows: &mut Whitened, work: &Workspace) -> DMatrix<f64> {
        let Seen {
            scanned,
            candidate,
            found,
        } = *self.seen;
        let (candidates, design) = (scanned.candidates, scanned.design);
        rows.w += rows.a.times_vector(&self.step);
        let b = candidates.whitened(self.solution, sample, rows, work);
        let own = b.columns_range(design.columns[candidate].clone());
        let holds = match design.patterns[candidate] {
            Pattern::Step => f64::from(u8::from(design.contains(&found.after, sample))),
            _ => {
                let samples = self.seen.scanned.samples;
                let place = samples.partition_point(|s| *s < sample);
                design.factor(candidate, place, samples.len())
            }
        };
        if holds != 0.0 {
            rows.w += own * (&self.jump * holds);
        }
        own.into_owned()
    }

    /// m and ν of equation (3), for each count of blocks that shows more than chance.
    fn of_blocks(&self, quantile: f64) -> Vec<(f64, f64)> {
        let (samples, design) = (self.seen.scanned.samples, self.seen.scanned.design);
        let (bins, s2) = self.bins();
        let Some(whole) = self.information() else {
            return Vec::new();
        };
        let rank = whole.ncols() as f64;
        let of = |blocks: usize| {
            let ends = self.blocks(blocks);
            let count = ends.len() as f64;
            let mut sums = DMatrix::zeros(whole.ncols(), whole.ncols());
            let (mut taken, mut first) = (0.0, 0);
            for end in ends {
                let own = bins[first..end].iter();
                let own = own.fold(DVector::zeros(bins[0].len()), |sum, u| sum + u);
                let own = whole.tr_mul(&own);
                sums.ger(1.0, &own, &own, 1.0);
                if let Some(fit) = design.taken_between(self.steps(), (first, end)) {
                    taken += (whole.tr_mul(&fit) * &whole).trace();
                }
                first = end;
            }
            let left = 1.0 - taken / rank - quantile / (rank * count);
            if samples.len() < LEAST * blocks || left <= LEFT {
                return None;
            }
            sums /= s2 * left;
            let (all, squares) = (sums.trace(), sums.norm_squared());
            if !is_shown(all / rank, rank * count * left) {
                return None;
            }
            // tr M² is larger by chance, as of a Wishart matrix.
            let n = count * left;
            let squares = (squares - all * all / n) / (1.0 + 1.0 / n);
            let directions = (all * all / squares.max(f64::MIN_POSITIVE)).clamp(1.0, rank);
            Some((all / directions, directions * n))
        };
        BLOCKS.into_iter().filter_map(of).collect()
    }

    /// W of G⁻¹ = W Wᵀ.
    fn information(&self) -> Option<DMatrix<f64>> {
        let design = self.seen.scanned.design;
        let g = design.whole(self.steps());
        let scale = g
            .diagonal()
            .map(|x| if x > 0.0 { 1.0 / x.sqrt() } else { 0.0 });
        let scaled = DMatrix::from_fn(g.nrows(), g.ncols(), |i, j| g[(i, j)] * scale[i] * scale[j]);
        if scaled.iter().any(|x| !x.is_finite()) {
            return None;
        }
        let eigen = symmetric_eigen(&scaled);
        let kept = (0..g.nrows()).filter(|i| eigen.values[*i] > NONE);
        let column =
            |i: usize| eigen.vectors.column(i).component_mul(&scale) / eigen.values[i].sqrt();
        let columns: Vec<DVector<f64>> = kept.map(column).collect();
        (!columns.is_empty()).then(|| DMatrix::from_columns(&columns))
    }

    /// The candidate of the same columns that holds from a sample on.
    fn steps(&self) -> usize {
        let (design, k) = (self.seen.scanned.design, self.seen.candidate);
        let same = |other: &usize| {
            design.patterns[*other] == Pattern::Step && design.columns[*other] == design.columns[k]
        };
        (0..design.columns.len()).find(same).unwrap_or(k)
    }

    /// Σ B̃ᵀ r of every bin, and the mean square of r.
    fn bins(&self) -> (Vec<DVector<f64>>, f64) {
        let (solution, edges) = (self.solution, self.seen.scanned.design.edges());
        let width = self.jump.len();
        let mut work = Workspace::new(&solution.model);
        work.cache.update(&solution.model.problem, &solution.values);
        let of_some = |some: &[usize]| {
            let mut work = work.clone();
            let mut out: Vec<(usize, DVector<f64>, f64, usize)> = Vec::with_capacity(some.len());
            for &sample in some {
                if let Some(rows) = solution.rows_of(sample, &mut work) {
                    let mut rows = Arc::unwrap_or_clone(rows);
                    let b = self.beside_change(sample, &mut rows, &work);
                    let bin = edges.partition_point(|edge| *edge <= sample) - 1;
                    out.push((bin, b.tr_mul(&rows.w), rows.w.norm_squared(), rows.w.len()));
                }
            }
            out
        };
        let pieces: Vec<_> = self
            .seen
            .scanned
            .samples
            .par_chunks(TOGETHER)
            .map(of_some)
            .collect();
        let mut bins = vec![DVector::zeros(width); edges.len() - 1];
        let (mut squares, mut count) = (0.0, 0);
        for (bin, u, square, rows) in pieces.into_iter().flatten() {
            bins[bin] += u;
            squares += square;
            count += rows;
        }
        (bins, squares / f64::max(count as f64, 1.0))
    }

    /// The edges that blocks end at: where one has its part of the samples.
    fn blocks(&self, count: usize) -> Vec<usize> {
        let (edges, samples) = (self.seen.scanned.design.edges(), self.seen.scanned.samples);
        let before = |edge: usize| samples.partition_point(|s| *s < edges[edge]);
        let last = edges.len() - 1;
        let mut ends: Vec<usize> = Vec::with_capacity(count);
        for end in 1..=last {
            if end == last || before(end) * count >= (ends.len() + 1) * samples.len() {
                ends.push(end);
            }
        }
        ends
    }
}
