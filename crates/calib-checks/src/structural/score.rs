//! Scores of all candidates.

use rayon::prelude::*;

use super::candidates::Candidate;
use super::correct::{correct, empty_rows, open_rows, stuck_at};
use super::data::Data;
use super::hypothesis::{Hypothesis, Scope, Scoped};
use super::ids::JointIndex;
use super::order::{ColumnOrder, Columns};
use super::scan::{Scan, Score, Scored};
use super::special;

/// A frame or a mount of a recording's own takes up nominal errors: clean sweeps in recordings of their own gained up to 2.
/// Such a hypothesis must gain this many times as much as others, 3 instead of 1.5.
const OWN_FRAME: f64 = 2.0;
/// The same of a mistake of one joint by any amount: of two that explain as much, it is the simpler one.
const OWN_SIZE: f64 = 1.7;
/// An arm with three axes in its shoulder and three in its wrist is the same arm read from its end, with the poses of its body inverted: of the two, that
/// all columns have the wrong names is the rarer mistake, and a camera's lever leaves up to twice as much with the right one.
const ALL_REVERSED: f64 = 2.0;

/// Every hypothesis in every scope that is allowed for it; beyond `enough`, m, a lower bound of the residual will do.
pub(crate) fn score(scan: &Scan<'_>, candidates: &[Candidate], enough: f64) -> Vec<Scored> {
    let of_candidate = |(hypothesis, scopes): &Candidate| {
        let mut scored: Vec<Scored> = match hypothesis {
            Hypothesis::TrackerMoved | Hypothesis::MissingColumn { .. } => scopes
                .iter()
                .map(|scope| estimated(scan, hypothesis, *scope))
                .collect(),
            _ => scan.score(hypothesis, scopes, enough),
        };
        let own = match hypothesis {
            h if h.is_frame() => OWN_FRAME,
            h if h.is_sized() => OWN_SIZE,
            Hypothesis::Order {
                order: ColumnOrder::Reversed(Columns::All),
            } => ALL_REVERSED,
            _ => 1.0,
        };
        scored.iter_mut().for_each(|s| s.score.score *= own);
        scored
    };
    let scored: Vec<Vec<Scored>> = candidates.par_iter().map(of_candidate).collect();
    scored.into_iter().flatten().collect()
}

/// A joint whose estimated readings lie within this of their median, rad or m, may have stood still: nominal errors move those of joints that turn by a
/// few degrees, of joints that slide by a few centimeters.
fn still(turns: bool) -> f64 {
    if turns { 0.25 } else { 0.03 }
}
/// A joint that stood still within this of 0, rad or m, is where it was assumed to be.
fn at_zero(turns: bool) -> f64 {
    if turns { 0.05 } else { 0.02 }
}
/// Readings of their own that explain so many times more than one place take up no errors of the robot.
const BEYOND_ERRORS: f64 = 4.0;
/// One place for all rows is the explanation unless a reading per row explains this many times as much.
const SIMPLER: f64 = 1.2;

/// A hypothesis that estimates something of its own.
fn estimated(scan: &Scan<'_>, hypothesis: &Hypothesis, scope: Scope) -> Scored {
    let scoped = Scoped {
        hypothesis: *hypothesis,
        scope,
    };
    if let Hypothesis::MissingColumn { joint } = *hypothesis
        && empty_rows(scope, joint, scan.data).is_empty()
    {
        return stuck_column(scan, scoped, joint);
    }
    let corrected = special::apply(&scoped, scan.data);
    match *hypothesis {
        Hypothesis::MissingColumn { joint } => empty_column(scan, scoped, joint, &corrected),
        _ => {
            let score = scan.fit_corrected(&corrected).score;
            Scored { scoped, score }
        }
    }
}

