//! Whose readings are wrong, where no hypothesis says how?
//!
//! A column may be sorted, smoothed, shifted against the others, stuck, or of another joint. None of these is a mistake of one kind, but all have
//! this in common: without the readings of the joint, its position estimated in every row from what the tracker saw, nominal errors
//! explain the rest. This is asked of every joint, in all recordings and in each alone, where the data disagree with the robot and nothing is named.

use rayon::prelude::*;
use serde::Serialize;

use super::data::Data;
use super::hypothesis::Scope;
use super::ids::{JointIndex, RecordingIndex, SampleIndex};
use super::scan::Scan;
use super::special::estimated;
use super::thinning::thinned;
use super::{Options, Outcome};

/// Rows that are looked at: every row costs a search for the joint's position in each of up to twelve rounds.
const ROWS: usize = 160;
/// Degrees of freedom that must be left.
const LEAST_FREEDOM: f64 = 20.0;
/// A joint in one recording is named in place of the same joint in all where that leaves at most so much more.
const NARROWER: f64 = 1.3;
/// Readings are off where they differ by more than this many σ of the priors.
const OFF: f64 = 3.0;
/// Readings of another row are those that differ by less than this part of what those of their own row do.
const SHIFTED: f64 = 0.25;

/// The joint whose readings disagree with what the tracker saw.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct WrongReadings {
    /// Which.
    pub joint: JointIndex,
    /// In all recordings, or in one.
    pub scope: Scope,
    /// Residual of the registration without its readings, rms, m.
    pub rms: f64,
    /// The same without the readings of the next best joint.
    pub next: Option<f64>,
    /// Half of the readings differ by more from the position that was estimated, rad or m.
    pub median: f64,
    /// Readings are called off from here on: three σ of the priors, rad or m.
    pub least: f64,
    /// Readings that are off.
    pub off: usize,
    /// Rows that were looked at.
    pub rows: usize,
    /// What belongs to row i stands in row i + `shift`.
    pub shift: Option<i8>,
}

/// One joint without its readings.
struct Tried {
    joint: JointIndex,
    scope: Scope,
    rms: f64,
    rows: Vec<usize>,
    data: Data,
}

/// The joint without whose readings nominal errors explain the data, if there is one; `outcome`: of the other hypotheses.
pub(super) fn wrong_readings(
    all: &Data,
    outcome: &Outcome,
    options: &Options,
) -> Option<WrongReadings> {
    let (limit, rms) = (outcome.expected?.limit, outcome.rms);
    let rows = thinned(all, ROWS);
    let place = |s: &SampleIndex| {
        let row = rows.binary_search(&s.row).ok()?;
        Some(SampleIndex { row, ..*s })
    };
    let screened: Vec<SampleIndex> = outcome.screened.iter().filter_map(place).collect();
    let data = &all.select(&rows);
    let recordings = data.recordings();
    let mut scopes = vec![Scope::All];
    if recordings > 1 {
        scopes.extend((0..recordings).map(|r| Scope::Recording(RecordingIndex(r))));
    }
    let asked: Vec<(JointIndex, Scope)> = outcome
        .design
        .moving
        .iter()
        .flat_map(|j| scopes.iter().map(move |s| (*j, *s)))
        .collect();
    let mut tried: Vec<Tried> = asked
        .into_par_iter()
        .map(|(joint, scope)| without(data, joint, scope, &screened))
        .collect();
    tried.sort_by(|a, b| a.rms.total_cmp(&b.rms));
    let best = tried.first()?;
    let joint = best.joint;
    let other = tried.iter().find(|t| t.joint != joint);
    let alone =
        |t: &&Tried| t.joint == joint && t.scope != Scope::All && t.rms <= best.rms * NARROWER;
    let named = tried.iter().find(alone).unwrap_or(best);
    let explains = named.rms <= limit && rms >= named.rms * options.pair_ratio;
    if !explains || other.is_some_and(|o| o.rms < named.rms * options.name_ratio) {
        return None;
    }
    let turns = data.chain.turns(joint.0) == Some(true);
    // From the reading in any row to the position in one that was looked at.
    let apart = |from: usize, i: usize| -> Option<f64> {
        let found = named.data.readings[i][joint.0]?;
        let d = found - all.readings.get(from)?[joint.0]?;
        let same = all.recording[from] == data.recording[i];
        same.then(|| match turns {
            true => d.sin().atan2(d.cos()).abs(),
            false => d.abs(),
        })
    };
    let off = |i: &usize| apart(rows[*i], *i);
    let own: Vec<f64> = named.rows.iter().filter_map(off).collect();
    let least = OFF
        * if turns {
            options.prior_angle
        } else {
            options.prior_length
        };
    let middle = median(own.clone())?;
    let of_other_row = |shift: i8| {
        let from = |i: usize| rows[i].checked_add_signed(isize::from(shift));
        let other = named.rows.iter().filter_map(|&i| apart(from(i)?, i));
        Some((median(other.collect())?, shift))
    };
    let nearest = [-2, -1, 1, 2]
        .into_iter()
        .filter_map(of_other_row)
        .min_by(|a, b| a.0.total_cmp(&b.0));
    Some(WrongReadings {
        joint,
        scope: named.scope,
        rms: named.rms,
        next: other.map(|o| o.rms),
        median: middle,
        least,
        off: own.iter().filter(|d| **d > least).count(),
        rows: own.len(),
        shift: nearest
            .filter(|(d, _)| *d < SHIFTED * middle)
            .map(|(_, shift)| shift),
    })
}

fn without(data: &Data, joint: JointIndex, scope: Scope, screened: &[SampleIndex]) -> Tried {
    let all = 0..data.readings.len();
    let inside =
        |i: &usize| scope.contains(data.recording[*i]) && data.readings[*i][joint.0].is_some();
    let rows: Vec<usize> = all.filter(inside).collect();
    let (data, rms) = estimated(data.clone(), joint, &rows, screened);
    // Every position that was estimated takes a degree of freedom.
    let (_, freedom) = Scan::new(&data, screened).freedom();
    let left = freedom - rows.len() as f64;
    let rms = match left >= LEAST_FREEDOM {
        true => rms * (freedom / left).sqrt(),
        false => f64::INFINITY,
    };
    Tried {
        joint,
        scope,
        rms,
        rows,
        data,
    }
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}
