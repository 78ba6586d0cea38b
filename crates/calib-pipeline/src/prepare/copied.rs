//! Rows that are copies of earlier ones, in their own recording or in another one: the first counts.
//!
//! A table that was pasted twice, or listed under two names, would count each measurement as two independent ones, and every σ would come out too small.

use calib_checks::{copied_rows, repeated_rows};
use calib_finding::Finding;
use calib_profile::Usage;
use calib_report::RejectedFor;

use crate::prepare::excluded::Excluded;
use crate::prepare::inputs::{Inputs, Loaded};

/// Takes the copies out; a finding for each recording that has some.
pub(super) fn leave_out(inputs: &mut Inputs) {
    let all: Vec<&Loaded> = inputs.recordings.values().collect();
    let is_held_out = |loaded: &&&Loaded| loaded.spec.usage == Usage::Validation;
    let (held_out, mut fitted): (Vec<&Loaded>, Vec<&Loaded>) =
        all.iter().partition(|loaded| is_held_out(loaded));
    let origins = &inputs.robot.profile.origins;
    let is_swept = |loaded: &Loaded| origins.values().any(|origin| origin.sweep == loaded.name);
    // What an origin is found from is needed where it is: its rows in other recordings are the copies.
    fitted.sort_by_key(|loaded| !is_swept(loaded));
    // What is held out and copied from what is fitted is another matter.
    let groups = held_out.into_iter().map(|loaded| vec![loaded]);
    let groups = std::iter::once(fitted).chain(groups);
    let (mut findings, mut excluded) = (Vec::new(), Vec::new());
    for group in groups {
        let poses: Vec<_> = group.iter().map(|loaded| &loaded.poses).collect();
        for copied in copied_rows(&poses) {
            let own = group[copied.recording];
            let others = copied.of.iter().filter(|of| **of != copied.recording);
            let others: Vec<&str> = others.map(|of| group[*of].name.as_str()).collect();
            let used = is_swept(own) && !others.is_empty();
            findings.push(of(own, &copied.rows, &others, used));
            if !used {
                excluded.extend(measurements(own, &copied.rows));
            }
        }
    }
    inputs.exclude(excluded);
    inputs.findings.extend(findings);
}

fn of(own: &Loaded, rows: &[usize], others: &[&str], used: bool) -> Finding {
    repeated_rows(&own.poses, rows, others, used).in_recording(&own.name)
}

/// Everything that the tracker saw in these rows.
fn measurements(own: &Loaded, rows: &[usize]) -> Vec<Excluded> {
    let subjects = own.poses.markers.keys().chain(own.poses.bodies.keys());
    let of = |subject: &String| {
        let subject = subject.clone();
        let excluded = move |row: &usize| Excluded {
            recording: own.name.clone(),
            row: *row,
            body: subject.clone(),
            cause: RejectedFor::Copied,
        };
        rows.iter().map(excluded)
    };
    subjects.flat_map(of).collect()
}
