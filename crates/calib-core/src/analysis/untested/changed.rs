//! A change while recording that a scan found and that the model does not have, as a cause of wrong predictions.
//!
//! ```text
//! b = Σ_s f_s AᵀB̃,   c = ĉ ± σ of the scan,   f_s: 1 after the change, 0 before                           (1)
//! ```
//!
//! b takes the place of equation (1) of `untested`, c that of its (2). How the components of c go together (a body with two markers may turn about
//! the line through them) the fitted samples say, (Σ f² B̃ᵀB̃ − bᵀCb + P)⁻¹ scaled to the σ of the scan. Whether a held-out recording lies after the change its own errors say:
//!
//! ```text
//! Σ |w + A δ + B̃ ĉ|² < Σ |w + A δ|²,   δ = −C b ĉ of the fitted samples                                  (2)
//! ```

use std::collections::BTreeMap;
use std::ops::Range;

use nalgebra::{DMatrix, DVector, Vector3};

use super::displacement::add_motion;
use super::{Common, Direction, MovedPoint};
use crate::analysis::change::columns::{Candidates, Pattern};
use crate::analysis::change::contest::holds;
use crate::analysis::change::{Change, Moved};
use crate::analysis::solution::Solution;
use crate::graph::ids::EdgeId;
use crate::solve::equations::Workspace;
use crate::solve::whitened::Whitened;

/// A drift that goes on for as long as the recordings took has this at its end, in units of its whole.
const END: f64 = 0.5;

/// The change, with its sums.
pub(super) struct Changed<'a> {
    change: &'a Change,
    carries: bool,
    candidates: Candidates,
    /// Its columns among those of all candidates.
    columns: Range<usize>,
    pattern: Pattern,
    /// f of equation (1) of the fitted samples.
    holds: Vec<f64>,
    /// f where the robot is used.
    used: f64,
    /// P of the scan.
    prior: f64,
    /// Σ f² B̃ᵀB̃ of the fitted samples.
    own: DMatrix<f64>,
    /// b of equation (1) of the fitted samples.
    b: DMatrix<f64>,
    /// By the first sample of a held-out recording.
    held_out: BTreeMap<usize, HeldOut>,
}

/// Sums of a held-out recording, as if it lay after the change.
struct HeldOut {
    /// Σ AᵀB̃.
    b: DMatrix<f64>,
    /// Σ B̃ᵀw.
    along: DVector<f64>,
    /// Σ B̃ᵀB̃.
    own: DMatrix<f64>,
}

impl<'a> Changed<'a> {
    /// `None` where nothing that was fitted sees what changed.
    pub(super) fn new(solution: &Solution, change: &'a Change, carries: bool) -> Option<Self> {
        let candidates = Candidates::new(solution);
        let place = candidates
            .list
            .iter()
            .position(|c| c.moved == change.moved)?;
        let own = &candidates.list[place];
        let (columns, pattern) = (own.columns.clone(), own.pattern);
        let problem = &solution.model.problem;
        let fitted = solution.used_samples();
        let holds = holds(change, pattern, &problem.borders, &fitted, problem.samples);
        let used = match pattern {
            Pattern::Linear | Pattern::Settling => END,
            Pattern::Constant => 1.0,
            // A change that holds from the first sample on was undone later.
            Pattern::Step => {
                let undone = change.first == 0 && fitted.iter().any(|s| holds[*s] == 0.0);
                f64::from(u8::from(!undone))
            }
        };
        Some(Self {
            change,
            carries,
            b: DMatrix::zeros(solution.model.free(), columns.len()),
            own: DMatrix::zeros(columns.len(), columns.len()),
            prior: candidates.prior(place),
            candidates,
            columns,
            pattern,
            holds,
            used,
            held_out: BTreeMap::new(),
        })
    }

    /// Adds a sample, which stands for `factor`.
    pub(super) fn add(
        &mut self,
        solution: &Solution,
        (sample, s): (usize, &Whitened),
        factor: f64,
        work: &Workspace,
    ) {
        let held_out = solution.model.is_held_out(sample);
        if !held_out && self.holds[sample] == 0.0 {
            return;
        }
        let all = self.candidates.whitened(solution, sample, s, work);
        let own = all.columns_range(self.columns.clone()).into_owned();
        if !held_out {
            let holds = self.holds[sample];
            s.a.add_transposed_times(factor * holds, &own, &mut self.b);
            self.own.gemm_tr(factor * holds * holds, &own, &own, 1.0);
            return;
        }
        let (n, k) = self.b.shape();
        let borders = &solution.model.problem.borders;
        let first = borders
            .iter()
            .rfind(|b| **b <= sample)
            .copied()
            .unwrap_or(0);
        let sums = self.held_out.entry(first).or_insert_with(|| HeldOut {
            b: DMatrix::zeros(n, k),
            along: DVector::zeros(k),
            own: DMatrix::zeros(k, k),
        });
        s.a.add_transposed_times(factor, &own, &mut sums.b);
        sums.along.gemv_tr(factor, &own, &s.w, 1.0);
        sums.own.gemm_tr(factor, &own, &own, 1.0);
    }

