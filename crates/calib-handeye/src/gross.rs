//! Rows with gross errors: least trimmed squares from seeded subsets, then a gate by chance.
//!
//! ```text
//! minimize Σ of the h least costs, h = ⌈¾ n⌉                     (Rousseeuw & Van Driessen 1999)
//! d_i² = |e_t|²/σ_t² + θ²/σ_r²,   rejected where P(F(6, ν) > d²/6) < 0.05/n                     (6)
//! ```

use calib_estimator::chance::f_tail;
use calib_geometry::statistics::upper_median;
use nalgebra::Isometry3;

use crate::{
    minimum::{Minimum, minimized},
    problem::Weights,
    residuals::squares,
};

/// Fewest poses in which a gross error shows: the fit has 12 unknowns, and three good poses determine them.
const FEWEST: usize = 8;
/// Part of the poses that are taken for good at first: up to a quarter may be wrong.
const GOOD: f64 = 0.75;
/// Subsets: one without errors at 25 % wrong rows with probability 1 − 10⁻⁴ for six poses.
const SUBSETS: u64 = 50;
/// Poses of a subset: three are the least, six rarely share an axis.
const SUBSET: usize = 6;
/// Rounds of refitting to the least costs, and of rejecting by (6).
const ROUNDS: usize = 10;
/// Probability that a good recording loses a pose.
const FAMILYWISE: f64 = 0.05;
/// Rows among which the subsets are drawn; more would not find better ones.
const SEARCHED: usize = 60;
/// Residuals, m and rad, below which data count as exact.
const EXACT: f64 = 1e-9;
/// Median of χ²(3).
const MEDIAN: f64 = 2.366;

/// The rows to keep: all where none is gross.
pub(crate) fn kept(a: &[Isometry3<f64>], b: &[Isometry3<f64>], w: Weights) -> Vec<usize> {
    let n = a.len();
    let all: Vec<usize> = (0..n).collect();
    if n < FEWEST || within(a, b, &all, Scale::Median, w).len() == n {
        return all;
    }
    let searched: Vec<usize> = all.iter().copied().step_by(n.div_ceil(SEARCHED)).collect();
    let trimmed = trimmed(&chosen(a, &searched), &chosen(b, &searched), w);
    let mut keep: Vec<usize> = trimmed.into_iter().map(|i| searched[i]).collect();
    for _ in 0..ROUNDS {
        let next = within(a, b, &keep, Scale::Larger, w);
        if next.len() < FEWEST.max(n / 2) {
            // A half that is wrong is not gross errors of rows.
            return all;
        }
        if next == keep {
            break;
        }
        keep = next;
    }
    keep
}

fn chosen(poses: &[Isometry3<f64>], rows: &[usize]) -> Vec<Isometry3<f64>> {
    rows.iter().map(|&i| poses[i]).collect()
}

fn fit(a: &[Isometry3<f64>], b: &[Isometry3<f64>], rows: &[usize], w: Weights) -> Minimum {
    minimized(&chosen(a, rows), &chosen(b, rows), w)
}

/// Cost of every row under a fit.
fn costs(a: &[Isometry3<f64>], b: &[Isometry3<f64>], found: &Minimum, w: Weights) -> Vec<f64> {
    let cost = |(a, b)| {
        let [t, r] = squares(a, b, &found.x, &found.z);
        w.translation * t + 2.0 * w.rotation * r
    };
    a.iter().zip(b).map(cost).collect()
}

/// The rows of least trimmed squares.
fn trimmed(a: &[Isometry3<f64>], b: &[Isometry3<f64>], w: Weights) -> Vec<usize> {
    let n = a.len();
    let h = (GOOD * n as f64).ceil() as usize;
    let least = |found: &Minimum| {
        let costs = costs(a, b, found, w);
        let mut order: Vec<usize> = (0..n).collect();
        order.sort_by(|i, j| costs[*i].total_cmp(&costs[*j]));
        order.truncate(h);
        let sum: f64 = order.iter().map(|i| costs[*i]).sum();
        order.sort_unstable();
        (sum, order)
    };
    let mut best = least(&minimized(a, b, w));
    for subset in 0..SUBSETS {
        let rows = drawn(n, subset);
        let mut next = least(&fit(a, b, &rows, w));
        for _ in 0..2 {
            next = least(&fit(a, b, &next.1, w));
        }
        if next.0 < best.0 {
            best = next;
        }
    }
    for _ in 0..ROUNDS {
        let next = least(&fit(a, b, &best.1, w));
        if next.1 == best.1 || next.0 >= best.0 {
            break;
        }
        best = next;
    }
    best.1
}

/// Rows of a subset, the same on every machine: a full-period generator modulo 2³² (Numerical Recipes).
fn drawn(n: usize, subset: u64) -> Vec<usize> {
    let mut state = (subset as u32).wrapping_mul(2_654_435_761).wrapping_add(1);
    let mut rows: Vec<usize> = Vec::with_capacity(SUBSET);
    while rows.len() < SUBSET {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let row = ((u64::from(state >> 8) * n as u64) >> 24) as usize;
        if !rows.contains(&row) {
            rows.push(row);
        }
    }
    rows
}

/// Where the noise of (6) comes from.
#[derive(Clone, Copy)]
enum Scale {
    /// The median over all rows, which bears a half of them wrong.
    Median,
    /// The larger of the median's and the mean of the kept rows: those of least cost alone show too little noise.
    Larger,
}

/// The rows within (6) of the fit to `keep`.
fn within(
    a: &[Isometry3<f64>],
    b: &[Isometry3<f64>],
    keep: &[usize],
    scale: Scale,
    w: Weights,
) -> Vec<usize> {
    let n = a.len();
    let found = fit(a, b, keep, w);
    let pairs = a.iter().zip(b);
    let squares: Vec<[f64; 2]> = pairs
        .map(|(a, b)| squares(a, b, &found.x, &found.z))
        .collect();
    let dof = 3.0 * keep.len() as f64 - 6.0;
    let variance = |k: usize| {
        let mut of_all: Vec<f64> = squares.iter().map(|s| s[k]).collect();
        let median = upper_median(&mut of_all).unwrap_or(0.0) / MEDIAN;
        let kept: f64 = keep.iter().map(|i| squares[*i][k]).sum();
        let seen = match scale {
            Scale::Median => median,
            Scale::Larger => median.max(kept / dof.max(1.0)),
        };
        seen.max(EXACT * EXACT)
    };
    let (t2, r2) = (variance(0), variance(1));
    (0..n)
        .filter(|&i| {
            let d2 = squares[i][0] / t2 + squares[i][1] / r2;
            chance_of(d2, dof) * n as f64 >= FAMILYWISE
        })
        .collect()
}

/// Chance of a pose's residuals, each in units of its noise: F with 6 and `dof` degrees of freedom.
fn chance_of(square: f64, dof: f64) -> f64 {
    f_tail(square / 6.0, 6.0, dof.max(1.0))
}
