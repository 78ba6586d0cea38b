//! Joints: enough of them, in the right unit and with enough digits, inside their limits, over the range asked for.

use super::Expectations;
use crate::statistics::range;
use calib_finding::{Fact, Finding, Subject, Unit, catalog};
use calib_recording::{JointUnit, Poses};
use std::f64::consts::TAU;

/// A joint that turned less than this, rad (0.06°) — or slid less, m — did not move: encoders flicker by less.
const STILL: f64 = 1e-3;
/// How far beyond a limit a joint may be: controllers overshoot by about this, rad or m.
const OVER_LIMIT: f64 = 2e-3;
/// Fewer readings that a full turn brings inside are single mistakes.
const WRAPPED: usize = 3;
/// Part of the asked range that must be covered. Grids of ten steps end half a step early.
const COVERED: f64 = 0.9;
/// Steps that programs round angles to, rad, largest first: 1°, 0.01 rad, 0.5°, 0.1°, 0.001 rad, 0.05°. Finer ones hide behind encoders.
const ROUNDED: [f64; 6] = [
    1.0,
    0.572_957_795_130_823_2,
    0.5,
    0.1,
    0.057_295_779_513_082_32,
    0.05,
];
/// The same of lengths, m.
const ROUNDED_LENGTH: [f64; 3] = [1e-3, 5e-4, 1e-4];
/// Different readings that show their last digit.
const READINGS: usize = 12;
/// Part of readings that are whole fives of the last digit: a fifth by chance, nearly all of postures that were asked for in round numbers.
const FIVES: f64 = 0.5;
/// Revolute joints turn at most this often to either side; more is degrees taken for radians.
const MAX_TURNS: f64 = 1.5;
/// The same of joints without limits, which count their turns: turntables go round a few times. Fewer turns are told by how the bodies moved.
const MAX_TURNS_FREE: f64 = 10.0;

pub(super) fn too_few(poses: &Poses, expected: &Expectations) -> Option<Finding> {
    let usable = (0..poses.len())
        .filter(|&row| {
            poses.bodies.values().any(|track| track[row].is_some())
                || poses.markers.values().any(|track| track[row].is_some())
        })
        .count();
    let has_tracker = !poses.bodies.is_empty() || !poses.markers.is_empty();
    let usable = if has_tracker { usable } else { poses.len() };
    (usable < expected.min_poses).then(|| {
        Finding::new(catalog::TOO_FEW_POSES, Subject::default())
            .with("usable", Fact::count(usable))
            .with("needed", Fact::count(expected.min_poses))
    })
}

pub(super) fn units(poses: &Poses, expected: &Expectations) -> Vec<Finding> {
    let mut findings = Vec::new();
    for (joint, q) in &poses.joints {
        findings.extend(rounded(poses, joint, q));
        if poses.joint_units.get(joint) == Some(&JointUnit::Length) {
            continue;
        }
        let Some((low, high)) = range(q.iter().flatten().copied()) else {
            continue;
        };
        let largest = low.abs().max(high.abs());
        let limit = expected
            .limits
            .get(joint)
            .map(|(low, high)| low.abs().max(high.abs()));
        let most = match limit {
            Some(limit) => (MAX_TURNS * TAU).max(2.0 * limit),
            None => MAX_TURNS_FREE * TAU,
        };
        if largest > most {
            let is_large = |q: &Option<f64>| q.is_some_and(|q| q.abs() > MAX_TURNS * TAU);
            let rows = (0..poses.len()).filter(|&i| is_large(&q[i]));
            findings.push(
                Finding::of_kind(catalog::UNIT_MISMATCH, "degrees", Subject::joint(joint))
                    .with("largest", Fact::radians(largest))
                    .at_rows(rows.map(|i| poses.rows[i])),
            );
        } else if let Some((from, to)) = expected.asked.get(joint) {
            // Radians read as degrees: the range is 57.3 times too small.
            let ratio = (to - from) / (high - low).max(f64::MIN_POSITIVE);
            if (45.0..75.0).contains(&ratio) {
                findings.push(
                    Finding::of_kind(catalog::UNIT_MISMATCH, "radians", Subject::joint(joint))
                        .with("moved", Fact::radians(high - low))
                        .with("asked", Fact::radians(to - from))
                        .with("ratio", Fact::ratio(ratio)),
                );
            }
        }
    }
    findings
}

