//! Rows of one table that were lost: from there on, the readings of a row belong to the tracker's data of a neighbor.
//!
//! The sums of the rows before a place, as they are, and of those after it, paired by `b` rows otherwise, make one registration:
//!
//! ```text
//! (r, b) = argmin  f(rows ≤ r, and rows > r with the readings of row i − b)                            (8)
//! ```
//!
//! Sums add up, so every place costs one registration for each b.

use super::apply::apply;
use super::correct::shifted_row;
use super::data::Data;
use super::hypothesis::{Hypothesis, Scope, Scoped};
use super::ids::RecordingIndex;
use super::jump::{Jump, Moved, Size, residual, running};
use super::moments::Moments;
use super::outcome::Outcome;
use super::scan::Scan;

/// Rows that are lost at once.
const LOST: [i8; 6] = [1, -1, 2, -2, 3, -3];
/// Rows after the place, at the least, and before it.
const LEAST_ROWS: usize = 3;
/// Longer recordings have times, by which their tables are paired.
const MOST_ROWS: usize = 1000;

/// Where rows of one table were lost, if nominal errors explain the rest and no more than `most`, m, is left.
pub(super) fn lost_rows(data: &Data, outcome: &Outcome, most: f64) -> Option<Jump> {
    let limit = outcome.expected?.limit;
    let is_stated = data.bodies.iter().any(|body| !body.mounts.is_empty());
    if is_stated || data.readings.len() > MOST_ROWS {
        return None;
    }
    let all = (0..data.recordings()).filter_map(|recording| lost_in(data, recording));
    let best = all.min_by(|a, b| a.rms.total_cmp(&b.rms));
    best.filter(|found| found.rms <= limit.min(most))
}

/// Equation (8) for one recording.
fn lost_in(data: &Data, recording: usize) -> Option<Jump> {
    let of_recording = |i: &usize| data.recording[*i].0 == recording;
    let rows: Vec<usize> = (0..data.readings.len()).filter(of_recording).collect();
    if rows.len() < 2 * LEAST_ROWS {
        return None;
    }
    let scan = Scan::new(data, &[]);
    let n = scan.channels.len();
    let others = (0..scan.recordings).filter(|r| *r != recording);
    let mut rest = vec![Moments::ZERO; n];
    for of in others.map(|r| &scan.sums[r * n..(r + 1) * n]) {
        rest.iter_mut()
            .zip(of)
            .for_each(|(all, one)| all.include(one));
    }
    let until = running(&scan, rows.iter());
    let mut best: Option<(f64, usize, i8)> = None;
    for by in LOST {
        let shift = Scoped {
            hypothesis: Hypothesis::RowShift { rows: by },
            scope: Scope::Recording(RecordingIndex(recording)),
        };
        let paired = apply(&shift, data);
        let shifted = Scan::new(&paired, &[]);
        let mut from = running(&shifted, rows.iter().rev());
        from.reverse();
        // What belongs to the first rows after the place was lost itself.
        let lost = usize::from(by.max(0).unsigned_abs());
        for k in LEAST_ROWS..=rows.len().checked_sub(LEAST_ROWS + lost)? {
            let parts: [&[Moments]; 3] = [&until[k - 1], &from[k + lost], &rest];
            let used: f64 = parts.iter().flat_map(|p| p.iter()).map(|m| m.w).sum();
            let rms = (residual(&parts) / used.max(f64::MIN_POSITIVE)).sqrt();
            if best.is_none_or(|b| rms < b.0) {
                best = Some((rms, k, by));
            }
        }
    }
    let (_, k, by) = best?;
    let paired = paired_otherwise(data, &rows, k, by);
    let rms = Scan::new(&paired, &[]).none().rms;
    Some(Jump {
        moved: Moved::Rows { by },
        recording: RecordingIndex(recording),
        before: rows[k - 1],
        after: rows[k],
        later: Vec::new(),
        size: Size::default(),
        rms,
        rivals: Vec::new(),
    })
}

/// The data with the rows of a recording from its k-th on paired `by` rows otherwise.
fn paired_otherwise(data: &Data, rows: &[usize], k: usize, by: i8) -> Data {
    let mut paired = data.clone();
    for &i in &rows[k..] {
        let from = shifted_row(&data.recording, i, by).filter(|from| by < 0 || *from >= rows[k]);
        paired.readings[i] = match from {
            Some(from) => data.readings[from].clone(),
            None => vec![None; data.readings[i].len()],
        };
    }
    paired
}
