//! Where the joints were: what the fitted recordings move, and what the held-out poses can verify of it.

use std::collections::BTreeSet;

use calib_profile::Usage;
use calib_report::{HeldOut, UnseenBody};
use calib_urdf::JointId;

use crate::prepare::inputs::{self, Inputs, Loaded};
use crate::prepare::slides::scales;
use crate::verify::unseen::Shown;

/// Smallest motion of a joint that counts, rad, or m where the robot is large: 2°, 35 mm.
const MOVED: f64 = 0.035;
/// Recordings in which a smaller share of the rows has two joints away from their usual places move one at a time.
const COMBINED: f64 = 0.1;
/// Held-out poses verify a joint that they move over at least this share of its fitted range.
const VERIFIED: f64 = 0.1;
/// Joint readings closer than this are one posture, rad, or m where the robot is large: three encoder steps of a good robot.
const SAME: f64 = 1e-3;
/// Readings of one posture differ by less than this many standard deviations of their noise.
const WITHIN: f64 = 4.0;

/// What moved.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Motions {
    /// One joint at a time moved in all fitted recordings, although several joints moved.
    pub(crate) fitted_one_by_one: bool,
    /// The same of the held-out poses.
    pub(crate) held_out_one_by_one: bool,
    /// Joints that the fitted recordings move and the held-out poses hardly do.
    pub(crate) still: Vec<String>,
    /// Bodies that the fitted recordings show and no held-out pose does.
    pub(crate) unseen: Vec<UnseenBody>,
    /// Held-out postures with an error that counts: what was rejected or lost verifies nothing.
    pub(crate) postures: usize,
    /// Those with a joint beyond the fitted range.
    pub(crate) outside: usize,
    /// Those that repeat a fitted posture within the noise of the readings.
    pub(crate) repeated: usize,
}

/// Of all recordings; `joint_sigma` is the noise of the readings that was found, rad, `verified` the errors that were measured on held-out poses.
pub(crate) fn motions(inputs: &Inputs, joint_sigma: f64, verified: Option<&HeldOut>) -> Motions {
    let model = &inputs.robot.model;
    let of = |validation: bool| -> Vec<&Loaded> {
        let recordings = inputs.recordings.values();
        recordings
            .filter(|r| (r.spec.usage == Usage::Validation) == validation)
            .collect()
    };
    let (fitted, held_out) = (of(false), of(true));
    let scales = scales(inputs);
    let counts = |joint: JointId| MOVED * scales[joint.index()];
    let moved: Vec<(JointId, (f64, f64))> = model
        .independent_joints()
        .filter_map(|joint| Some((joint, range(&fitted, joint)?)))
        .filter(|(joint, (low, high))| high - low > counts(*joint))
        .collect();
    let joints: Vec<JointId> = moved.iter().map(|(joint, _)| *joint).collect();
    let held_out_rows = rows(&held_out);
    let verified_rows = with_errors(&held_out, verified);
    let one_by_one = |recordings: &[&Loaded]| {
        joints.len() > 1
            && recordings.iter().any(|r| r.q.iter().flatten().count() > 1)
            && combined_share(recordings, &joints, &counts) < COMBINED
    };
    let beyond = |q: &&&Vec<f64>| {
        moved.iter().any(|(joint, (low, high))| {
            let at = q[joint.index()];
            at < low - counts(*joint) || at > high + counts(*joint)
        })
    };
    let shown = Shown::new(inputs);
    let unseen = match held_out_rows.is_empty() {
        true => Vec::new(),
        false => shown.unseen(inputs, &joints),
    };
    // Where no body that follows it is seen at all, that is what is said of a joint.
    let is_named = |joint: &JointId| {
        let mut unseen = unseen.iter();
        unseen.any(|body| body.joints.contains(&model.joint(*joint).name))
    };
    let still = moved.iter().filter(|(joint, (low, high))| {
        let rows = held_out.iter().flat_map(|loaded| {
            let rows = loaded.q.iter().enumerate();
            rows.filter(|(row, _)| shown.follows(loaded, *row, *joint))
                .filter_map(|(_, q)| q.as_ref())
        });
        let verified = inputs::range(rows, *joint).map_or(0.0, |(l, h)| h - l);
        verified < VERIFIED * (high - low) && !is_named(joint)
    });
    let still = still.map(|(joint, _)| model.joint(*joint).name.clone());
    Motions {
        fitted_one_by_one: one_by_one(&fitted),
        held_out_one_by_one: one_by_one(&held_out),
        still: if held_out_rows.is_empty() {
            Vec::new()
        } else {
            still.collect()
        },
        unseen,
        postures: verified_rows.len(),
        outside: verified_rows.iter().filter(beyond).count(),
        repeated: repeated(
            &verified_rows,
            rows(&fitted),
            &model.independent_joints().collect::<Vec<_>>(),
            &|joint| SAME.max(WITHIN * joint_sigma) * scales[joint.index()],
        ),
    }
}

