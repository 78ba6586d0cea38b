//! Along the rows: rotations that are none, flips, jumps, gaps, rows that were not settled.

use super::Expectations;
use super::statistics::{median, range};
use crate::JointUnit;
use crate::finding::{Finding, Severity, counted};
use crate::poses::Poses;
use nalgebra::{Point3, Vector3};

/// Departure of a quaternion's length from 1 that rounding explains.
const UNIT: f64 = 1e-6;
/// Turn between neighbouring rows, rad (100°), that is a flip when …
const FLIP: f64 = 1.75;
/// … it is this many times the usual turn between rows.
const FLIP_RATIO: f64 = 4.0;
/// … and the body's origin moves less than this many times its usual step.
const FLIP_STEP_RATIO: f64 = 4.0;
/// Second difference of a smooth track: this many times its median …
const JUMP_RATIO: f64 = 40.0;
/// … and at least this, m, is a jump.
const JUMP: f64 = 5e-3;
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
            let text = format!(
                "{} quaternions are up to {worst:.2e} from length 1",
                rows.len()
            );
            let remedy = "normalise them where they are made; check the order of the columns";
            findings.push(
                Finding::new("not-unit-rotation", Severity::Error, name, text, remedy)
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
            let text = format!(
                "turns by more than {:.0}° between rows {} times, {:.1}° is usual",
                FLIP.to_degrees(),
                flips.len(),
                usual_turn.to_degrees()
            );
            let remedy =
                "its marker pattern is nearly symmetric: move a marker; drop the flipped rows";
            findings.push(
                Finding::new("body-flip", Severity::Error, name, text, remedy).at_rows(flips),
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

/// Steps in a track that should be smooth; only where rows have a time.
pub(super) fn jumps(poses: &Poses) -> Vec<Finding> {
    if poses.t.is_none() {
        return Vec::new();
    }
    let markers = poses.markers.iter().map(|(name, track)| {
        (
            name,
            track
                .iter()
                .map(|p| p.map(|p| p.coords))
                .collect::<Vec<_>>(),
        )
    });
    let bodies = poses.bodies.iter().map(|(name, track)| {
        (
            name,
            track
                .iter()
                .map(|p| p.map(|p| p.translation.vector))
                .collect::<Vec<_>>(),
        )
    });
    let mut findings = Vec::new();
    for (name, track) in markers.chain(bodies) {
        // Three neighbouring rows: |p₁ − 2 p₂ + p₃|
        let bends: Vec<(usize, f64)> = (1..track.len().saturating_sub(1))
            .filter(|&i| together(poses, i - 1, i) && together(poses, i, i + 1))
            .filter_map(|i| Some((i, (track[i - 1]? - track[i]? * 2.0 + track[i + 1]?).norm())))
            .collect();
        let Some(usual) = median(bends.iter().map(|b| b.1).collect()) else {
            continue;
        };
        let limit = (JUMP_RATIO * usual).max(JUMP);
        let rows: Vec<u64> = bends
            .iter()
            .filter(|(_, bend)| *bend > limit)
            .map(|(i, _)| poses.rows[*i])
            .collect();
        if !rows.is_empty() {
            let worst = bends.iter().map(|b| b.1).fold(0.0, f64::max);
            let text = format!(
                "jumps by up to {:.1} mm against its neighbours, {:.3} mm is usual",
                worst * 1e3,
                usual * 1e3
            );
            let remedy = "a reflection or another marker was taken for it: drop these samples";
            findings
                .push(Finding::new("jump", Severity::Warning, name, text, remedy).at_rows(rows));
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
            let text = format!(
                "{} in time, the longest {longest:.3} s; {usual:.4} s is usual",
                counted(gaps.len(), "gap")
            );
            let remedy = "the tracker or its network dropped frames: use a cable, or a lower rate";
            findings.push(
                Finding::new("time-gap", Severity::Warning, "time", text, remedy)
                    .at_rows(gaps.iter().map(|&i| poses.rows[i + 1])),
            );
        }
    }
    let lost_of = |name: &String, seen: usize, findings: &mut Vec<Finding>| {
        let lost = poses.len() - seen.min(poses.len());
        if lost as f64 > MANY_LOST * poses.len() as f64 {
            let text = format!(
                "lost (or only interpolated) in {lost} of {} rows",
                poses.len()
            );
            let remedy = "move the cameras or the marker, or leave it out";
            findings.push(Finding::new(
                "many-lost",
                Severity::Warning,
                name,
                text,
                remedy,
            ));
        }
    };
    for (name, track) in &poses.markers {
        lost_of(name, track.iter().flatten().count(), &mut findings);
    }
    for (name, track) in &poses.bodies {
        lost_of(name, track.iter().flatten().count(), &mut findings);
    }
    findings
}

/// Rows of one hold (label `hold`) that differ by more than noise.
pub(super) fn unsettled(poses: &Poses, expected: &Expectations) -> Vec<Finding> {
    if !poses.labels.contains_key("hold") {
        return Vec::new();
    }
    let sigma = expected.marker_sigma.unwrap_or(COARSE_SIGMA);
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
            rows.iter()
                .filter_map(|&i| track[i])
                .map(|p: Point3<f64>| p.coords)
                .collect()
        });
        let bodies = poses.bodies.values().map(|track| {
            rows.iter()
                .filter_map(|&i| track[i])
                .map(|p| p.translation.vector)
                .collect()
        });
        let worst = markers.chain(bodies).map(spread).fold(0.0, f64::max);
        // The range of n Gaussian values is below 2·(3 + log n) σ.
        let usual = 2.0 * sigma * (UNSETTLED_SIGMAS / 2.0 + (rows.len() as f64).ln());
        if worst > usual {
            let text = format!(
                "hold `{hold}`: the tracker's values spread over {:.2} mm, noise explains {:.2} mm",
                worst * 1e3,
                usual * 1e3
            );
            let remedy = "wait longer before recording, or drop the first rows of the hold";
            findings.push(
                Finding::new("unsettled-rows", Severity::Warning, hold, text, remedy)
                    .at_rows(rows.iter().map(|&i| poses.rows[i])),
            );
        }
    }
    findings
}
