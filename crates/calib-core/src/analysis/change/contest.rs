//! Causes of errors beside each other: what does one explain that others do not?
//!
//! Effects, and changes at the samples where they were found, as columns B of the linearized fit, all at once:
//!
//! ```text
//! U = Σ_s B̃ᵀ w,   E = Σ_s Aᵀ B̃,   I = Σ_s B̃ᵀB̃ − Eᵀ C E + P,   B̃ = L⁻¹B                      (1)
//! Δ(M) = U_Mᵀ I_MM⁺ U_M                                        what a set of causes explains together   (2)
//! T(k | M) = N ln((F − Δ(M)) / (F − Δ(M ∪ k)))                 what k explains beside M                 (3)
//! ```
//!
//! C, F, N and P as in the scan for changes. A step of a body, backlash in a sweep and an eccentric gear look alike alone; beside
//! each other, those that are not there explain nothing.

use std::ops::Range;

use calib_geometry::decompose::symmetric_eigen;
use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use super::columns::{Candidates, Pattern};
use super::{Change, ChangeScan};
use crate::analysis::goodness::Candidate;
use crate::analysis::solution::Solution;
use crate::graph::effect::EffectKind;
use crate::graph::ids::EdgeId;
use crate::solve::equations::{NormalEquations, Workspace};
use crate::solve::normal::add_prior;
use crate::solve::whitened::{Whitened, covariance_of};

/// A direction with less than this share of its own information is one that the parameters, or other causes, imitate.
const IMITATED: f64 = 1e-6;

/// A cause that may explain errors.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Suspect<'a> {
    /// An effect that [`Solution::goodness_of_fit`] tested, by its name.
    Tested(&'a str),
    /// An effect of a joint, or of several together, with the regressor of each in every sample.
    Effect {
        /// Which.
        kind: EffectKind,
        /// The joints, and the regressor of each.
        joints: Vec<(EdgeId, Vec<f64>)>,
    },
    /// A change that a scan found.
    Change(&'a Change),
}

/// Suspects beside each other, by their numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct Contest {
    columns: Vec<Range<usize>>,
    u: DVector<f64>,
    information: DMatrix<f64>,
    /// Diagonal of Σ B̃ᵀB̃.
    raw: Vec<f64>,
    /// F and N.
    cost: f64,
    rows: f64,
    /// Degrees of freedom beside the parameters of the fit.
    freedom: f64,
}

impl Contest {
    /// Equation (2) over F.
    #[must_use]
    pub fn explains(&self, together: &[usize]) -> f64 {
        self.gain(together).0 / self.cost
    }

    /// Equation (3), and how many directions of `one` it tests; none where the parameters or the others imitate it.
    #[must_use]
    pub fn score(&self, one: usize, beside: &[usize]) -> (f64, usize) {
        let (less, rank) = self.gain(beside);
        let all: Vec<usize> = beside.iter().copied().chain([one]).collect();
        let (more, full) = self.gain(&all);
        let left = |gain: f64| (self.cost - gain).max(f64::MIN_POSITIVE);
        let score = self.rows * (left(less) / left(more)).ln();
        (score.max(0.0), full.saturating_sub(rank))
    }

    /// The coefficient of a cause of one column, alone: one step towards the better model, as of the tests. NaN where nothing is known of it.
    #[must_use]
    pub fn estimate(&self, one: usize) -> f64 {
        let column = self.columns[one].start;
        -self.u[column] / self.information[(column, column)]
    }

    /// T of equation (3) that chance exceeds with this probability where a cause of `directions` columns is absent.
    #[must_use]
    pub fn threshold(&self, probability: f64, directions: usize) -> f64 {
        let directions = directions.max(1) as f64;
        let f = FisherSnedecor::new(directions, self.freedom);
        let f = f.map_or(f64::INFINITY, |f| f.inverse_cdf(1.0 - probability));
        self.rows * (directions * f / self.freedom).ln_1p()
    }

