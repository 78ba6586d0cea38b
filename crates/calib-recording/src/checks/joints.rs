//! Joints: enough of them, in the right unit, inside their limits, over the range asked for.

use super::Expectations;
use super::statistics::range;
use crate::finding::{Finding, Severity, counted};
use crate::model::JointUnit;
use crate::poses::Poses;
use std::f64::consts::TAU;

/// A joint that turned less than this, rad (0.06°) — or slid less, m — did not move: encoders flicker by less.
const STILL: f64 = 1e-3;
/// How far beyond a limit a joint may be: controllers overshoot by about this, rad or m.
const OVER_LIMIT: f64 = 2e-3;
/// Part of the asked range that must be covered. Grids of ten steps end half a step early.
const COVERED: f64 = 0.9;
/// Revolute joints turn at most this often to either side; more is degrees taken for radians.
const MAX_TURNS: f64 = 1.5;

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
        let text = format!(
            "{} with a tracked body or marker; the fit needs {}",
            counted(usable, "row"),
            expected.min_poses
        );
        Finding::new(
            "too-few-poses",
            Severity::Error,
            "recording",
            text,
            "record more poses",
        )
    })
}

pub(super) fn units(poses: &Poses, expected: &Expectations) -> Vec<Finding> {
    let mut findings = Vec::new();
    for (joint, q) in &poses.joints {
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
        let too_large =
            largest > MAX_TURNS * TAU && limit.is_none_or(|limit| largest > 2.0 * limit);
        if too_large {
            let text = format!("reaches {largest:.1} rad ({:.1} turns)", largest / TAU);
            let remedy = "are these degrees? name the column `…_deg`, or set `angles: deg` in the column map";
            let rows =
                (0..poses.len()).filter(|&i| q[i].is_some_and(|q| q.abs() > MAX_TURNS * TAU));
            let finding = Finding::new("unit-mismatch", Severity::Error, joint, text, remedy);
            findings.push(finding.at_rows(rows.map(|i| poses.rows[i])));
        } else if let Some((from, to)) = expected.asked.get(joint) {
            // Radians read as degrees: the range is 57.3 times too small.
            let ratio = (to - from) / (high - low).max(f64::MIN_POSITIVE);
            if (45.0..75.0).contains(&ratio) {
                let text = format!(
                    "moved {:.2}°, {:.0}° were asked for: a ratio of {ratio:.1}",
                    (high - low).to_degrees(),
                    (to - from).to_degrees()
                );
                let remedy = "are these radians? name the column `…_rad`, or set `angles: rad` in the column map";
                findings.push(Finding::new(
                    "unit-mismatch",
                    Severity::Error,
                    joint,
                    text,
                    remedy,
                ));
            }
        }
    }
    findings
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
        let unit = unit(poses, joint);
        let text = format!(
            "{} outside its limits {low:.4}..{high:.4} {unit}, e.g. {:.4} {unit}",
            counted(rows.len(), "row"),
            worst.unwrap_or_default()
        );
        let remedy =
            "check the joint's name, sign and zero, or the limits in the robot's description";
        findings.push(
            Finding::new("joint-outside-limits", Severity::Error, joint, text, remedy)
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
        let unit = unit(poses, joint);
        let Some((low, high)) = range(q.iter().flatten().copied()) else {
            findings.push(never_moved(joint, "has no values".to_string()));
            continue;
        };
        if high - low < STILL {
            findings.push(never_moved(
                joint,
                format!("stays at {low:.4} {unit} in all rows"),
            ));
            continue;
        }
        let covered = (high.min(to) - low.max(from)).max(0.0) / (to - from).max(f64::MIN_POSITIVE);
        if covered < COVERED {
            let text = format!(
                "covers {low:.3}..{high:.3} {unit} of the {from:.3}..{to:.3} {unit} asked for ({:.0} %)",
                100.0 * covered
            );
            let remedy = "sweep the whole range, or ask for less in the profile";
            findings.push(Finding::new(
                "coverage",
                Severity::Warning,
                joint,
                text,
                remedy,
            ));
        }
    }
    findings
}

fn never_moved(joint: &str, text: String) -> Finding {
    let remedy =
        "check that the column is the measured position of this joint, and that it was swept";
    Finding::new("joint-never-moved", Severity::Error, joint, text, remedy)
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
                let text = format!("equals `{b}` in all {both} rows");
                let remedy = "one column was written twice: check the export; a mimic joint need not be recorded";
                findings.push(Finding::new(
                    "joint-duplicate",
                    Severity::Warning,
                    *a,
                    text,
                    remedy,
                ));
            }
        }
    }
    findings
}

fn unit(poses: &Poses, joint: &str) -> &'static str {
    if poses.joint_units.get(joint) == Some(&JointUnit::Length) {
        "m"
    } else {
        "rad"
    }
}
