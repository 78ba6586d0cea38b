//! Held-out poses must not be poses of the fit.

use calib_finding::{Fact, Finding, Subject, catalog};
use calib_recording::Poses;

/// Joint values closer than this in all joints, rad or m, are the same pose: three encoder steps of a good robot.
const SAME: f64 = 1e-3;

/// Rows of `held_out` that stand in `training` too, by their joint values; with the same tracker data it is the very
/// same measurement (error), else a repeated pose (warning: it tests repeatability, not the model).
pub fn held_out_in_training(held_out: &Poses, training: &Poses) -> Option<Finding> {
    let shared: Vec<&String> = held_out
        .joints
        .keys()
        .filter(|joint| training.joints.contains_key(*joint))
        .collect();
    if shared.is_empty() {
        return None;
    }
    let values = |poses: &Poses, row: usize| -> Option<Vec<f64>> {
        shared
            .iter()
            .map(|joint| poses.joints[*joint][row])
            .collect()
    };
    let known: Vec<(usize, Vec<f64>)> = (0..training.len())
        .filter_map(|row| Some((row, values(training, row)?)))
        .collect();
    let (mut same_pose, mut same_data) = (Vec::new(), Vec::new());
    for row in 0..held_out.len() {
        let Some(q) = values(held_out, row) else {
            continue;
        };
        let twins = known
            .iter()
            .filter(|(_, other)| q.iter().zip(other).all(|(a, b)| (a - b).abs() <= SAME));
        let mut found = false;
        for (twin, _) in twins {
            found = true;
            if same_measurement(held_out, row, training, *twin) {
                same_data.push(held_out.rows[row]);
                break;
            }
        }
        if found {
            same_pose.push(held_out.rows[row]);
        }
    }
    let (kind, rows) = match (same_data.is_empty(), same_pose.is_empty()) {
        (false, _) => ("measurement", same_data),
        (true, false) => ("pose", same_pose),
        (true, true) => return None,
    };
    Some(
        Finding::of_kind(catalog::HELD_OUT_IN_TRAINING, kind, Subject::default())
            .with("shared", Fact::count(rows.len()))
            .with("rows", Fact::count(held_out.len()))
            .at_rows(rows),
    )
}

/// Some tracker value is given in both and all shared ones are exactly equal.
fn same_measurement(a: &Poses, i: usize, b: &Poses, j: usize) -> bool {
    let markers = a
        .markers
        .iter()
        .filter_map(|(name, track)| Some(track[i]? == b.markers.get(name)?[j]?));
    let bodies = a
        .bodies
        .iter()
        .filter_map(|(name, track)| Some(track[i]? == b.bodies.get(name)?[j]?));
    let mut any = false;
    for equal in markers.chain(bodies) {
        any = true;
        if !equal {
            return false;
        }
    }
    any
}