    /// Equation (2), and the rank of I.
    fn gain(&self, of: &[usize]) -> (f64, usize) {
        let own: Vec<usize> = of.iter().flat_map(|k| self.columns[*k].clone()).collect();
        let scale: Vec<f64> = own
            .iter()
            .map(|&c| match self.raw[c] {
                raw if raw > 0.0 => 1.0 / raw.sqrt(),
                _ => 0.0,
            })
            .collect();
        let k = own.len();
        if k == 0 {
            return (0.0, 0);
        }
        let scaled = DMatrix::from_fn(k, k, |i, j| {
            self.information[(own[i], own[j])] * scale[i] * scale[j]
        });
        if scaled.iter().any(|x| !x.is_finite()) {
            return (0.0, 0);
        }
        let u = DVector::from_fn(k, |i, _| self.u[own[i]] * scale[i]);
        let eigen = symmetric_eigen(&scaled);
        let mut gain = 0.0;
        let mut rank = 0;
        for i in (0..k).filter(|i| eigen.values[*i] > IMITATED) {
            gain += eigen.vectors.column(i).dot(&u).powi(2) / eigen.values[i];
            rank += 1;
        }
        (gain.min(self.cost), rank)
    }
}

/// The columns of a suspect.
pub(super) enum Columns {
    /// Its number among the effects.
    Effect(usize),
    /// Columns among those of all changes, by how much it holds in each sample.
    Change(Range<usize>, Vec<f64>),
}

