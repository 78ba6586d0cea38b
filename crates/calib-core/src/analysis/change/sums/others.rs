//! Which other recordings lie behind a change.
//!
//! Every recording is behind it or before it. Of few recordings the one that helps most is moved to the other side, as long as that helps. Of many
//! that would cost the cube of their number: from the best few beginnings, one recording after the other is moved where that helps, until none does.

use nalgebra::{Cholesky, DMatrix, DVector};

use super::{After, Design, Found, Sum};
use crate::analysis::change::columns::Pattern;

/// Of more recordings than these, many.
const FEW: usize = 12;

/// Beginnings that are followed where recordings are many.
const BEGINNINGS: usize = 4;

/// Rounds over many recordings at most.
const ROUNDS: usize = 8;

/// Less gain than this part more is rounding.
const ROUNDING: f64 = 1e-9;

impl Design {
    /// The best of some changes, one of each recording, with other recordings moved to the other side where that helps.
    pub(super) fn beside_others(
        &self,
        candidate: usize,
        mut firsts: Vec<Found>,
        u: &DMatrix<f64>,
    ) -> Option<Found> {
        let many = self.parts.len() - 1 > FEW && self.patterns[candidate] == Pattern::Step;
        if many {
            firsts.sort_by(|a, b| b.gain.total_cmp(&a.gain));
            firsts.truncate(BEGINNINGS);
        }
        let extended = firsts.into_iter().filter_map(|first| match many {
            true => self.one_after_the_other(candidate, first, u),
            false => self.extended(candidate, first, u),
        });
        extended.max_by(|a, b| a.gain.total_cmp(&b.gain))
    }

    fn extended(&self, candidate: usize, mut best: Found, u: &DMatrix<f64>) -> Option<Found> {
        if self.patterns[candidate] != Pattern::Step {
            return Some(best);
        }
        loop {
            let toggled = (0..self.parts.len() - 1)
                .filter(|o| *o != best.after.part)
                .map(|o| {
                    let mut after = best.after.clone();
                    match after.others.iter().position(|x| *x == o) {
                        Some(at) => drop(after.others.remove(at)),
                        None => after.others.push(o),
                    }
                    after
                });
            let better = toggled
                .filter(|after| self.is_large_enough(after))
                .filter_map(|after| self.tested(candidate, &after, u))
                .max_by(|a, b| a.gain.total_cmp(&b.gain));
            match better {
                // More than rounding, so that the loop ends.
                Some(next) if next.gain > best.gain * (1.0 + ROUNDING) => best = next,
                _ => return Some(best),
            }
        }
    }

    fn one_after_the_other(
        &self,
        candidate: usize,
        first: Found,
        u: &DMatrix<f64>,
    ) -> Option<Found> {
        let sums = &self.cumulative[candidate];
        let count = self.parts.len() - 1;
        let samples = |o: usize| self.places[self.parts[o + 1]] - self.places[self.parts[o]];
        let own = &first.after;
        let mut behind = vec![false; count];
        own.others.iter().for_each(|o| behind[*o] = true);
        let others: usize = own.others.iter().map(|o| samples(*o)).sum();
        let mut inside = self.places[own.end] - self.places[own.first] + others;
        let mut sum = self.sum(candidate, own);
        let mut along = self.u_of(u, own);
        let mut gain = first.gain;
        for _ in 0..ROUNDS {
            let before = gain;
            for o in (0..count).filter(|o| *o != own.part) {
                let (mut from, mut to) = (self.parts[o], self.parts[o + 1]);
                let then = if behind[o] {
                    std::mem::swap(&mut from, &mut to);
                    inside - samples(o)
                } else {
                    inside + samples(o)
                };
                if !self.is_enough(then) {
                    continue;
                }
                let mut trial = sum.clone();
                trial.add_between(&sums[from], &sums[to]);
                let moved = &along + u.column(to) - u.column(from);
                let better = self.gain_of(candidate, &trial, &moved);
                if let Some(better) = better.filter(|g| *g > gain * (1.0 + ROUNDING)) {
                    (sum, along, gain, inside) = (trial, moved, better, then);
                    behind[o] = !behind[o];
                }
            }
            if gain <= before {
                break;
            }
        }
        let after = After {
            others: (0..count).filter(|o| behind[*o]).collect(),
            ..first.after
        };
        self.tested(candidate, &after, u)
    }

    /// Δ of equation (1).
    fn gain_of(&self, candidate: usize, sum: &Sum, u: &DVector<f64>) -> Option<f64> {
        let factor = Cholesky::new(self.information(candidate, sum))?;
        Some(u.dot(&factor.solve(u))).filter(|gain| gain.is_finite())
    }

    /// First and last edge of the other recordings of a set, neighbors together.
    pub(super) fn runs(&self, after: &After) -> Vec<(usize, usize)> {
        let mut out: Vec<(usize, usize)> = Vec::new();
        for o in &after.others {
            let (from, to) = (self.parts[*o], self.parts[o + 1]);
            match out.last_mut() {
                Some(run) if run.1 == from => run.1 = to,
                _ => out.push((from, to)),
            }
        }
        out
    }
}
