//! The regressor of an effect that depends on the direction of approach, where a recording does not tell it.
//!
//! Before its first motion a joint came from one side, the same throughout the recording. With the columns a₀ of the samples whose
//! direction is known and d_r of each start:
//!
//! ```text
//! a(s) = a₀ + Σ_r s_r d_r,   s_r = ±1:   the one of largest U(s)²/I(s)                              (1)
//! ```
//!
//! All 2^R of them count as tested (Bonferroni). Candidates are taken one after another, that of the largest score first, U and I of
//! the others beside those that were taken.

use nalgebra::{DMatrix, DVector};

use super::{Candidate, Effect, Physics};
use crate::analysis::solution::Solution;
use crate::graph::problem::StartChange;
use crate::solve::whitened::covariance_of;

/// Starts whose directions are tried; with more of them, those of most samples.
const MOST: usize = 8;

/// The starts of one candidate.
struct Open {
    candidate: usize,
    /// What each direction adds to the regressor.
    starts: Vec<Vec<f64>>,
    /// Its first column.
    first: usize,
    /// Physics allows no coefficient below 0.
    nonnegative: bool,
}

impl Open {
    /// The directions of largest U²/I, as bits, and that.
    fn best(&self, u: &DVector<f64>, information: &DMatrix<f64>) -> (usize, f64) {
        let count = self.starts.len();
        let gain = |signs: usize| {
            let factor = |i: usize| if i == 0 { 1.0 } else { sign(signs, i - 1) };
            let (mut score, mut square) = (0.0, 0.0);
            for i in 0..=count {
                score += factor(i) * u[self.first + i];
                for j in 0..=count {
                    let own = information[(self.first + i, self.first + j)];
                    square += factor(i) * factor(j) * own;
                }
            }
            // −U/I is the estimate.
            let possible = !(self.nonnegative && score > 0.0);
            let both = possible && square > 0.0;
            if both { score * score / square } else { 0.0 }
        };
        let all = (0..1_usize << count).map(|signs| (signs, gain(signs)));
        let best = all.max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0)));
        best.unwrap_or((0, 0.0))
    }
}

/// Direction of a start, of directions as bits.
fn sign(signs: usize, start: usize) -> f64 {
    if (signs >> start) & 1 == 1 { -1.0 } else { 1.0 }
}

impl Solution {
    /// Gives each candidate with open starts the regressor of equation (1).
    pub(super) fn choose_directions(&self, candidates: &mut [Candidate]) {
        let mut columns: Vec<Candidate> = Vec::new();
        let mut open: Vec<Open> = Vec::new();
        for (k, candidate) in candidates.iter().enumerate() {
            let starts = self.starts_of(candidate);
            if starts.is_empty() {
                continue;
            }
            let first = columns.len();
            columns.push(candidate.clone());
            columns.extend(starts.iter().filter_map(|by| candidate.with(by.clone())));
            open.push(Open {
                candidate: k,
                starts,
                first,
                nonnegative: candidate.is_nonnegative(),
            });
        }
        if open.is_empty() {
            return;
        }
        let Some((mut u, mut information)) = self.between(&columns) else {
            return;
        };
        // The one that stands out most first, the others beside it: backlash of one joint would turn the sides of the next.
        while !open.is_empty() {
            let best = open.iter().map(|o| o.best(&u, &information)).enumerate();
            let Some((k, (signs, _))) = best.max_by(|a, b| a.1.1.total_cmp(&b.1.1)) else {
                break;
            };
            let chosen = open.swap_remove(k);
            let candidate = &mut candidates[chosen.candidate];
            candidate.tries = (1_usize << chosen.starts.len()) as f64;
            for (r, by) in chosen.starts.iter().enumerate() {
                candidate.add(sign(signs, r), by);
            }
            let mut own = DVector::zeros(u.len());
            own[chosen.first] = 1.0;
            for r in 0..chosen.starts.len() {
                own[chosen.first + 1 + r] = sign(signs, r);
            }
            let along = &information * &own;
            let square = own.dot(&along);
            if square > 0.0 {
                u -= &along * (own.dot(&u) / square);
                information -= &along * along.transpose() / square;
            }
        }
    }

    /// What the directions of a candidate's starts in fitted recordings add to its regressor.
    fn starts_of(&self, candidate: &Candidate) -> Vec<Vec<f64>> {
        let model = &self.model;
        let (Effect::Joints(parts), Physics::Effect(kind)) = (&candidate.effect, candidate.physics)
        else {
            return Vec::new();
        };
        let [(edge, _, _)] = parts.as_slice() else {
            return Vec::new();
        };
        let mut found: Vec<Vec<f64>> = Vec::new();
        let starts = model.problem.open_starts().iter();
        let fitted = |samples: &[usize]| samples.iter().any(|s| !model.is_held_out(*s));
        let mut starts: Vec<_> = starts
            .filter(|start| start.joint.index() == *edge && fitted(&start.samples))
            .collect();
        starts.sort_by_key(|start| std::cmp::Reverse(start.samples.len()));
        for start in starts.into_iter().take(MOST) {
            let own = |change: &&StartChange| change.kind == kind;
            if let Some(change) = start.changes.iter().find(own) {
                let mut values = vec![0.0; model.problem.samples];
                for (sample, by) in start.samples.iter().zip(&change.by) {
                    values[*sample] = *by;
                }
                found.push(values);
            }
        }
        found
    }

    /// U and I of columns side by side, of the samples that the tests look at: what another side would change in the others is tested
    /// nowhere.
    fn between(&self, columns: &[Candidate]) -> Option<(DVector<f64>, DMatrix<f64>)> {
        let model = &self.model;
        let (n, count) = (model.free(), columns.len());
        let mut u = DVector::zeros(count);
        let mut raw = DMatrix::zeros(count, count);
        let mut b = DMatrix::zeros(n, count);
        let (mut h, mut g) = (DMatrix::zeros(n, n), DVector::zeros(n));
        let looked_at = self.looked_at();
        self.each_sample(columns, &looked_at.samples, |s, alpha| {
            let transposed = alpha.transpose();
            u += &transposed * &s.w;
            raw.gemm(1.0, &transposed, alpha, 1.0);
            s.a.add_transposed_times(1.0, alpha, &mut b);
            if !looked_at.all {
                s.a.add_gram(1.0, &mut h);
                s.a.add_transposed_vector(&s.w, &mut g);
            }
        });
        let c = if looked_at.all {
            covariance_of(&self.held_curvature())?
        } else {
            let (c, step) = self.to_own_minimum(&h, &g)?;
            u.gemv_tr(1.0, &b, &step, 1.0);
            c
        };
        let information = raw - b.tr_mul(&(&c * &b));
        Some((u, information))
    }
}

impl Candidate {
    fn is_nonnegative(&self) -> bool {
        matches!(self.physics, Physics::Effect(kind) if kind.effect().nonnegative)
    }

    /// The same with another regressor.
    fn with(&self, values: Vec<f64>) -> Option<Self> {
        let mut out = self.clone();
        match &mut out.effect {
            Effect::Joints(parts) => parts.first_mut()?.2 = values,
            Effect::Drift(..) | Effect::Place(_) => return None,
        }
        Some(out)
    }

    /// Adds to the regressor.
    fn add(&mut self, sign: f64, by: &[f64]) {
        if let Effect::Joints(parts) = &mut self.effect
            && let Some((_, _, values)) = parts.first_mut()
        {
            for (value, by) in values.iter_mut().zip(by) {
                *value += sign * by;
            }
        }
    }
}
