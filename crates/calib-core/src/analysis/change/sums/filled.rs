//! The sums of a design, filled from its samples on all cores.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::{Design, Kept, SIMULATED, Sum};
use crate::analysis::change::columns::{Candidates, Pattern};
use crate::analysis::solution::Solution;
use crate::solve::equations::{NormalEquations, Workspace};
use crate::solve::normal::add_prior;
use crate::solve::whitened::root_of;

/// Samples that are looked at one after the other, and those whose products are held at once: the same bits for any number of cores.
const TOGETHER: usize = 16;
const AT_ONCE: usize = 4 * TOGETHER;

/// What one sample adds.
struct Seen {
    /// Its number among the samples.
    place: usize,
    /// ÃᵀB̃, n × columns.
    ab: DMatrix<f64>,
    /// B̃ᵀw.
    bw: DVector<f64>,
    /// B̃ᵀB̃ of each candidate.
    bb: Vec<DMatrix<f64>>,
    cost: f64,
    rows: f64,
    log_det: f64,
    kept: Option<Kept>,
}

/// What some samples add.
struct Together {
    h: DMatrix<f64>,
    g: DVector<f64>,
    seen: Vec<Seen>,
}

impl Design {
    pub(super) fn fill(
        &mut self,
        solution: &Solution,
        candidates: &Candidates,
        samples: &[usize],
    ) -> Option<()> {
        // Few enough to be simulated.
        let keep = samples.len() <= SIMULATED + self.parts.len();
        let model = &solution.model;
        let n = model.free();
        let mut work = Workspace::new(model);
        work.cache.update(&model.problem, &solution.values);
        let mut h = DMatrix::zeros(n, n);
        let mut g = DVector::zeros(n);
        let sizes: Vec<usize> = self.columns.iter().map(ExactSizeIterator::len).collect();
        // E in place of Rᵀ E as long as C is not known.
        let mut sums: Vec<Sum> = sizes.iter().map(|d| Sum::zeros(n, *d)).collect();
        let mut us: Vec<DVector<f64>> = sizes.iter().map(|d| DVector::zeros(*d)).collect();
        self.cumulative = vec![Vec::new(); sizes.len()];
        let mut u_at: Vec<Vec<DVector<f64>>> = vec![Vec::new(); sizes.len()];
        let mut bin = 0;
        for (first, some) in (0..).step_by(AT_ONCE).zip(samples.chunks(AT_ONCE)) {
            let pieces = some.par_chunks(TOGETHER).enumerate();
            let all: Vec<Together> = pieces
                .map(|(piece, samples)| {
                    let first = first + piece * TOGETHER;
                    self.together(solution, candidates, (first, samples), &work, keep)
                })
                .collect();
            let mut seen = Vec::with_capacity(some.len());
            for together in all {
                h += together.h;
                g += together.g;
                seen.extend(together.seen);
            }
            let mut seen = seen.into_iter().peekable();
            for (place, &sample) in (first..).zip(some) {
                while bin < self.edges.len() && self.edges[bin] <= sample {
                    self.close(bin, &sums, (&us, &mut u_at));
                    bin += 1;
                }
                if let Some(seen) = seen.next_if(|seen| seen.place == place) {
                    self.add(seen, samples.len(), &mut sums, &mut us);
                }
            }
        }
        for (k, (sum, u)) in sums.into_iter().zip(us).enumerate() {
            self.cumulative[k].push(sum);
            u_at[k].push(u);
        }
        self.u = u_at.iter().map(|u| DMatrix::from_columns(u)).collect();
        self.solve(solution, &h, &g)
    }

    /// The products of some samples, the first of which has this place.
    fn together(
        &self,
        solution: &Solution,
        candidates: &Candidates,
        (first, samples): (usize, &[usize]),
        work: &Workspace,
        keep: bool,
    ) -> Together {
        let n = solution.model.free();
        let mut work = work.clone();
        let mut out = Together {
            h: DMatrix::zeros(n, n),
            g: DVector::zeros(n),
            seen: Vec::with_capacity(samples.len()),
        };
        for (place, &sample) in (first..).zip(samples) {
            let Some(rows) = solution.rows_of(sample, &mut work) else {
                continue;
            };
            let b = candidates.whitened(solution, sample, &rows, &work);
            rows.a.add_gram(1.0, &mut out.h);
            rows.a.add_transposed_vector(&rows.w, &mut out.g);
            let own = self.columns.iter().map(|columns| {
                let b = b.columns_range(columns.clone());
                b.tr_mul(&b)
            });
            let bb = own.collect();
            let (ab, bw) = (rows.a.transposed_times(&b), b.tr_mul(&rows.w));
            out.seen.push(Seen {
                place,
                ab,
                bw,
                bb,
                cost: rows.w.norm_squared(),
                rows: rows.w.len() as f64,
                log_det: rows.log_det,
                kept: keep.then(|| Kept {
                    b: b.transpose(),
                    rows,
                }),
            });
        }
        out
    }