/// A joint without a column moved, or it stood still elsewhere than at 0. A reading of its own in every row takes up nominal
/// errors, as a frame of its own does: where the joint hardly moved it must gain as much.
fn empty_column(scan: &Scan<'_>, scoped: Scoped, joint: JointIndex, filled: &Data) -> Scored {
    let rows = open_rows(scoped.scope, joint, scan.data).len();
    let mut score = penalized(scan, rows, scan.fit_corrected(filled).score);
    let Some(found) = special::whereabouts(scoped.scope, joint, scan.data, filled) else {
        return Scored { scoped, score };
    };
    let (stood, value) = stood_at(scan, scoped, joint, found.middle);
    let turns = scan.data.chain.turns(joint.0) != Some(false);
    let still = found.spread < still(turns) && stood.score.rms < BEYOND_ERRORS * score.rms;
    if value.abs() > at_zero(turns) && (still || stood.score.score < SIMPLER * score.score) {
        return stood;
    }
    if still {
        score.score *= OWN_FRAME;
    }
    Scored { scoped, score }
}

/// A joint whose readings never change stood elsewhere than they say, or moved in spite of them.
fn stuck_column(scan: &Scan<'_>, scoped: Scoped, joint: JointIndex) -> Scored {
    let stood = stood_elsewhere(scan, scoped, joint);
    let corrected = special::apply(&scoped, scan.data);
    let rows = open_rows(scoped.scope, joint, scan.data).len();
    let mut score = penalized(scan, rows, scan.fit_corrected(&corrected).score);
    let turns = scan.data.chain.turns(joint.0) != Some(false);
    let found = special::whereabouts(scoped.scope, joint, scan.data, &corrected);
    let hardly = found.is_none_or(|found| found.spread < still(turns));
    if hardly && stood.score.rms < BEYOND_ERRORS * score.rms {
        return stood;
    }
    // Most joints whose readings never change do stand still.
    score.score *= OWN_FRAME;
    match SIMPLER * score.score < stood.score.score {
        true => Scored { scoped, score },
        false => stood,
    }
}

/// A joint whose readings never change stood elsewhere than they say; no explanation where it stood there. One place for all rows
/// takes up errors of the robot, as a frame of its own does: it must gain as much.
fn stood_elsewhere(scan: &Scan<'_>, scoped: Scoped, joint: JointIndex) -> Scored {
    let (mut stood, value) = stood_at(scan, scoped, joint, 0.0);
    let read = stuck_at(scoped.scope, joint, scan.data);
    let turns = scan.data.chain.turns(joint.0) != Some(false);
    if read.is_none_or(|read| (value - read).abs() < at_zero(turns)) {
        stood.score.score = f64::INFINITY;
    }
    stood.score.score *= OWN_FRAME;
    stood
}

/// Places where the search starts; it goes on between the neighbors of the best.
const STARTS: usize = 12;
/// Steps of the search: the range shrinks to 0.62 of itself in each, in all to a tenth of a degree.
const STEPS: usize = 14;

/// The one place where a joint stood that explains its rows best, by golden-section search.
pub(super) fn stood_at(
    scan: &Scan<'_>,
    scoped: Scoped,
    joint: JointIndex,
    middle: f64,
) -> (Scored, f64) {
    let at = |value: f64| {
        let scoped = Scoped {
            hypothesis: Hypothesis::StoodAt { joint, value },
            ..scoped
        };
        let score = scan.fit_corrected(&correct(&scoped, scan.data)).score;
        Scored { scoped, score }
    };
    let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
    let half = special::range(scan.data, joint);
    let step = 2.0 * half / STARTS as f64;
    let starts = (0..STARTS).map(|k| -half + step * k as f64);
    let start = starts
        .chain([middle])
        .map(|value| (at(value).score.score, value))
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .map_or(middle, |best| best.1);
    let (mut low, mut high) = (start - step, start + step);
    for _ in 0..STEPS {
        let (a, b) = (high - golden * (high - low), low + golden * (high - low));
        if at(a).score.score < at(b).score.score {
            high = b;
        } else {
            low = a;
        }
    }
    let value = 0.5 * (low + high);
    (at(value), value)
}

/// One estimated reading per row: the degrees of freedom that are left are fewer.
pub(super) fn penalized(scan: &Scan<'_>, rows: usize, score: Score) -> Score {
    let (_, freedom) = scan.freedom();
    let left = (freedom - rows as f64) / freedom.max(1.0);
    let factor = if left > 0.1 {
        left.sqrt().recip()
    } else {
        f64::INFINITY
    };
    Score {
        rms: score.rms * factor,
        score: score.score * factor,
    }
}
