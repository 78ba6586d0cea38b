//! Along the rows: rotations that are none, flips, jumps, gaps, rows that were not settled.

use super::Expectations;
use crate::statistics::{median, range, written_step};
use calib_finding::{About, Fact, Finding, Subject, catalog};
use calib_recording::{JointUnit, Poses};
use nalgebra::{Point3, Vector3};

/// Departure of a quaternion's length from 1 that rounding explains.
const UNIT: f64 = 1e-6;
/// Turn between neighboring rows, rad (100°), that is a flip when …
const FLIP: f64 = 1.75;
/// … it is this many times the usual turn between rows.
const FLIP_RATIO: f64 = 4.0;
/// … and the body's origin moves less than this many times its usual step.
const FLIP_STEP_RATIO: f64 = 4.0;
/// Second difference of a smooth track: this many times its median …
const JUMP_RATIO: f64 = 40.0;
/// … and at least this, m, is a jump.
const JUMP: f64 = 5e-3;
/// Farthest place of a marker from an axis that moves it, m: no arm before one tracker reaches farther.
const REACH: f64 = 3.0;
/// Time step, in units of the median step, that is a gap.
const GAP: f64 = 1.75;
/// Part of the rows that a marker or body may be lost in.
const MANY_LOST: f64 = 0.5;
/// Scatter within a hold, in units of σ, that shows movement.
const UNSETTLED_SIGMAS: f64 = 6.0;
/// σ of a marker coordinate when nothing is known, m: a bad tracker.
const COARSE_SIGMA: f64 = 5e-4;

pub(super) fn rotations(poses: &Poses) -> Vec<Finding> {
    let mut findings = Vec::new();
    for (name, track) in &poses.bodies {
        let off = |i: usize| track[i].map_or(0.0, |pose| (pose.rotation.coords.norm() - 1.0).abs());
        let rows: Vec<usize> = (0..track.len())
            .filter(|&i| off(i) > UNIT || off(i).is_nan())
            .collect();
        if !rows.is_empty() {
            let worst = rows.iter().map(|&i| off(i)).fold(0.0, f64::max);
            findings.push(
                Finding::of_kind(catalog::NOT_UNIT_ROTATION, "kept", Subject::body(name))
                    .with("count", Fact::count(rows.len()))
                    .with("worst", Fact::ratio(worst))
                    .at_rows(rows.iter().map(|&i| poses.rows[i])),
            );
        }
    }
    findings
}

/// Whether rows belong to one motion: a table that names its holds says nothing of the ways between them.
fn together(poses: &Poses, a: usize, b: usize) -> bool {
    let names = poses.labels.get("hold");
    names.is_none_or(|names| names.get(a) == names.get(b))
}

/// A body that turns by half a turn or so on the spot: its marker pattern is nearly symmetric.
pub(super) fn flips(poses: &Poses) -> Vec<Finding> {
    let mut findings = Vec::new();
    for (name, track) in &poses.bodies {
        let seen: Vec<usize> = (0..track.len()).filter(|&i| track[i].is_some()).collect();
        let step = |w: &[usize]| Some((w[0], w[1], track[w[0]]?, track[w[1]]?));
        let steps: Vec<(usize, f64, f64)> = seen
            .windows(2)
            .filter(|w| together(poses, w[0], w[1]))
            .filter_map(step)
            .map(|(before, row, a, b)| {
                // What the joints turned between the rows needs no flip (a sweep that starts its next line).
                let turned = joints_turned(poses, before, row);
                (
                    row,
                    (a.rotation.angle_to(&b.rotation) - turned).max(0.0),
                    (a.translation.vector - b.translation.vector).norm(),
                )
            })
            .collect();
        let usual_turn = median(steps.iter().map(|s| s.1).collect()).unwrap_or(0.0);
        let usual_step = median(steps.iter().map(|s| s.2).collect()).unwrap_or(0.0);
        let flips: Vec<u64> = steps
            .iter()
            .filter(|(_, turn, step)| {
                *turn > FLIP
                    && *turn > FLIP_RATIO * usual_turn
                    && *step < FLIP_STEP_RATIO * usual_step + 0.02
            })
            .map(|(row, _, _)| poses.rows[*row])
            .collect();
        if !flips.is_empty() {
            findings.push(
                Finding::of_kind(catalog::BODY_FLIP, "rows", Subject::body(name))
                    .with("limit", Fact::radians(FLIP))
                    .with("count", Fact::count(flips.len()))
                    .with("usual", Fact::radians(usual_turn))
                    .at_rows(flips),
            );
        }
    }
    findings
}

