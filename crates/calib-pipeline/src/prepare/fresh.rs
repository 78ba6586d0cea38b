//! Frames that a file repeats: a table that is written faster than the tracker measures has each of its frames in several rows.
//!
//! A repeated value belongs to the time of its first row. Taken as measured in the others, it lags behind the joints, by another time in every row. So
//! only the first row of every run of equal values is a measurement, and rows without any are left out.

use calib_finding::{Fact, Finding, Subject, catalog};
use calib_recording::Poses;
use nalgebra::SVector;

/// A run repeats a frame, and not a rounded number, if the steps at its ends are this many times the smallest that was written.
const SHOWN: f64 = 10.0;
/// Where no joint is known at the tracker's times: steps, m, of a body that moves.
const MOVED: f64 = 1e-3;
/// Fewest runs, and part of all values, from which a file repeats frames: fewer are single faults.
const RUNS: usize = 10;
const PART: f64 = 0.1;

/// What a row shows of a marker or body: position, m, and quaternion.
type Value = SVector<f64, 7>;

/// A run of equal values: its first row, and how many it has.
#[derive(Debug, Clone, Copy)]
struct Run {
    start: usize,
    rows: usize,
}

/// Takes repeated values out of a table at the tracker's times; the rows that are left, and what was found. `moves`: whether joints moved between
/// two rows, where that is known.
pub(crate) fn only_fresh(
    name: &str,
    full: &mut Poses,
    moves: impl Fn(usize, usize) -> Option<bool>,
) -> (Vec<usize>, Option<Finding>) {
    let all: Vec<usize> = (0..full.len()).collect();
    let mut repeated = vec![0; full.len()];
    let mut names = Vec::new();
    let mut longest = 0;
    let mut take = |name: &str, values: Vec<Option<Value>>, lose: &mut dyn FnMut(usize)| {
        let runs = repeats(&values, &moves);
        longest = runs.iter().map(|r| r.rows).fold(longest, usize::max);
        if !runs.is_empty() {
            names.push(name.to_owned());
        }
        for row in runs.iter().flat_map(|r| r.start + 1..r.start + r.rows) {
            repeated[row] += 1;
            lose(row);
        }
    };
    for (name, track) in &mut full.markers {
        let values = track
            .iter()
            .map(|p| p.map(|p| Value::from_row_slice(&[p.x, p.y, p.z, 0.0, 0.0, 0.0, 1.0])));
        take(name, values.collect(), &mut |row| track[row] = None);
    }
    for (name, track) in &mut full.bodies {
        let value = |p: &nalgebra::Isometry3<f64>| {
            let (t, q) = (p.translation.vector, p.rotation.coords);
            Value::from_row_slice(&[t.x, t.y, t.z, q.x, q.y, q.z, q.w])
        };
        let values = track.iter().map(|p| p.as_ref().map(value));
        take(name, values.collect(), &mut |row| track[row] = None);
    }
    if names.is_empty() {
        return (all, None);
    }
    let shown = |row: &usize| {
        repeated[*row] == 0
            || full.markers.values().any(|track| track[*row].is_some())
            || full.bodies.values().any(|track| track[*row].is_some())
    };
    let kept: Vec<usize> = all.into_iter().filter(shown).collect();
    let rows = repeated.iter().filter(|count| **count > 0).count();
    let finding = Finding::new(catalog::FRAMES_REPEATED, Subject::recording(name))
        .with("repeated", Fact::count(rows))
        .with("rows", Fact::count(full.len()))
        .with("names", Fact::names(names))
        .with("longest", Fact::count(longest));
    (kept, Some(finding))
}

/// The runs of repeated values of one track, where there are many.
fn repeats(track: &[Option<Value>], moves: &impl Fn(usize, usize) -> Option<bool>) -> Vec<Run> {
    let seen: Vec<usize> = (0..track.len()).filter(|&i| track[i].is_some()).collect();
    let difference = |a: usize, b: usize| Some((track[b]? - track[a]?).abs());
    let step = |a: usize, b: usize| difference(a, b).map(|d| d.max());
    // The step of the numbers as they were written: no coordinate changes by less.
    let mut smallest = f64::INFINITY;
    for d in seen.windows(2).filter_map(|w| difference(w[0], w[1])) {
        let positions = d.iter().take(3).filter(|d| **d > 1e-12);
        smallest = positions.fold(smallest, |least, d| least.min(*d));
    }
    let mut runs = Vec::new();
    let (mut values, mut start) = (0, 0);
    for i in 1..=seen.len() {
        let goes_on =
            i < seen.len() && seen[i] == seen[i - 1] + 1 && track[seen[i]] == track[seen[start]];
        if goes_on {
            continue;
        }
        values += 1;
        let before = start
            .checked_sub(1)
            .and_then(|b| step(seen[b], seen[start]));
        let after = seen.get(i).and_then(|&next| step(seen[start], next));
        let least = before
            .unwrap_or(f64::INFINITY)
            .min(after.unwrap_or(f64::INFINITY));
        if i - start > 1 {
            let run = Run {
                start: seen[start],
                rows: i - start,
            };
            let shows = least.is_finite() && least > SHOWN * smallest;
            let moved = shows && moves(seen[start], seen[i - 1]).unwrap_or(least > MOVED);
            runs.push((run, moved));
        }
        start = i;
    }
    let moving = || runs.iter().filter(|(_, moved)| *moved).map(|(run, _)| *run);
    if moving().count() < RUNS || (moving().count() as f64) < PART * values as f64 {
        return Vec::new();
    }
    // At rest as well, where the numbers of a tracker that measures would differ; a longer run is rest without noise.
    let longest = moving().map(|run| run.rows).max().unwrap_or(0);
    let alike = runs
        .iter()
        .map(|(run, _)| *run)
        .filter(|run| run.rows <= longest);
    alike.collect()
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;

    use super::*;

    fn track(of: impl Fn(usize) -> f64) -> Poses {
        let points = (0..200).map(|i| Some(Point3::new(of(i), 0.5, 1.0)));
        Poses {
            rows: (0..200).collect(),
            markers: [("m".to_owned(), points.collect())].into(),
            ..Poses::default()
        }
    }

    /// What is left of a track, with joints that move in every row or never.
    fn left(of: impl Fn(usize) -> f64, joints_move: bool) -> usize {
        let mut poses = track(of);
        let (kept, finding) = only_fresh("r", &mut poses, |_, _| Some(joints_move));
        assert_eq!(finding.is_some(), kept.len() < 200);
        let some = kept
            .iter()
            .filter(|row| poses.markers["m"][**row].is_some());
        assert_eq!(some.count(), kept.len());
        kept.len()
    }

    #[test]
    fn a_frame_counts_once() {
        let moving = |i: usize| (i as f64 * 0.03).sin() * 0.4;
        // Every frame in one row, in two, in five, and in one or two.
        assert_eq!(left(moving, true), 200);
        assert_eq!(left(|i| moving(i / 2 * 2), true), 100);
        assert_eq!(left(|i| moving(i / 5 * 5), true), 40);
        assert_eq!(left(|i| moving(i * 4 / 5 * 5 / 4), true), 160);
    }

    #[test]
    fn rest_and_rounding_are_no_repeated_frames() {
        // Rest without noise, and a slow motion that was rounded.
        assert_eq!(left(|i| (i / 20) as f64 * 0.1, false), 200);
        assert_eq!(left(|i| (i as f64 * 0.3).round() * 1e-3, true), 200);
    }
}