    /// The jump that was found, and the independent directions that it is uncertain in.
    pub(super) fn directions(&self, common: &Common, postures: &[MovedPoint]) -> Vec<Direction> {
        let jump = DVector::from_column_slice(&self.change.jump);
        let step = -(&common.fitted * (&self.b * &jump));
        let mut b = self.b.clone();
        for sums in self.held_out.values() {
            b += &sums.b * self.held_out_after(sums, &jump, &step);
        }
        let displaced = |c: &DVector<f64>| {
            let at = |p: &MovedPoint| -> Vector3<f64> {
                let parts = c.iter().enumerate();
                parts
                    .map(|(i, c)| self.displacement(i, p) * (c * self.used))
                    .sum()
            };
            let mut out = -(&common.moved * (&b * c));
            add_motion(&mut out.column_mut(0), postures.iter().map(at));
            out
        };
        let half = self.half_covariance(common);
        let jumps = std::iter::once((jump.clone(), (1.0, 0.0)));
        let open = half.column_iter().map(|c| (c.into_owned(), (0.0, 1.0)));
        let (parts, sizes): (Vec<DVector<f64>>, Vec<(f64, f64)>) = jumps.chain(open).unzip();
        let displaced: Vec<DVector<f64>> = parts.iter().map(displaced).collect();
        common.directions(DMatrix::from_columns(&displaced), sizes)
    }

    /// A square root of the covariance of c.
    fn half_covariance(&self, common: &Common) -> DMatrix<f64> {
        let k = self.change.sigma.len();
        let sigma = DMatrix::from_diagonal(&DVector::from_column_slice(&self.change.sigma));
        let mut information = &self.own - self.b.tr_mul(&(&common.fitted * &self.b));
        for i in 0..k {
            information[(i, i)] += self.prior;
        }
        let Some(covariance) = information.cholesky().map(|c| c.inverse()) else {
            return sigma;
        };
        let scale = |i: usize| covariance[(i, i)].sqrt();
        let correlation = DMatrix::from_fn(k, k, |i, j| covariance[(i, j)] / scale(i) / scale(j));
        correlation
            .cholesky()
            .map_or_else(|| sigma.clone(), |c| &sigma * c.l())
    }

    /// f of a held-out recording, by equation (2).
    fn held_out_after(&self, sums: &HeldOut, jump: &DVector<f64>, step: &DVector<f64>) -> f64 {
        let residuals = &sums.along + sums.b.tr_mul(step);
        let more = 2.0 * jump.dot(&residuals) + jump.dot(&(&sums.own * jump));
        match self.pattern {
            Pattern::Linear | Pattern::Settling => END,
            Pattern::Constant => 1.0,
            Pattern::Step => f64::from(u8::from(more < 0.0)),
        }
    }

    /// Displacement of the point per unit of a component of the jump, m.
    fn displacement(&self, component: usize, posture: &MovedPoint) -> Vector3<f64> {
        let axis = Vector3::ith(component % 3, 1.0);
        let turns = component < 3;
        let by = |edge: &EdgeId| posture.by.get(edge).copied().unwrap_or_default();
        match self.change.moved {
            Moved::Body(_) if !self.carries => Vector3::zeros(),
            Moved::Body(frame) if turns => {
                let lever = posture.place - self.candidates.body_middle(frame);
                posture.turn * axis.cross(&lever)
            }
            Moved::Body(_) => posture.turn * axis,
            Moved::Reference(frame) | Moved::Drift(frame) | Moved::Settling(frame) => {
                let lever = posture.point.position.coords - self.candidates.middle(frame);
                if turns { axis.cross(&lever) } else { axis }
            }
            Moved::Joint(_) | Moved::Zeros => by(&self.change.joints[component]),
            Moved::Scale(_) => posture.point.position.coords,
        }
    }
}
