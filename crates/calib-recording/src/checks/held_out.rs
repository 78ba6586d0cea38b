//! Held-out poses must not be poses of the fit.

use crate::finding::{Finding, Severity};
use crate::poses::Poses;

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
    let (severity, rows, what) = match (same_data.is_empty(), same_pose.is_empty()) {
        (false, _) => (
            Severity::Error,
            same_data,
            "are measurements that the fit uses too",
        ),
        (true, false) => (
            Severity::Warning,
            same_pose,
            "repeat joint positions of the fit",
        ),
        (true, true) => return None,
    };
    let text = format!("{} of {} held-out rows {what}", rows.len(), held_out.len());
    let remedy = "validate with poses that were not fitted";
    Some(Finding::new("held-out-in-training", severity, "validation", text, remedy).at_rows(rows))
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