    /// Stores the sums up to an edge.
    fn close(
        &mut self,
        edge: usize,
        sums: &[Sum],
        (us, u_at): (&[DVector<f64>], &mut [Vec<DVector<f64>>]),
    ) {
        for (k, (sum, u)) in sums.iter().zip(us).enumerate() {
            if self.patterns[k] == Pattern::Step || edge == 0 {
                self.cumulative[k].push(sum.clone());
                u_at[k].push(u.clone());
            }
        }
    }

    /// Adds one sample of so many.
    fn add(&mut self, seen: Seen, samples: usize, sums: &mut [Sum], us: &mut [DVector<f64>]) {
        self.cost += seen.cost;
        self.rows += seen.rows;
        self.log_det += seen.log_det;
        for (k, bb) in seen.bb.iter().enumerate() {
            let columns = &self.columns[k];
            let factor = self.factor(k, seen.place, samples);
            us[k].axpy(factor, &seen.bw.rows_range(columns.clone()), 1.0);
            let ab = seen.ab.columns_range(columns.clone());
            sums[k].f.zip_apply(&ab, |sum, x| *sum += factor * x);
            sums[k]
                .g
                .zip_apply(bb, |sum, x| *sum += factor * factor * x);
        }
        self.kept.extend(seen.kept);
    }

    /// What a candidate's columns are multiplied by at a sample.
    pub(in crate::analysis::change) fn factor(
        &self,
        candidate: usize,
        place: usize,
        samples: usize,
    ) -> f64 {
        self.patterns[candidate].factor(place, samples)
    }

    /// C of the samples, F at their own minimum, and U there: one Gauss–Newton step from the fit, which is zero where
    /// the samples are those of the fit.
    fn solve(&mut self, solution: &Solution, h: &DMatrix<f64>, g: &DVector<f64>) -> Option<()> {
        let model = &solution.model;
        let mut system = NormalEquations::of(h, g);
        add_prior(model, &solution.values, &mut system);
        let system = solution.held(system);
        self.root = root_of(&system)?.transpose();
        // δ = −R a,   a = Rᵀ g,   U ← U + Eᵀ δ,   F ← F − gᵀ C g
        let root = &self.root;
        let along = root * DVector::from_row_slice(&system.g);
        self.cost += system.prior - along.norm_squared();
        let of_candidates = self.cumulative.par_iter_mut().zip(&mut self.u);
        of_candidates.for_each(|(sums, us)| {
            times(root, sums);
            for (sum, mut u) in sums.iter().zip(us.column_iter_mut()) {
                u -= sum.f.tr_mul(&along);
            }
        });
        self.along = along;
        for (c, &p) in model.columns.iter().enumerate() {
            if let Some(sigma) = model.problem.parameters[p].prior_sigma {
                self.priors.push((c, 1.0 / sigma));
            }
        }
        (self.cost.is_finite() && self.rows > 0.0).then_some(())
    }
}

/// f ← Rᵀ f of all sums of a candidate, as one product over the rows that it has: what a limb moves concerns no other.
fn times(root: &DMatrix<f64>, sums: &mut [Sum]) {
    let Some(first) = sums.first() else { return };
    let (n, d) = first.f.shape();
    let concerns = |r: &usize| {
        sums.iter()
            .any(|sum| sum.f.row(*r).iter().any(|x| *x != 0.0))
    };
    let rows: Vec<usize> = (0..n).filter(concerns).collect();
    let mut all = DMatrix::zeros(rows.len(), d * sums.len());
    for (k, sum) in sums.iter().enumerate() {
        for c in 0..d {
            for (i, &r) in rows.iter().enumerate() {
                all[(i, d * k + c)] = sum.f[(r, c)];
            }
        }
    }
    let product = match rows.len() == n {
        true => root * all,
        false => root.select_columns(&rows) * all,
    };
    for (k, sum) in sums.iter_mut().enumerate() {
        sum.f.copy_from(&product.columns(d * k, d));
    }
}
