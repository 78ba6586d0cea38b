//! Cumulative sums of equation (1) over the samples, and the best set of samples of a candidate.

use std::sync::Arc;

use calib_geometry::decompose::{dot, inverse_root};
use nalgebra::{DMatrix, DVector};

use super::columns::{Candidates, Pattern};
use crate::analysis::solution::Solution;
use crate::solve::whitened::Whitened;

mod filled;
mod others;

/// Fewest samples on either side of a step: one or two bad poses are outliers, not a change.
pub(super) const LEAST: usize = 3;

/// Samples whose rows the threshold is simulated with: beyond, the distribution of T no longer depends on their count.
pub(super) const SIMULATED: usize = 240;

/// The samples after a change: the end of one recording, from an edge on, and other recordings as a whole.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct After {
    /// First and last edge, by their numbers.
    pub first: usize,
    pub end: usize,
    /// The recording of these edges.
    part: usize,
    /// Recordings that belong to it besides.
    others: Vec<usize>,
}

/// The best set of a candidate.
#[derive(Debug, Clone)]
pub(super) struct Found {
    pub after: After,
    /// Δ of equation (2).
    pub gain: f64,
    pub jump: Vec<f64>,
    /// Diagonal of I⁻¹.
    pub variance: Vec<f64>,
}

/// One sample, kept for the simulation.
pub(super) struct Kept {
    pub rows: Arc<Whitened>,
    /// B̃ᵀ.
    pub b: DMatrix<f64>,
}

/// Rᵀ E, C = R Rᵀ, and Σ B̃ᵀB̃ of one candidate over a set of samples.
#[derive(Clone)]
pub(super) struct Sum {
    pub f: DMatrix<f64>,
    g: DMatrix<f64>,
}

impl Sum {
    fn zeros(n: usize, d: usize) -> Self {
        Self {
            f: DMatrix::zeros(n, d),
            g: DMatrix::zeros(d, d),
        }
    }

    /// Adds what lies between two cumulative sums.
    fn add_between(&mut self, from: &Self, to: &Self) {
        let add = |sum: &mut DMatrix<f64>, from: &DMatrix<f64>, to: &DMatrix<f64>| {
            let between = from.as_slice().iter().zip(to.as_slice());
            let sums = sum.as_mut_slice().iter_mut().zip(between);
            sums.for_each(|(sum, (from, to))| *sum += to - from);
        };
        add(&mut self.f, &from.f, &to.f);
        add(&mut self.g, &from.g, &to.g);
    }
}

/// A set with I⁻¹: everything of a test that does not depend on the residuals.
pub(super) struct Test {
    after: After,
    /// Its first and last edges, neighbors together.
    runs: Vec<(usize, usize)>,
    inverse: DMatrix<f64>,
}

impl Test {
    /// Uᵀ I⁻¹ U; `own` is room for U.
    fn gain(&self, u: &DMatrix<f64>, own: &mut [f64]) -> f64 {
        let (d, u) = (own.len(), u.as_slice());
        own.fill(0.0);
        for (from, to) in &self.runs {
            let ends = u[from * d..][..d].iter().zip(&u[to * d..][..d]);
            let between = own.iter_mut().zip(ends);
            between.for_each(|(own, (from, to))| *own += to - from);
        }
        let columns = self.inverse.as_slice().chunks_exact(d);
        let along = |column: &[f64]| column.iter().zip(&*own).map(|(a, b)| a * b).sum::<f64>();
        own.iter().zip(columns).map(|(u, c)| u * along(c)).sum()
    }
}

/// The scan of a set of samples.
pub(super) struct Design {
    /// First sample of every bin, and one past the last.
    edges: Vec<usize>,
    /// Used samples before each edge.
    places: Vec<usize>,
    /// First edge of every recording, and the last edge.
    parts: Vec<usize>,
    /// Rᵀ of C = R Rᵀ.
    pub root: DMatrix<f64>,
    /// Rᵀ Aᵀw at the values of the fit: zero where the samples are all that it used.
    pub along: DVector<f64>,
    /// Columns with a prior, and 1/σ of it.
    pub priors: Vec<(usize, f64)>,
    /// F of equation (2).
    pub cost: f64,
    /// N of equation (2).
    pub rows: f64,
    /// Σ ln|V| over the samples.
    pub log_det: f64,
    pub patterns: Vec<Pattern>,
    pub columns: Vec<std::ops::Range<usize>>,
    /// By candidate: cumulative sums up to each edge; for other patterns than steps nothing and the whole.
    pub cumulative: Vec<Vec<Sum>>,
    /// U in the same way, at the minimum, column by column.
    pub u: Vec<DMatrix<f64>>,
    /// P of equation (1) by candidate.
    wide: Vec<f64>,
    /// Samples, for designs that are simulated.
    pub kept: Vec<Kept>,
}