/// Sum of what the recorded joints turned between two rows, rad: the most that a body on the robot can turn.
fn joints_turned(poses: &Poses, before: usize, after: usize) -> f64 {
    let turned = poses.joints.iter().filter_map(|(name, q)| {
        let is_angle = poses.joint_units.get(name) != Some(&JointUnit::Length);
        Some((q[after]? - q[before]?).abs()).filter(|_| is_angle)
    });
    turned.sum()
}

/// The largest second difference of a point that the joints' readings of three rows explain, m.
///
/// ```text
/// |Δ²p| ≤ Σ_j r (|Δ²q_j|) + r (Σ_j |Δq_j|)²,   r: reach; 1 and 0 for joints that slide                        (1)
/// ```
fn joints_bend(poses: &Poses, row: usize) -> f64 {
    let (mut bends, mut turns) = (0.0, 0.0);
    for (name, q) in &poses.joints {
        let (Some(a), Some(b), Some(c)) = (q[row - 1], q[row], q[row + 1]) else {
            continue;
        };
        let bend = (a - 2.0 * b + c).abs();
        if poses.joint_units.get(name) == Some(&JointUnit::Length) {
            bends += bend;
        } else {
            bends += REACH * bend;
            turns += (b - a).abs().max((c - b).abs());
        }
    }
    bends + REACH * turns * turns
}

/// Steps in a track that should be smooth; only where rows have a time.
pub(super) fn jumps(poses: &Poses) -> Vec<Finding> {
    if poses.t.is_none() {
        return Vec::new();
    }
    let markers = poses.markers.iter().map(|(name, track)| {
        (
            Subject::marker(name),
            track
                .iter()
                .map(|p| p.map(|p| p.coords))
                .collect::<Vec<_>>(),
        )
    });
    let bodies = poses.bodies.iter().map(|(name, track)| {
        (
            Subject::body(name),
            track
                .iter()
                .map(|p| p.map(|p| p.translation.vector))
                .collect::<Vec<_>>(),
        )
    });
    let mut findings = Vec::new();
    for (subject, track) in markers.chain(bodies) {
        // Three neighboring rows: |p₁ − 2 p₂ + p₃|
        let bends: Vec<(usize, f64)> = (1..track.len().saturating_sub(1))
            .filter(|&i| together(poses, i - 1, i) && together(poses, i, i + 1))
            .filter_map(|i| Some((i, (track[i - 1]? - track[i]? * 2.0 + track[i + 1]?).norm())))
            .collect();
        let Some(usual) = median(bends.iter().map(|b| b.1).collect()) else {
            continue;
        };
        let limit = (JUMP_RATIO * usual).max(JUMP);
        // A robot that starts or stops between two rows is no jump of the track.
        let jump = |(i, bend): &&(usize, f64)| *bend > limit.max(JUMP + joints_bend(poses, *i));
        let jumped: Vec<&(usize, f64)> = bends.iter().filter(jump).collect();
        let rows: Vec<u64> = jumped.iter().map(|(i, _)| poses.rows[*i]).collect();
        if !rows.is_empty() {
            let worst = jumped.iter().map(|b| b.1).fold(0.0, f64::max);
            findings.push(
                Finding::new(catalog::JUMP, subject)
                    .with("worst", Fact::meters(worst))
                    .with("usual", Fact::meters(usual))
                    .at_rows(rows),
            );
        }
    }
    findings
}

