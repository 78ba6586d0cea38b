//! In which order postures are taken: a short way in joint time, with motions that touch nothing.

use crate::candidates::Feasible;
use crate::joints::JointBox;

/// Seconds that a motion which would touch something costs in the search for a short way.
const BLOCKED: f64 = 1e3;
/// Sweeps of exchanges at the most.
const SWEEPS: usize = 30;

/// Motions between postures: their times, and which are blocked.
pub struct Ways {
    cost: Vec<f64>,
    n: usize,
}

impl Ways {
    /// Between all pairs of some postures.
    #[must_use]
    pub fn new(feasible: &Feasible<'_>, joints: &JointBox, postures: &[&[f64]]) -> Self {
        use rayon::prelude::*;
        let n = postures.len();
        let of = |at: usize| {
            let (i, j) = (at / n, at % n);
            if j <= i {
                return 0.0;
            }
            let time = joints.time(postures[i], postures[j]);
            let clear = feasible.clear(postures[i], postures[j]);
            if clear { time } else { time + BLOCKED }
        };
        let upper: Vec<f64> = (0..n * n).into_par_iter().map(of).collect();
        let cost = (0..n * n).map(|at| {
            let (i, j) = (at / n, at % n);
            upper[i.min(j) * n + i.max(j)]
        });
        Self {
            cost: cost.collect(),
            n,
        }
    }

    fn cost(&self, i: usize, j: usize) -> f64 {
        self.cost[i * self.n + j]
    }

    /// Whether the straight motion touches something.
    #[must_use]
    pub fn is_blocked(&self, i: usize, j: usize) -> bool {
        self.cost(i, j) >= BLOCKED
    }

    /// Cost of a whole order.
    #[must_use]
    pub fn length(&self, order: &[usize]) -> f64 {
        order.windows(2).map(|w| self.cost(w[0], w[1])).sum()
    }

    /// A short way through all of `places` from the posture `from`: the nearest next, then 2-opt (the end is free).
    #[must_use]
    pub fn shortest(&self, from: Option<usize>, places: &[usize]) -> Vec<usize> {
        let mut left = places.to_vec();
        let mut order: Vec<usize> = from.into_iter().collect();
        while !left.is_empty() {
            let next = match order.last() {
                None => 0,
                Some(last) => {
                    let by_cost = |a: &usize, b: &usize| {
                        let of = |k: usize| self.cost(*last, left[k]);
                        of(*a).total_cmp(&of(*b))
                    };
                    (0..left.len()).min_by(by_cost).unwrap_or(0)
                }
            };
            order.push(left.remove(next));
        }
        for _ in 0..SWEEPS {
            if !self.two_opt(&mut order) {
                break;
            }
        }
        order.split_off(usize::from(from.is_some()))
    }

    /// Turns parts of the way around where that is shorter; the first place stays.
    fn two_opt(&self, order: &mut [usize]) -> bool {
        /// Shorter by less than this (s) is rounding.
        const SHORTER: f64 = 1e-9;
        let n = order.len();
        let mut changed = false;
        for i in 0..n.saturating_sub(2) {
            for j in i + 2..n {
                let (a, b, c) = (order[i], order[i + 1], order[j]);
                let d = order.get(j + 1);
                let before = self.cost(a, b) + d.map_or(0.0, |d| self.cost(c, *d));
                let after = self.cost(a, c) + d.map_or(0.0, |d| self.cost(b, *d));
                if after < before - SHORTER {
                    order[i + 1..=j].reverse();
                    changed = true;
                }
            }
        }
        changed
    }
}

/// A posture on the way between two whose straight motion is blocked: the one of `others` by which the two motions are clear and
/// together shortest.
#[must_use]
pub fn detour<'q>(
    feasible: &Feasible<'_>,
    joints: &JointBox,
    (from, to): (&[f64], &[f64]),
    others: impl Iterator<Item = &'q [f64]>,
) -> Option<&'q [f64]> {
    let mut by_time: Vec<(f64, &[f64])> = others
        .map(|q| (joints.time(from, q) + joints.time(q, to), q))
        .collect();
    by_time.sort_by(|a, b| a.0.total_cmp(&b.0));
    let clear = |q: &[f64]| feasible.clear(from, q) && feasible.clear(q, to);
    by_time.into_iter().map(|b| b.1).find(|q| clear(q))
}