impl Design {
    /// Sums over `samples`; changes are tried at `edges` of them and at the borders of recordings.
    pub(super) fn new(
        solution: &Solution,
        candidates: &Candidates,
        samples: &[usize],
        edges: &[usize],
        borders: &[usize],
    ) -> Option<Self> {
        // Every recording begins at its first sample that was used.
        let starts = borders.iter();
        let borders: Vec<usize> = starts
            .filter_map(|b| samples.iter().find(|s| *s >= b).copied())
            .filter(|b| *b > samples[0])
            .collect();
        let mut at = [edges, &borders, &samples[..1]].concat();
        at.sort_unstable();
        at.dedup();
        at.push(samples[samples.len() - 1] + 1);
        let places = at
            .iter()
            .map(|e| samples.partition_point(|s| s < e))
            .collect();
        let last = at.len() - 1;
        let place = |b: &usize| at.binary_search(b).ok();
        let mut parts: Vec<usize> = borders.iter().filter_map(place).collect();
        parts.extend([0, last]);
        parts.sort_unstable();
        parts.dedup();
        let list = &candidates.list;
        let mut out = Self {
            edges: at,
            places,
            parts,
            root: DMatrix::zeros(0, 0),
            along: DVector::zeros(0),
            priors: Vec::new(),
            cost: 0.0,
            rows: 0.0,
            log_det: 0.0,
            patterns: list.iter().map(|c| c.pattern).collect(),
            columns: list.iter().map(|c| c.columns.clone()).collect(),
            cumulative: Vec::new(),
            u: Vec::new(),
            wide: (0..list.len()).map(|k| candidates.prior(k)).collect(),
            kept: Vec::new(),
        };
        out.fill(solution, candidates, samples)?;
        Some(out)
    }

    /// Degrees of freedom ν beside the parameters of the fit and `jumps` more; those that their prior holds cost none.
    pub(super) fn freedom(&self, jumps: usize) -> f64 {
        let unknowns = self.root.nrows() + jumps;
        (self.rows + self.priors.len() as f64 - unknowns as f64).max(1.0)
    }

    /// T of equation (2).
    pub(super) fn score(&self, gain: f64) -> f64 {
        score(self.rows, self.cost, gain)
    }

    /// The step of the parameters that goes with a jump of what a set holds: δ = −R (Rᵀ Aᵀw + Rᵀ E ĉ).
    pub(super) fn step_beside(&self, candidate: usize, found: &Found) -> DVector<f64> {
        let jump = DVector::from_column_slice(&found.jump);
        let along = &self.along + self.sum(candidate, &found.after).f * jump;
        -self.root.tr_mul(&along)
    }

    /// First samples of the bins that ranges begin and end at, and one past the last.
    pub(super) fn edges(&self) -> &[usize] {
        &self.edges
    }

    /// Σ B̃ᵀB̃ of a candidate.
    pub(super) fn whole(&self, candidate: usize) -> &DMatrix<f64> {
        let sums = &self.cumulative[candidate];
        &sums[sums.len() - 1].g
    }

    /// EᵀCE between two edges: what the parameters take of a candidate. `None` for other patterns than steps.
    pub(super) fn taken_between(
        &self,
        candidate: usize,
        (from, to): (usize, usize),
    ) -> Option<DMatrix<f64>> {
        if self.patterns[candidate] != Pattern::Step {
            return None;
        }
        let sums = &self.cumulative[candidate];
        let f = &sums[to].f - &sums[from].f;
        Some(f.tr_mul(&f))
    }

