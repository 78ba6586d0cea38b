//! Joints that a recording has a column for, and no value in some rows: what takes no part for want of a reading is said.

use std::collections::BTreeMap;

use calib_finding::{Fact, Finding, Severity, Subject, catalog};
use calib_recording::Poses;

use crate::error::DataProblem;
use crate::prepare::streams::Scalars;

/// Part of the rows without a reading beyond which the export, not the robot, lost them.
const MOST: f64 = 0.5;

/// Readings that are farther apart than this many times the usual distance have a gap between them.
const GAP: f64 = 5.0;

/// The shortest gap that is told, s: a hold is seldom shorter.
const LEAST_GAP: f64 = 0.5;

/// A joint whose column holds nothing at all.
///
/// # Errors
/// [`DataProblem::NoJointValues`].
pub(super) fn none_is_empty<'a>(
    joints: impl IntoIterator<Item = (&'a String, &'a [Option<f64>])>,
) -> Result<(), DataProblem> {
    let empty = |(_, values): &(&String, &[Option<f64>])| values.iter().all(Option::is_none);
    match joints.into_iter().find(empty) {
        Some((joint, _)) => Err(DataProblem::NoJointValues {
            joint: joint.clone(),
        }),
        None => Ok(()),
    }
}

/// Rows of a table that lack readings, a finding for all joints that lack them in the same rows.
///
/// Of streams that were `aligned`, rows without any reading were seen while the robot's log was not running, or in its gaps.
pub(super) fn of_table(recording: &str, poses: &Poses, aligned: bool) -> Vec<Finding> {
    let some = |row: usize| poses.joints.values().any(|values| values[row].is_some());
    let rows: Vec<usize> = (0..poses.len())
        .filter(|row| !aligned || some(*row))
        .collect();
    let mut joints: BTreeMap<Vec<usize>, Vec<&String>> = BTreeMap::new();
    for (joint, values) in &poses.joints {
        let lacking = rows.iter().copied().filter(|row| values[*row].is_none());
        let lacking: Vec<usize> = lacking.collect();
        if !lacking.is_empty() {
            joints.entry(lacking).or_default().push(joint);
        }
    }
    let finding = |(rows, joints): (Vec<usize>, Vec<&String>)| {
        let most = rows.len() as f64 > MOST * poses.len() as f64;
        let severity = if most {
            Severity::Error
        } else {
            Severity::Warning
        };
        let subject = Subject::recording(recording);
        Finding::of_kind(catalog::JOINT_VALUES_MISSING, "rows", subject)
            .with_severity(severity)
            .with("joints", Fact::names(joints.into_iter().cloned()))
            .with("count", Fact::count(rows.len()))
            .with("rows", Fact::count(poses.len()))
            .at_rows(rows.into_iter().map(|i| poses.rows[i]))
    };
    joints.into_iter().map(finding).collect()
}

/// Gaps between the readings of streams, a finding for all joints that have the same. `tracker` is the time line of the tracker's rows: where
/// the joints are on it, a time without rows is one in which the tracker saw nothing either, as between the holds of `calib record`.
pub(super) fn of_streams(
    recording: &str,
    joints: &BTreeMap<String, Scalars>,
    tracker: usize,
) -> Vec<Finding> {
    // Nanoseconds: what is equal is told once.
    let mut found: BTreeMap<(i64, i64), Vec<&String>> = BTreeMap::new();
    for (joint, stream) in joints {
        let (all, longest) = gaps(stream, stream.timeline == tracker);
        if longest > 0.0 {
            let key = |seconds: f64| (seconds * 1e9).round() as i64;
            found
                .entry((key(all), key(longest)))
                .or_default()
                .push(joint);
        }
    }
    let finding = |((all, longest), joints): ((i64, i64), Vec<&String>)| {
        let subject = Subject::recording(recording);
        Finding::of_kind(catalog::JOINT_VALUES_MISSING, "gaps", subject)
            .with("joints", Fact::names(joints.into_iter().cloned()))
            .with("all", Fact::seconds(all as f64 * 1e-9))
            .with("longest", Fact::seconds(longest as f64 * 1e-9))
    };
    found.into_iter().map(finding).collect()
}

/// Time in gaps between the first and the last reading, and in the longest of them, s; only of those with rows in them where the tracker
/// shares the rows.
fn gaps(stream: &Scalars, shared: bool) -> (f64, f64) {
    let values = stream.values.iter().zip(&stream.t).enumerate();
    let times: Vec<(usize, f64)> = values
        .filter(|(_, (value, _))| value.is_some())
        .map(|(row, (_, t))| (row, *t))
        .collect();
    let step = |w: &[(usize, f64)]| w[1].1 - w[0].1;
    let mut sorted: Vec<f64> = times.windows(2).map(step).collect();
    sorted.sort_by(f64::total_cmp);
    let usual = sorted.get(sorted.len() / 2).copied().unwrap_or(0.0);
    let limit = LEAST_GAP.max(GAP * usual);
    let lacks = |w: &&[(usize, f64)]| !shared || w[1].0 > w[0].0 + 1;
    let long = || {
        times
            .windows(2)
            .filter(lacks)
            .map(step)
            .filter(|step| *step > limit)
    };
    (long().sum(), long().fold(0.0, f64::max))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stream(t: Vec<f64>, values: Vec<Option<f64>>) -> BTreeMap<String, Scalars> {
        let scalars = Scalars::given(t, values);
        BTreeMap::from([("a".to_owned(), scalars)])
    }

    #[test]
    fn gaps_are_told_and_slow_readings_are_none() {
        let times: Vec<f64> = (0..1000).map(|i| 0.01 * f64::from(i)).collect();
        let every = |n: usize| -> Vec<Option<f64>> {
            (0..1000).map(|i| (i % n == 0).then_some(0.1)).collect()
        };
        // Every reading, and one in 60: the readings are 0.6 s apart, as usual.
        for n in [1, 60] {
            assert!(of_streams("r", &stream(times.clone(), every(n)), 0).is_empty());
        }
        let mut values = every(1);
        values[200..350].fill(None);
        values[700..760].fill(None);
        let found = of_streams("r", &stream(times, values), 0);
        assert_eq!(found.len(), 1);
        assert!(found[0].text().contains("2120 ms"), "{}", found[0].text());
        assert!(found[0].text().contains("1510 ms"), "{}", found[0].text());
    }

    #[test]
    fn between_holds_nothing_is_lost() {
        let times: Vec<f64> = (0..300)
            .map(|i| 0.01 * f64::from(i) + 5.0 * f64::from(i / 100))
            .collect();
        let held = stream(times, vec![Some(0.1); 300]);
        assert!(of_streams("r", &held, 0).is_empty());
        // A log of the robot's own has lost readings.
        assert_eq!(of_streams("r", &held, 1).len(), 1);
    }
}
