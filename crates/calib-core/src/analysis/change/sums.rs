//! Cumulative sums of equation (1) over the samples, and the best range of a candidate.

use nalgebra::{DMatrix, DVector};

use super::columns::{Candidates, Pattern};
use crate::analysis::solution::Solution;
use crate::solve::equations::{NormalEquations, Workspace};
use crate::solve::normal::add_prior;
use crate::solve::whitened::{Whitened, covariance_of, whitened};

/// Fewest samples on either side of a step: one or two bad poses are outliers, not a change.
pub(super) const LEAST: usize = 3;

/// Samples whose rows the threshold is simulated with: beyond, the distribution of T no longer depends on their count.
pub(super) const SIMULATED: usize = 240;

/// From one edge up to another, by their numbers among the edges.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Range {
    pub first: usize,
    pub end: usize,
}

/// The best range of a candidate.
#[derive(Debug, Clone)]
pub(super) struct Found {
    pub range: Range,
    /// Δ of equation (2).
    pub gain: f64,
    pub jump: Vec<f64>,
    /// Diagonal of I⁻¹.
    pub variance: Vec<f64>,
}

/// One sample, kept for the simulation.
pub(super) struct Kept {
    pub a: DMatrix<f64>,
    pub b: DMatrix<f64>,
}

/// U, E, C E and Σ B̃ᵀB̃ of one candidate over a set of samples.
#[derive(Clone)]
struct Sum {
    u: DVector<f64>,
    e: DMatrix<f64>,
    g: DMatrix<f64>,
}

impl Sum {
    fn zeros(n: usize, d: usize) -> Self {
        Self {
            u: DVector::zeros(d),
            e: DMatrix::zeros(n, d),
            g: DMatrix::zeros(d, d),
        }
    }

    fn add(&mut self, a: &DMatrix<f64>, b: &DMatrix<f64>, w: &DVector<f64>, factor: f64) {
        self.u.gemv_tr(factor, b, w, 1.0);
        self.e.gemm_tr(factor, a, b, 1.0);
        self.g.gemm_tr(factor * factor, b, b, 1.0);
    }

    fn minus(&self, other: &Self) -> Self {
        Self {
            u: &self.u - &other.u,
            e: &self.e - &other.e,
            g: &self.g - &other.g,
        }
    }
}

/// What a candidate needs of the data, but for U: its ranges with I⁻¹ and E.
pub(super) struct Test {
    pub range: Range,
    pub inverse: DMatrix<f64>,
    pub e: DMatrix<f64>,
}

/// The scan of a set of samples.
pub(super) struct Design {
    /// First sample of every bin, and one past the last.
    edges: Vec<usize>,
    /// Used samples before each edge.
    places: Vec<usize>,
    borders: Vec<usize>,
    pub covariance: DMatrix<f64>,
    /// Columns with a prior, and 1/σ of it.
    pub priors: Vec<(usize, f64)>,
    /// F of equation (2).
    pub cost: f64,
    /// N of equation (2).
    pub rows: f64,
    pub patterns: Vec<Pattern>,
    pub columns: Vec<std::ops::Range<usize>>,
    /// By candidate: cumulative sums up to each edge; for other patterns than steps the whole sum alone.
    cumulative: Vec<Vec<Sum>>,
    /// P of equation (1) by candidate.
    wide: Vec<f64>,
    /// Samples, for designs that are simulated.
    pub kept: Vec<Kept>,
}