impl Solution {
    /// Sets suspects beside each other, at the observations that `scan` looked at. `borders`: the first sample of every recording but
    /// the first. `None` where the model cannot be evaluated or a suspect is not known.
    #[must_use]
    pub fn contest(
        &self,
        suspects: &[Suspect<'_>],
        scan: Option<&ChangeScan>,
        borders: &[usize],
    ) -> Option<Contest> {
        let all = scan
            .filter(|scan| scan.with_rejected)
            .map(|_| self.with_all());
        let at = all.as_ref().unwrap_or(self);
        let changes = Candidates::new(at);
        let (effects, columns) = at.columns_of(suspects, &changes, &self.candidates(), borders)?;
        at.summed(&changes, &effects, &columns)
    }

    /// The columns of suspects; `tested`: the effects that suspects name.
    pub(super) fn columns_of(
        &self,
        suspects: &[Suspect<'_>],
        changes: &Candidates,
        tested: &[Candidate],
        borders: &[usize],
    ) -> Option<(Vec<Candidate>, Vec<Columns>)> {
        let used = self.used_samples();
        let mut effects: Vec<Candidate> = Vec::new();
        let mut columns = Vec::new();
        for suspect in suspects {
            columns.push(match suspect {
                Suspect::Change(change) => {
                    let own = changes.list.iter().position(|c| c.moved == change.moved)?;
                    let own = &changes.list[own];
                    let samples = self.model.problem.samples;
                    let holds = holds(change, own.pattern, borders, &used, samples);
                    Columns::Change(own.columns.clone(), holds)
                }
                Suspect::Tested(name) => {
                    effects.push(tested.iter().find(|c| c.is_called(name))?.clone());
                    Columns::Effect(effects.len() - 1)
                }
                Suspect::Effect { kind, joints } => {
                    effects.push(Candidate::of_joints(*kind, joints.clone()));
                    Columns::Effect(effects.len() - 1)
                }
            });
        }
        Some((effects, columns))
    }

    /// The same solution with the observations that were rejected.
    fn with_all(&self) -> Self {
        let mut out = self.clone();
        for (o, observation) in self.model.observations.iter().enumerate() {
            if !self.model.is_held_out(observation.sample) {
                out.weights[o] = 1.0;
            }
        }
        out
    }

    /// Equation (1), at the minimum of the observations: one Gauss–Newton step from the fit.
    fn summed(
        &self,
        changes: &Candidates,
        effects: &[Candidate],
        columns: &[Columns],
    ) -> Option<Contest> {
        let model = &self.model;
        let n = model.free();
        let ranges = side_by_side(columns);
        let width = ranges.last().map_or(0, |r| r.end);
        let (mut h, mut g) = (DMatrix::zeros(n, n), DVector::zeros(n));
        let mut e = DMatrix::zeros(n, width);
        let (mut own, mut u) = (DMatrix::zeros(width, width), DVector::zeros(width));
        let (mut cost, mut rows) = (0.0, 0.0);
        let mut work = Workspace::new(model);
        work.cache.update(&model.problem, &self.values);
        let samples = self.looked_at().samples;
        for seen in self.seen(effects, &samples) {
            let (s, at) = (&seen.rows, (seen.sample, &*seen.rows, &seen.columns));
            let b = self.columns_at(changes, columns, &ranges, at, &work);
            s.a.add_gram(1.0, &mut h);
            s.a.add_transposed_vector(&s.w, &mut g);
            s.a.add_transposed_times(1.0, &b, &mut e);
            own.gemm(1.0, &b.transpose(), &b, 1.0);
            u += b.tr_mul(&s.w);
            cost += s.w.norm_squared();
            rows += s.w.len() as f64;
        }
        let mut system = NormalEquations::of(&h, &g);
        add_prior(model, &self.values, &mut system);
        let parameters = model.columns.iter().map(|p| &model.problem.parameters[*p]);
        let priors = parameters.filter(|p| p.prior_sigma.is_some()).count();
        let system = self.held(system);
        let c = covariance_of(&system)?;
        let gradient = DVector::from_column_slice(&system.g);
        let step = -(&c * &gradient);
        cost += system.prior + gradient.dot(&step);
        u += e.tr_mul(&step);
        let raw: Vec<f64> = own.diagonal().iter().copied().collect();
        let mut information = own - e.tr_mul(&(&c * &e));
        add_priors(&mut information, changes, columns, &ranges)?;
        (cost.is_finite() && cost > 0.0 && rows > 0.0).then_some(Contest {
            columns: ranges,
            u,
            information,
            raw,
            cost,
            rows,
            freedom: (rows + priors as f64 - n as f64).max(1.0),
        })
    }

    /// B̃ of one sample.
    pub(super) fn columns_at(
        &self,
        changes: &Candidates,
        columns: &[Columns],
        ranges: &[Range<usize>],
        (sample, rows, effects): (usize, &Whitened, &DMatrix<f64>),
        work: &Workspace,
    ) -> DMatrix<f64> {
        let width = ranges.last().map_or(0, |r| r.end);
        let mut out = DMatrix::zeros(rows.w.len(), width);
        let mut moved: Option<DMatrix<f64>> = None;
        for (range, own) in ranges.iter().zip(columns) {
            match own {
                Columns::Effect(k) => out.column_mut(range.start).copy_from(&effects.column(*k)),
                Columns::Change(of, holds) if holds[sample] != 0.0 => {
                    let all =
                        moved.get_or_insert_with(|| changes.whitened(self, sample, rows, work));
                    let part = all.columns_range(of.clone()) * holds[sample];
                    out.columns_range_mut(range.clone()).copy_from(&part);
                }
                Columns::Change(..) => {}
            }
        }
        out
    }
}

/// The places of columns side by side.
pub(super) fn side_by_side(columns: &[Columns]) -> Vec<Range<usize>> {
    let mut ranges: Vec<Range<usize>> = Vec::new();
    for own in columns {
        let first = ranges.last().map_or(0, |r| r.end);
        let count = match own {
            Columns::Effect(_) => 1,
            Columns::Change(of, _) => of.len(),
        };
        ranges.push(first..first + count);
    }
    ranges
}

/// P of equation (1): what is known of the size of changes.
pub(super) fn add_priors(
    information: &mut DMatrix<f64>,
    changes: &Candidates,
    columns: &[Columns],
    ranges: &[Range<usize>],
) -> Option<()> {
    for (range, of) in ranges.iter().zip(columns) {
        if let Columns::Change(own, _) = of {
            let place = changes.list.iter().position(|c| c.columns == *own)?;
            for i in range.clone() {
                information[(i, i)] += changes.prior(place);
            }
        }
    }
    Some(())
}

/// How much a change holds in each sample.
pub(crate) fn holds(
    change: &Change,
    pattern: Pattern,
    borders: &[usize],
    used: &[usize],
    samples: usize,
) -> Vec<f64> {
    let mut out = vec![0.0; samples];
    match pattern {
        Pattern::Constant => out.fill(1.0),
        Pattern::Linear | Pattern::Settling => {
            for (place, sample) in used.iter().enumerate() {
                out[*sample] = pattern.factor(place, used.len());
            }
        }
        Pattern::Step => {
            let end_of = |first: usize| {
                let next = borders.iter().filter(|b| **b > first).min();
                next.copied().unwrap_or(samples).min(samples)
            };
            out[change.first..change.end.min(samples)].fill(1.0);
            for &first in &change.also {
                out[first..end_of(first)].fill(1.0);
            }
        }
    }
    out
}