    /// First sample after a change, and the first that is no longer.
    pub(super) fn samples_of(&self, after: &After) -> (usize, usize) {
        (self.edges[after.first], self.edges[after.end])
    }

    /// Whether a sample lies in a set.
    pub(super) fn contains(&self, after: &After, sample: usize) -> bool {
        let between =
            |first: usize, end: usize| (self.edges[first]..self.edges[end]).contains(&sample);
        let mut others = after.others.iter();
        between(after.first, after.end)
            || others.any(|o| between(self.parts[*o], self.parts[o + 1]))
    }

    /// One set, tested alone.
    pub(super) fn tested(
        &self,
        candidate: usize,
        after: &After,
        u: &DMatrix<f64>,
    ) -> Option<Found> {
        let inverse = self.inverse(candidate, after)?;
        Some(found(after, &inverse, &self.u_of(u, after)))
    }

    /// First samples of the other recordings of a set.
    pub(super) fn also(&self, after: &After) -> Vec<usize> {
        let first = |o: &usize| self.edges[self.parts[*o]];
        let mut out: Vec<usize> = after.others.iter().map(first).collect();
        out.sort_unstable();
        out
    }

    /// All sets that a candidate is tried with: the end of each recording, alone, with the recordings behind it in the
    /// order of the samples, and with all others. (The beginning alone is the last of these with the sign reversed.)
    fn sets(&self, candidate: usize) -> Vec<After> {
        let alone = |first: usize, end: usize, part: usize, others: Vec<usize>| After {
            first,
            end,
            part,
            others,
        };
        if self.patterns[candidate] != Pattern::Step {
            return vec![alone(0, 1, 0, Vec::new())];
        }
        let count = self.parts.len() - 1;
        let mut out = Vec::new();
        for part in 0..count {
            for first in self.parts[part]..self.parts[part + 1] {
                let all: Vec<usize> = (0..count).filter(|o| *o != part).collect();
                let later: Vec<usize> = (part + 1..count).collect();
                let mut others = vec![Vec::new(), later, all];
                others.dedup();
                let end = self.parts[part + 1];
                out.extend(others.into_iter().map(|o| alone(first, end, part, o)));
            }
        }
        out.retain(|after| self.is_large_enough(after));
        out
    }

    /// Whether enough samples lie on both sides.
    fn is_large_enough(&self, after: &After) -> bool {
        let between = |first: usize, end: usize| self.places[end] - self.places[first];
        let other = |o: &usize| between(self.parts[*o], self.parts[o + 1]);
        let inside =
            between(after.first, after.end) + after.others.iter().map(other).sum::<usize>();
        self.is_enough(inside)
    }

    fn is_enough(&self, inside: usize) -> bool {
        inside >= LEAST && self.places[self.places.len() - 1] - inside >= LEAST
    }

    fn sum(&self, candidate: usize, after: &After) -> Sum {
        let sums = &self.cumulative[candidate];
        let mut out = Sum::zeros(sums[0].f.nrows(), sums[0].f.ncols());
        out.add_between(&sums[after.first], &sums[after.end]);
        for (from, to) in self.runs(after) {
            out.add_between(&sums[from], &sums[to]);
        }
        out
    }

    fn u_of(&self, u: &DMatrix<f64>, after: &After) -> DVector<f64> {
        let mut out = u.column(after.end) - u.column(after.first);
        for (from, to) in self.runs(after) {
            out += u.column(to);
            out -= u.column(from);
        }
        out
    }

    /// I of equation (1), inverted; `None` where it is not positive.
    fn inverse(&self, candidate: usize, after: &After) -> Option<DMatrix<f64>> {
        let information = self.information(candidate, &self.sum(candidate, after));
        Some(inverse_root(&information)?.inverse())
    }

    fn information(&self, candidate: usize, sum: &Sum) -> DMatrix<f64> {
        let n = sum.f.nrows();
        let column = |i: usize| &sum.f.as_slice()[i * n..(i + 1) * n];
        let mut information = sum.g.clone();
        for i in 0..information.nrows() {
            information[(i, i)] += self.wide[candidate];
            for k in 0..=i {
                information[(i, k)] -= dot(column(i), column(k));
                information[(k, i)] = information[(i, k)];
            }
        }
        information
    }

