//! Zeros that are off by any angle or length, farther than errors of a nominal robot: an encoder that was mounted or homed otherwise.
//!
//! ```text
//! offset = argmin f(reading_j + offset)                 f: the residual of the registration, per joint and scope
//! ```
//!
//! A fit that estimates the zeros finds such an offset, too; here it is asked whether it is the whole of what is wrong.

use std::f64::consts::{FRAC_PI_2, PI};

use rayon::prelude::*;

use super::Options;
use super::candidates::{Candidate, everywhere, span};
use super::data::Data;
use super::hypothesis::{Hypothesis, Scope};
use super::ids::{JointIndex, SampleIndex};
use super::scan::Scan;

/// Places of the whole turn where the search starts; it goes on between the neighbors of the best.
const STARTS: usize = 24;
/// Half the length that is searched for a joint that slides, m.
const STROKE: f64 = 0.6;
/// Steps of the search: the range shrinks to 0.62 of itself in each.
const STEPS: usize = 18;
/// An offset within this of one or two quarter turns, rad, is taken for these.
const NEAR_QUARTER: f64 = 0.17;
/// An offset of less than so many σ of the priors is an error of the nominal robot.
const BEYOND_PRIOR: f64 = 2.0;

/// For each joint that moves, the offset of its zero that leaves least, and that in a part of the data, where it leaves clearly less.
pub(super) fn of_zeros(data: &Data, screened: &[SampleIndex], options: &Options) -> Vec<Candidate> {
    let scan = Scan::new(data, screened);
    let joints = data.relevant_joints().into_iter();
    let moving = joints.filter(|j| data.chain.turns(j.0).is_some() && span(data, *j) > 1e-6);
    let scopes = everywhere(data);
    let asked: Vec<(JointIndex, Scope)> = moving
        .flat_map(|joint| scopes.iter().map(move |scope| (joint, *scope)))
        .collect();
    let found: Vec<(JointIndex, Scope, f64, f64)> = asked
        .into_par_iter()
        .map(|(joint, scope)| {
            let (left, offset) = best(&scan, joint, scope);
            (joint, scope, left, offset)
        })
        .collect();
    let everywhere = |joint: JointIndex| {
        let all = found.iter().find(|f| f.0 == joint && f.1 == Scope::All);
        all.map_or(f64::INFINITY, |f| f.2)
    };
    let kept = found.iter().filter(|(joint, scope, left, offset)| {
        let part = *scope != Scope::All;
        let clearly = !part || everywhere(*joint) > options.name_ratio * left;
        clearly && plausible(data, *joint, *offset, options)
    });
    kept.map(|&(joint, scope, _, offset)| (Hypothesis::Zero { joint, offset }, vec![scope]))
        .collect()
}

/// The candidates with the zeros of other data.
pub(super) fn again(
    candidates: &[Candidate],
    data: &Data,
    screened: &[SampleIndex],
    options: &Options,
) -> Vec<Candidate> {
    let is_zero = |c: &&Candidate| matches!(c.0, Hypothesis::Zero { .. });
    let others = candidates.iter().filter(|c| !is_zero(c)).cloned();
    others.chain(of_zeros(data, screened, options)).collect()
}

/// Whether an offset is more than an error of a nominal robot, and not a quarter turn, which is a hypothesis of its own.
fn plausible(data: &Data, joint: JointIndex, offset: f64, options: &Options) -> bool {
    match data.chain.turns(joint.0) == Some(true) {
        true => {
            let quarters = (offset / FRAC_PI_2).round();
            let near = (offset - quarters * FRAC_PI_2).abs() < NEAR_QUARTER;
            offset.abs() > BEYOND_PRIOR * options.prior_angle && (quarters == 0.0 || !near)
        }
        false => offset.abs() > BEYOND_PRIOR * options.prior_length,
    }
}

/// The least residual and its offset, by golden-section search from the best of a grid.
fn best(scan: &Scan<'_>, joint: JointIndex, scope: Scope) -> (f64, f64) {
    let left = |offset: f64| {
        let zero = Hypothesis::Zero { joint, offset };
        let scored = scan.score(&zero, &[scope], f64::INFINITY);
        scored.first().map_or(f64::INFINITY, |s| s.score.score)
    };
    let half = match scan.data.chain.turns(joint.0) {
        Some(false) => STROKE,
        _ => PI,
    };
    let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
    let step = 2.0 * half / STARTS as f64;
    let starts = (0..STARTS).map(|k| -half + step * k as f64);
    let start = starts
        .map(|offset| (left(offset), offset))
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .map_or(0.0, |best| best.1);
    let (mut low, mut high) = (start - step, start + step);
    for _ in 0..STEPS {
        let (a, b) = (high - golden * (high - low), low + golden * (high - low));
        if left(a) < left(b) {
            high = b;
        } else {
            low = a;
        }
    }
    let offset = 0.5 * (low + high);
    (left(offset), offset)
}