impl Design {
    /// Sums over `samples`; ranges begin and end at `edges` of them and at the borders of recordings.
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
        let list = &candidates.list;
        let mut out = Self {
            edges: at,
            places,
            borders,
            covariance: DMatrix::zeros(0, 0),
            priors: Vec::new(),
            cost: 0.0,
            rows: 0.0,
            patterns: list.iter().map(|c| c.pattern).collect(),
            columns: list.iter().map(|c| c.columns.clone()).collect(),
            cumulative: Vec::new(),
            wide: (0..list.len()).map(|k| candidates.prior(k)).collect(),
            kept: Vec::new(),
        };
        out.fill(solution, candidates, samples)?;
        Some(out)
    }

    fn fill(
        &mut self,
        solution: &Solution,
        candidates: &Candidates,
        samples: &[usize],
    ) -> Option<()> {
        // Few enough to be simulated.
        let keep = samples.len() <= SIMULATED;
        let model = &solution.model;
        let n = model.free();
        let mut work = Workspace::new(model);
        work.cache.update(&model.problem, &solution.values);
        let mut h = DMatrix::zeros(n, n);
        let mut g = DVector::zeros(n);
        let sizes = self.columns.iter().map(ExactSizeIterator::len);
        let mut running: Vec<Sum> = sizes.map(|d| Sum::zeros(n, d)).collect();
        let mut cumulative: Vec<Vec<Sum>> = vec![Vec::new(); running.len()];
        let mut bin = 0;
        for (place, &sample) in samples.iter().enumerate() {
            while bin < self.edges.len() && self.edges[bin] <= sample {
                for (k, sums) in cumulative.iter_mut().enumerate() {
                    if self.patterns[k] == Pattern::Step {
                        sums.push(running[k].clone());
                    }
                }
                bin += 1;
            }
            let Some(rows) = whitened(solution.objective(), &solution.values, sample, &mut work)
            else {
                continue;
            };
            let b = candidates.whitened(solution, sample, &rows, &work);
            h.gemm_tr(1.0, &rows.a, &rows.a, 1.0);
            g.gemv_tr(1.0, &rows.a, &rows.w, 1.0);
            self.cost += rows.w.norm_squared();
            self.rows += rows.w.len() as f64;
            let position = place as f64 / (samples.len() - 1) as f64 - 0.5;
            for (k, sum) in running.iter_mut().enumerate() {
                let own = b.columns_range(self.columns[k].clone()).into_owned();
                let factor = if self.patterns[k] == Pattern::Linear {
                    position
                } else {
                    1.0
                };
                sum.add(&rows.a, &own, &rows.w, factor);
            }
            if keep {
                let Whitened { a, .. } = rows;
                self.kept.push(Kept { a, b });
            }
        }
        for (k, sum) in running.into_iter().enumerate() {
            cumulative[k].push(sum);
        }
        self.cumulative = cumulative;
        self.solve(solution, &h, &g)
    }

    /// C of the samples, F at their own minimum, and U there: one Gauss–Newton step from the fit, which is zero where
    /// the samples are those of the fit.
    fn solve(&mut self, solution: &Solution, h: &DMatrix<f64>, g: &DVector<f64>) -> Option<()> {
        let model = &solution.model;
        let n = model.free();
        let mut system = NormalEquations::new(n);
        for a in 0..n {
            for b in a..n {
                system.h[a * n + b] = h[(a, b)];
            }
            system.g[a] = g[a];
        }
        add_prior(model, &solution.values, &mut system);
        self.covariance = covariance_of(&system)?;
        let gradient = DVector::from_row_slice(&system.g);
        // δ = −C g,   U ← U + Eᵀ δ,   F ← F − gᵀ C g
        let step = -(&self.covariance * &gradient);
        self.cost += system.prior + gradient.dot(&step);
        for sums in &mut self.cumulative {
            for sum in sums {
                let more = sum.e.tr_mul(&step);
                sum.u += more;
            }
        }
        for (c, &p) in model.columns.iter().enumerate() {
            if let Some(sigma) = model.problem.parameters[p].prior_sigma {
                self.priors.push((c, 1.0 / sigma));
            }
        }
        (self.cost.is_finite() && self.rows > 0.0).then_some(())
    }

    /// T of equation (2).
    pub(super) fn score(&self, gain: f64) -> f64 {
        score(self.rows, self.cost, gain)
    }

    /// First sample of a range, and the first after it.
    pub(super) fn samples_of(&self, range: Range) -> (usize, usize) {
        (self.edges[range.first], self.edges[range.end])
    }

    /// All ranges that a candidate is tried with.
    fn ranges(&self, candidate: usize) -> Vec<Range> {
        let last = self.edges.len() - 1;
        if self.patterns[candidate] != Pattern::Step {
            return vec![Range {
                first: 0,
                end: last,
            }];
        }
        let place = |sample: &usize| self.edges.binary_search(sample).unwrap_or(last);
        let mut limits: Vec<usize> = self.borders.iter().map(place).collect();
        limits.insert(0, 0);
        limits.push(last);
        let mut out: Vec<Range> = (1..last).map(|first| Range { first, end: last }).collect();
        // One recording has no order to be in doubt about.
        if limits.len() > 2 {
            for part in limits.windows(2) {
                let (start, end) = (part[0], part[1]);
                out.extend((start..end).map(|first| Range { first, end }));
                out.extend((start + 1..end).map(|end| Range { first: start, end }));
            }
        }
        let enough = |r: &Range| {
            let inside = self.places[r.end] - self.places[r.first];
            inside >= LEAST && self.places[last] - inside >= LEAST
        };
        out.retain(enough);
        out.sort_by_key(|r| (r.first, r.end));
        out.dedup();
        out
    }

    fn sum(&self, candidate: usize, range: Range) -> Sum {
        let sums = &self.cumulative[candidate];
        if self.patterns[candidate] == Pattern::Step {
            sums[range.end].minus(&sums[range.first])
        } else {
            sums[0].clone()
        }
    }

    /// I of equation (1), inverted; `None` where nothing is left of the columns.
    fn inverse(&self, candidate: usize, sum: &Sum) -> Option<DMatrix<f64>> {
        let mut information = &sum.g - sum.e.tr_mul(&(&self.covariance * &sum.e));
        for i in 0..information.nrows() {
            information[(i, i)] += self.wide[candidate];
        }
        Some(nalgebra::Cholesky::new(information)?.inverse())
    }

    /// Everything of a candidate's tests that does not depend on the residuals.
    pub(super) fn tests(&self, candidate: usize) -> Vec<Test> {
        let ranges = self.ranges(candidate).into_iter();
        ranges
            .filter_map(|range| {
                let sum = self.sum(candidate, range);
                let inverse = self.inverse(candidate, &sum)?;
                Some(Test {
                    range,
                    inverse,
                    e: sum.e,
                })
            })
            .collect()
    }

    /// The range of the largest Δ.
    pub(super) fn best(&self, candidate: usize) -> Option<Found> {
        self.best_of(candidate, &self.ranges(candidate))
    }

    fn best_of(&self, candidate: usize, ranges: &[Range]) -> Option<Found> {
        let mut best: Option<Found> = None;
        for &range in ranges {
            let sum = self.sum(candidate, range);
            let Some(inverse) = self.inverse(candidate, &sum) else {
                continue;
            };
            let step = &inverse * &sum.u;
            let gain = sum.u.dot(&step);
            if gain.is_finite() && best.as_ref().is_none_or(|b| gain > b.gain) {
                best = Some(Found {
                    range,
                    gain,
                    jump: step.iter().map(|x| -x).collect(),
                    variance: inverse.diagonal().iter().copied().collect(),
                });
            }
        }
        best
    }

    /// The best range whose borders lie within a bin of those of a range in a coarser design.
    pub(super) fn best_near(&self, candidate: usize, coarse: &Self, range: Range) -> Option<Found> {
        let last = coarse.edges.len() - 1;
        let near = |edge: usize, of: usize| {
            let from = coarse.edges[of.saturating_sub(1)];
            let to = coarse.edges[(of + 1).min(last)];
            (from..=to).contains(&self.edges[edge])
        };
        let all = self.ranges(candidate).into_iter();
        let close = |r: &Range| near(r.first, range.first) && near(r.end, range.end);
        self.best_of(candidate, &all.filter(close).collect::<Vec<_>>())
    }

    /// Samples within a bin of the borders of a range, among `samples`, and the edges.
    pub(super) fn finer(&self, range: Range, samples: &[usize]) -> Vec<usize> {
        let last = self.edges.len() - 1;
        let mut out = self.edges[..last].to_vec();
        for of in [range.first, range.end] {
            let (from, to) = (
                self.edges[of.saturating_sub(1)],
                self.edges[(of + 1).min(last)],
            );
            out.extend(samples.iter().filter(|s| (from..to).contains(*s)));
        }
        out
    }
}

pub(super) fn score(rows: f64, cost: f64, gain: f64) -> f64 {
    /// A change may not explain everything: exact data have no noise to compare with.
    const LEFT: f64 = 1e-12;
    rows * (cost / (cost - gain).max(cost * LEFT).max(f64::MIN_POSITIVE)).ln()
}
