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
/// … and the body's origin stays within a marker pattern, m, beyond what the joints carry it. A rotation of 100° about an axis that is
/// 65 mm or more away from the body carries it farther.
const PATTERN: f64 = 0.1;
/// Where no joint is recorded: a body moves by up to this many times its usual step between rows.
const STEP_RATIO: f64 = 4.0;
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

/// What a body and the joints did between neighboring rows.
struct Between {
    /// Index of the later row.
    row: usize,
    /// Turn of the body beyond what the joints turned, rad.
    turn: f64,
    /// Way of the body's origin, m.
    step: f64,
    /// What the joints turned, rad.
    turned: f64,
    /// What the joints slid, m.
    slid: f64,
}

/// A body that turns by half a turn or so on the spot: its marker pattern is nearly symmetric.
///
/// A body that moves away while it turns was carried by the robot, whatever the joints are said to have done: a logger that hung, a
/// column that is missing. Where most of the sudden turns are of this kind, so are the few that end near their start by chance.
pub(super) fn flips(poses: &Poses, expected: &Expectations) -> Vec<Finding> {
    let mut findings = Vec::new();
    for (name, track) in &poses.bodies {
        let seen: Vec<usize> = (0..track.len()).filter(|&i| track[i].is_some()).collect();
        let between = |w: &[usize]| {
            let (before, row) = (w[0], w[1]);
            let (a, b) = (track[before]?, track[row]?);
            let (turned, slid) = joints_moved(poses, expected, before, row);
            Some(Between {
                row,
                // What the joints turned between the rows needs no flip (a sweep that starts its next line).
                turn: (a.rotation.angle_to(&b.rotation) - turned).max(0.0),
                step: (a.translation.vector - b.translation.vector).norm(),
                turned,
                slid,
            })
        };
        let steps: Vec<Between> = seen
            .windows(2)
            .filter(|w| together(poses, w[0], w[1]))
            .filter_map(between)
            .collect();
        let usual_turn = median(steps.iter().map(|s| s.turn).collect()).unwrap_or(0.0);
        let carried = carried(poses, &steps);
        let (on_the_spot, away): (Vec<&Between>, Vec<&Between>) = steps
            .iter()
            .filter(|s| s.turn > FLIP && s.turn > FLIP_RATIO * usual_turn)
            .partition(|s| s.step < PATTERN + carried(s));
        if on_the_spot.len() > away.len() {
            findings.push(
                Finding::of_kind(catalog::BODY_FLIP, "rows", Subject::body(name))
                    .with("limit", Fact::radians(FLIP))
                    .with("count", Fact::count(on_the_spot.len()))
                    .with("usual", Fact::radians(usual_turn))
                    .at_rows(on_the_spot.iter().map(|s| poses.rows[s.row])),
            );
        }
    }
    findings
}

/// How far the joints carry a body's origin between two rows, m: as far for a turn as they usually do.
fn carried(poses: &Poses, steps: &[Between]) -> impl Fn(&Between) -> f64 + use<> {
    let usual_step = median(steps.iter().map(|s| s.step).collect()).unwrap_or(0.0);
    let without_joints = poses.joints.is_empty().then_some(STEP_RATIO * usual_step);
    let radii = steps.iter().filter(|s| s.turned > 0.0);
    let radii = radii.map(|s| (s.step - s.slid).max(0.0) / s.turned);
    let radius = median(radii.collect()).unwrap_or(0.0);
    move |s| without_joints.unwrap_or(radius * s.turned + s.slid)
}

/// Sums of what the recorded joints and those that mimic them turned, rad, and slid, m, between two rows: the most that a body on the robot can turn
/// and slide.
fn joints_moved(poses: &Poses, expected: &Expectations, before: usize, after: usize) -> (f64, f64) {
    let (mut turned, mut slid) = (0.0, 0.0);
    for (name, q) in &poses.joints {
        let (Some(a), Some(b)) = (q[before], q[after]) else {
            continue;
        };
        let by = (b - a).abs();
        if poses.joint_units.get(name) == Some(&JointUnit::Length) {
            slid += by;
        } else {
            turned += by;
        }
        if let Some([turn, slide]) = expected.followers.get(name) {
            turned += turn * by;
            slid += slide * by;
        }
    }
    (turned, slid)
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