fn rows<'a>(recordings: &[&'a Loaded]) -> Vec<&'a Vec<f64>> {
    let rows = recordings.iter().flat_map(|r| r.q.iter().flatten());
    rows.collect()
}

/// Joint positions of the held-out rows that have an error that counts.
fn with_errors<'a>(held_out: &[&'a Loaded], verified: Option<&HeldOut>) -> Vec<&'a Vec<f64>> {
    let errors = verified.into_iter().flat_map(|verified| &verified.poses);
    let counted = errors.filter(|error| !error.screened);
    let counted: BTreeSet<&str> = counted.map(|error| error.pose.as_str()).collect();
    let rows = held_out.iter().flat_map(|r| {
        let label = |row: usize| format!("{}:{}", r.name, r.poses.rows[row]);
        let rows = r.q.iter().enumerate();
        rows.filter(|(row, _)| counted.contains(label(*row).as_str()))
            .filter_map(|(_, q)| q.as_ref())
            .collect::<Vec<_>>()
    });
    rows.collect()
}

/// Smallest and largest position of a joint, where any is known.
fn range(recordings: &[&Loaded], joint: JointId) -> Option<(f64, f64)> {
    inputs::range(rows(recordings).into_iter(), joint)
}

/// Share of the rows in which two joints are away from where they usually are in their recording.
fn combined_share(
    recordings: &[&Loaded],
    joints: &[JointId],
    counts: &dyn Fn(JointId) -> f64,
) -> f64 {
    let (mut combined, mut all) = (0_usize, 0_usize);
    for loaded in recordings {
        let rows: Vec<&Vec<f64>> = loaded.q.iter().flatten().collect();
        let usual: Vec<f64> = joints
            .iter()
            .map(|joint| {
                let mut places: Vec<f64> = rows.iter().map(|q| q[joint.index()]).collect();
                places.sort_by(f64::total_cmp);
                places.get(places.len() / 2).copied().unwrap_or(0.0)
            })
            .collect();
        all += rows.len();
        for q in &rows {
            let away = joints.iter().zip(&usual);
            let away =
                away.filter(|(joint, usual)| (q[joint.index()] - **usual).abs() > counts(**joint));
            combined += usize::from(away.count() > 1);
        }
    }
    combined as f64 / all.max(1) as f64
}

/// How many of `rows` have a posture of `known` within the tolerance of every joint.
fn repeated(
    rows: &[&Vec<f64>],
    mut known: Vec<&Vec<f64>>,
    joints: &[JointId],
    tolerance: &dyn Fn(JointId) -> f64,
) -> usize {
    // Sorted by the joint that moves most, few are left to compare.
    let spread = |joint: &JointId| {
        let at = known.iter().map(|q| q[joint.index()]);
        let (low, high) = at.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), q| {
            (l.min(q), h.max(q))
        });
        high - low
    };
    let Some((key, near)) = joints
        .iter()
        .max_by(|a, b| spread(a).total_cmp(&spread(b)))
        .map(|joint| (joint.index(), tolerance(*joint)))
    else {
        return 0;
    };
    known.sort_by(|a, b| a[key].total_cmp(&b[key]));
    let repeats = |q: &&&Vec<f64>| {
        let first = known.partition_point(|k| k[key] < q[key] - near);
        let mut candidates = known[first..]
            .iter()
            .take_while(|k| k[key] <= q[key] + near);
        candidates.any(|k| {
            let mut joints = joints.iter();
            joints.all(|j| (k[j.index()] - q[j.index()]).abs() <= tolerance(*j))
        })
    };
    rows.iter().filter(repeats).count()
}