/// Readings that were rounded when they were written.
fn rounded(poses: &Poses, joint: &str, q: &[Option<f64>]) -> Option<Finding> {
    /// Part of a step: what is left of decimals that were read in another unit.
    const EXACT: f64 = 1e-5;
    let unit = unit(poses, joint);
    let steps: Vec<f64> = match unit {
        Unit::Meter => ROUNDED_LENGTH.to_vec(),
        _ => ROUNDED.iter().map(|step| step.to_radians()).collect(),
    };
    let is_whole = |x: f64| (x - x.round()).abs() < EXACT;
    let all = |step: f64| q.iter().flatten().all(|q| is_whole(q / step));
    let step = steps.into_iter().find(|step| all(*step))?;
    let mut readings: Vec<i64> = q
        .iter()
        .flatten()
        .map(|q| (q / step).round() as i64)
        .collect();
    readings.sort_unstable();
    readings.dedup();
    let fives = readings.iter().filter(|k| *k % 5 == 0).count();
    let shown = readings.len() >= READINGS && (fives as f64) < FIVES * readings.len() as f64;
    shown.then(|| {
        Finding::new(catalog::JOINT_ROUNDED, Subject::joint(joint))
            .with("step", Fact::number(step, unit))
            // Equally likely within half a step.
            .with("sigma", Fact::number(step / 12f64.sqrt(), unit))
    })
}

pub(super) fn limits(poses: &Poses, expected: &Expectations) -> Vec<Finding> {
    let mut findings = Vec::new();
    for (joint, q) in &poses.joints {
        let Some(&(low, high)) = expected.limits.get(joint) else {
            continue;
        };
        let outside = |q: f64| q < low - OVER_LIMIT || q > high + OVER_LIMIT;
        let rows: Vec<u64> = (0..poses.len())
            .filter(|&i| q[i].is_some_and(outside))
            .map(|i| poses.rows[i])
            .collect();
        if rows.is_empty() {
            continue;
        }
        let worst = q
            .iter()
            .flatten()
            .copied()
            .filter(|&q| outside(q))
            .max_by(|a, b| (a - low).max(high - a).total_cmp(&(b - low).max(high - b)));
        let amount = |value: f64| Fact::number(value, unit(poses, joint));
        // A full turn more or less brings every reading inside.
        let turns = unit(poses, joint) == Unit::Radian;
        let inside = |q: f64| !outside(q + TAU) || !outside(q - TAU);
        let wraps =
            turns && rows.len() >= WRAPPED && q.iter().flatten().all(|&q| !outside(q) || inside(q));
        let kind = if wraps { "wraps" } else { "beyond" };
        findings.push(
            Finding::of_kind(catalog::JOINT_OUTSIDE_LIMITS, kind, Subject::joint(joint))
                .with("rows", Fact::count(rows.len()))
                .with("low", amount(low))
                .with("high", amount(high))
                .with("worst", amount(worst.unwrap_or_default()))
                .at_rows(rows),
        );
    }
    findings
}

pub(super) fn coverage(poses: &Poses, expected: &Expectations) -> Vec<Finding> {
    let mut findings = Vec::new();
    for (joint, &(from, to)) in &expected.asked {
        let Some(q) = poses.joints.get(joint) else {
            continue;
        };
        let amount = |value: f64| Fact::number(value, unit(poses, joint));
        let still =
            |kind| Finding::of_kind(catalog::JOINT_NEVER_MOVED, kind, Subject::joint(joint));
        let Some((low, high)) = range(q.iter().flatten().copied()) else {
            findings.push(still("empty"));
            continue;
        };
        if high - low < STILL {
            findings.push(still("still").with("at", amount(low)));
            continue;
        }
        let covered = (high.min(to) - low.max(from)).max(0.0) / (to - from).max(f64::MIN_POSITIVE);
        if covered < COVERED {
            findings.push(
                Finding::new(catalog::COVERAGE, Subject::joint(joint))
                    .with("low", amount(low))
                    .with("high", amount(high))
                    .with("from", amount(from))
                    .with("to", amount(to))
                    .with("share", Fact::ratio(covered)),
            );
        }
    }
    findings
}

/// Two joints that move and are equal in every row.
pub(super) fn duplicates(poses: &Poses) -> Vec<Finding> {
    let joints: Vec<(&String, &Vec<Option<f64>>)> = poses.joints.iter().collect();
    let mut findings = Vec::new();
    for (i, (a, q_a)) in joints.iter().enumerate() {
        let moved =
            range(q_a.iter().flatten().copied()).is_some_and(|(low, high)| high - low > STILL);
        for (b, q_b) in joints[..i].iter().filter(|_| moved) {
            let both = q_a.iter().flatten().count();
            if both >= 3 && q_a == q_b {
                findings.push(
                    Finding::new(catalog::JOINT_DUPLICATE, Subject::joint(*a))
                        .with("other", Fact::name(*b))
                        .with("rows", Fact::count(both)),
                );
            }
        }
    }
    findings
}

fn unit(poses: &Poses, joint: &str) -> Unit {
    match poses.joint_units.get(joint) {
        Some(JointUnit::Length) => Unit::Meter,
        _ => Unit::Radian,
    }
}