pub(super) fn gaps(poses: &Poses) -> Vec<Finding> {
    let mut findings = Vec::new();
    if let Some(t) = &poses.t {
        let steps: Vec<f64> = t.windows(2).map(|w| w[1] - w[0]).collect();
        let usual = median(steps.clone()).unwrap_or(0.0);
        let gaps: Vec<usize> = (0..steps.len())
            .filter(|&i| usual > 0.0 && steps[i] > GAP * usual && together(poses, i, i + 1))
            .collect();
        if !gaps.is_empty() {
            let longest = gaps.iter().map(|&i| steps[i]).fold(0.0, f64::max);
            findings.push(
                Finding::new(catalog::TIME_GAP, About::Time)
                    .with("gaps", Fact::count(gaps.len()))
                    .with("longest", Fact::seconds(longest))
                    .with("usual", Fact::seconds(usual))
                    .at_rows(gaps.iter().map(|&i| poses.rows[i + 1])),
            );
        }
    }
    let seen_markers = poses
        .markers
        .iter()
        .map(|(name, track)| (Subject::marker(name), track.iter().flatten().count()));
    let seen_bodies = poses
        .bodies
        .iter()
        .map(|(name, track)| (Subject::body(name), track.iter().flatten().count()));
    for (subject, seen) in seen_markers.chain(seen_bodies) {
        let lost = poses.len() - seen.min(poses.len());
        if lost as f64 > MANY_LOST * poses.len() as f64 {
            findings.push(
                Finding::new(catalog::MANY_LOST, subject)
                    .with("lost", Fact::count(lost))
                    .with("rows", Fact::count(poses.len())),
            );
        }
    }
    findings
}

/// Rows of one hold (label `hold`) that differ by more than noise.
pub(super) fn unsettled(poses: &Poses, expected: &Expectations) -> Vec<Finding> {
    if !poses.labels.contains_key("hold") {
        return Vec::new();
    }
    let sigma = expected.marker_sigma.unwrap_or(COARSE_SIGMA);
    let of_markers = poses.markers.values().map(|track| {
        let points = track.iter().flatten();
        written_step(points.flat_map(|p| p.iter().copied()))
    });
    let of_bodies = poses.bodies.values().map(|track| {
        let places = track.iter().flatten().map(|p| &p.translation.vector);
        written_step(places.flat_map(|p| p.iter().copied()))
    });
    // In the order of the tracks below.
    let steps: Vec<f64> = of_markers.chain(of_bodies).collect();
    let mut findings = Vec::new();
    for (hold, rows) in poses
        .groups("hold")
        .into_iter()
        .filter(|(hold, rows)| !hold.is_empty() && rows.len() >= 3)
    {
        let spread = |points: Vec<Vector3<f64>>| {
            let axis =
                |k: usize| range(points.iter().map(|p| p[k])).map_or(0.0, |(low, high)| high - low);
            axis(0).max(axis(1)).max(axis(2))
        };
        let markers = poses.markers.values().map(|track| {
            let here = rows.iter().filter_map(|&i| track[i]);
            here.map(|p: Point3<f64>| p.coords).collect()
        });
        let bodies = poses.bodies.values().map(|track| {
            let here = rows.iter().filter_map(|&i| track[i]);
            here.map(|p| p.translation.vector).collect()
        });
        // The range of rounded values is at most a step larger than that of the values.
        let beyond = |(points, step): (Vec<Vector3<f64>>, &f64)| (spread(points) - step).max(0.0);
        let tracks = markers.chain(bodies).zip(&steps);
        let worst = tracks.map(beyond).fold(0.0, f64::max);
        // The range of n Gaussian values is below 2·(3 + log n) σ.
        let usual = 2.0 * sigma * (UNSETTLED_SIGMAS / 2.0 + (rows.len() as f64).ln());
        if worst > usual {
            findings.push(
                Finding::of_kind(
                    catalog::UNSETTLED_ROWS,
                    "spread",
                    About::Hold(hold.to_string()),
                )
                .with("spread", Fact::meters(worst))
                .with("limit", Fact::meters(usual))
                .at_rows(rows.iter().map(|&i| poses.rows[i])),
            );
        }
    }
    findings
}