    pub(super) fn tests(&self, candidate: usize) -> Vec<Test> {
        let sets = self.sets(candidate).into_iter();
        sets.filter_map(|after| {
            let inverse = self.inverse(candidate, &after)?;
            let runs = std::iter::once((after.first, after.end));
            Some(Test {
                runs: runs.chain(self.runs(&after)).collect(),
                after,
                inverse,
            })
        })
        .collect()
    }

    /// The set of the largest Δ for given cumulative sums of U: the best test of every recording, with other recordings
    /// moved to the other side as long as that helps.
    pub(super) fn best(&self, candidate: usize, tests: &[Test], u: &DMatrix<f64>) -> Option<Found> {
        let mut of_part: Vec<Option<(f64, &Test)>> = vec![None; self.parts.len() - 1];
        // Many tests of few columns: memory is taken once.
        let mut own = vec![0.0; self.columns[candidate].len()];
        for test in tests {
            let gain = test.gain(u, &mut own);
            let best = &mut of_part[test.after.part];
            if gain.is_finite() && best.is_none_or(|(g, _)| gain > g) {
                *best = Some((gain, test));
            }
        }
        let firsts = of_part
            .into_iter()
            .flatten()
            .map(|(_, test)| found(&test.after, &test.inverse, &self.u_of(u, &test.after)));
        self.beside_others(candidate, firsts.collect(), u)
    }

    /// The largest Δ of the sets that have all later recordings, and none before: changes that lasted, where recordings are in the order in which they
    /// were made.
    pub(super) fn best_in_order(
        &self,
        candidate: usize,
        tests: &[Test],
        u: &DMatrix<f64>,
    ) -> Option<Found> {
        let mut own = vec![0.0; self.columns[candidate].len()];
        let count = self.parts.len() - 1;
        let lasts = |after: &After| after.others.iter().copied().eq(after.part + 1..count);
        let tests = tests.iter().filter(|test| lasts(&test.after));
        let gains = tests.map(|test| (test.gain(u, &mut own), test));
        let gains = gains.filter(|(gain, _)| gain.is_finite());
        let (_, best) = gains.max_by(|a, b| a.0.total_cmp(&b.0))?;
        Some(found(
            &best.after,
            &best.inverse,
            &self.u_of(u, &best.after),
        ))
    }

    /// The best change near that of a coarser design, with the same other recordings.
    pub(super) fn best_near(&self, candidate: usize, coarse: &Self, near: &After) -> Option<Found> {
        let from = coarse.edges[near.first.saturating_sub(1)];
        let to = coarse.edges[(near.first + 1).min(coarse.edges.len() - 1)];
        let (start, end) = (self.parts[near.part], self.parts[near.part + 1]);
        let firsts = (start..end).filter(|f| (from..=to).contains(&self.edges[*f]));
        let sets = firsts.map(|first| After {
            first,
            end,
            ..near.clone()
        });
        sets.filter(|after| self.is_large_enough(after))
            .filter_map(|after| self.tested(candidate, &after, &self.u[candidate]))
            .max_by(|a, b| a.gain.total_cmp(&b.gain))
    }

    /// The edges, and all of `samples` within a bin of the first one of a set.
    pub(super) fn finer(&self, after: &After, samples: &[usize]) -> Vec<usize> {
        let last = self.edges.len() - 1;
        let mut out = self.edges[..last].to_vec();
        let from = self.edges[after.first.saturating_sub(1)];
        let to = self.edges[(after.first + 1).min(last)];
        out.extend(samples.iter().filter(|s| (from..to).contains(*s)));
        out
    }
}

fn found(after: &After, inverse: &DMatrix<f64>, u: &DVector<f64>) -> Found {
    let step = inverse * u;
    Found {
        after: after.clone(),
        gain: u.dot(&step),
        jump: step.iter().map(|x| -x).collect(),
        variance: inverse.diagonal().iter().copied().collect(),
    }
}

pub(super) fn score(rows: f64, cost: f64, gain: f64) -> f64 {
    /// A change may not explain everything: exact data have no noise to compare with.
    const LEFT: f64 = 1e-12;
    rows * (cost / (cost - gain).max(cost * LEFT).max(f64::MIN_POSITIVE)).ln()
}
