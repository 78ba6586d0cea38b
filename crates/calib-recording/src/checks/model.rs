//! Checks against the robot's model, whose predictions come as plain arrays.
//!
//! A body bolted to a link obeys `tracker_from_body_i = X · base_from_link_i · Y` with unknown, constant `X`, `Y`. The
//! relative motions of two rows are then conjugate, so they turn by the same angle θ and slide by the same length d
//! along their screw axis, whatever `X` and `Y` are:
//!
//! ```text
//! (θ, d) of tracker_from_body_i⁻¹ · tracker_from_body_j  =  (θ, d) of base_from_link_i⁻¹ · base_from_link_j    (1)
//! ```
//!
//! The angles alone do not tell an arm from its mirror image (one joint of three orthogonal ones with the other
//! sign); the slide does. It is compared in units of the arm's size: `√(Δθ² + (Δd/L)²)`, L the
//! median distance that the body moves.
//!
//! What this cannot see: a sign error of the only joint that moves (a mount turned by half a turn explains it), and
//! links between which no joint moved.

use super::statistics::median;
use crate::finding::{Finding, Severity, are, counted};
use crate::poses::Poses;
use crate::sync::OffsetOutcome;
use nalgebra::{Isometry3, Quaternion, UnitQuaternion, Vector3};

/// Disagreement, rad (1°), below which the model is not blamed: nominal robots are that good.
pub const GOOD_ENOUGH: f64 = 0.0175;
/// Another explanation must be this many times better.
const MUCH_BETTER: f64 = 4.0;
/// A row that disagrees with the others by this many times their usual disagreement does not belong to them.
const SPOILED_RATIO: f64 = 6.0;
/// Rows within this part of the worst leave together with it.
const NEARLY_WORST: f64 = 0.7;
/// Disagreement, rad (34°), that no motion between two readings explains.
const FLIPPED: f64 = 0.6;
/// Turn that counts, rad: pairs of rows that turned less say nothing.
const TURNED: f64 = 0.05;

/// Angles, rad, between which a motion's axis is known to about its rotation noise; at π its sign is open.
const WELL_TURNED: std::ops::Range<f64> = 0.4..2.9;

/// Predictions under one assumption, for the rows of a table.
#[derive(Clone, Debug)]
pub struct Prediction {
    /// What is assumed: a link's name, or `joint elbow with the other sign`.
    pub assumption: String,
    /// Id of the finding when this explains the data and the nominal prediction does not: `joint-sign`,
    /// `joint-order`, `wrong-mount`, `clock-lag`.
    pub id: &'static str,
    /// `base_from_link` per row.
    pub base_from_link: Vec<Isometry3<f64>>,
}

/// Median disagreement of the motions (1) over pairs of rows, rad; `None` when no pair turned.
pub fn disagreement(
    tracker_from_body: &[Option<Isometry3<f64>>],
    base_from_link: &[Isometry3<f64>],
) -> Option<f64> {
    median(
        pairs(tracker_from_body, base_from_link)
            .map(|(_, _, off)| off)
            .collect(),
    )
}

/// Pairs of rows that turned in one of the two, and by how much they disagree. At most a few thousand.
fn pairs<'a>(
    tracker_from_body: &'a [Option<Isometry3<f64>>],
    base_from_link: &'a [Isometry3<f64>],
) -> impl Iterator<Item = (usize, usize, f64)> + 'a {
    let n = tracker_from_body.len().min(base_from_link.len());
    // Every row with every other for small tables; with steps of growing size for long ones.
    let steps: Vec<usize> = if n <= 128 {
        (1..n).collect()
    } else {
        (0..24).map(|k| 1 + k * k * n / 1200).collect()
    };
    let size = size(tracker_from_body);
    steps
        .into_iter()
        .flat_map(move |step| (0..n.saturating_sub(step)).map(move |i| (i, i + step)))
        .filter_map(move |(i, j)| {
            let measured = screw(&tracker_from_body[i]?, &tracker_from_body[j]?);
            let predicted = screw(&base_from_link[i], &base_from_link[j]);
            let slides = measured.1.zip(predicted.1);
            let slide = slides.map_or(0.0, |(a, b)| (a - b) / size);
            (measured.0.max(predicted.0) > TURNED)
                .then(|| (i, j, (measured.0 - predicted.0).hypot(slide)))
        })
}

/// A body that stays within this of the middle of its way, m, sits on the joint's axis: its slide says little.
const SMALLEST_SIZE: f64 = 0.05;

/// Median distance of the body from the middle of its way, m: one size for all assumptions about its link.
fn size(tracker_from_body: &[Option<Isometry3<f64>>]) -> f64 {
    let places: Vec<Vector3<f64>> = tracker_from_body
        .iter()
        .flatten()
        .map(|pose| pose.translation.vector)
        .collect();
    let centre = places.iter().sum::<Vector3<f64>>() / places.len().max(1) as f64;
    let distances = places.iter().map(|place| (place - centre).norm());
    median(distances.collect())
        .unwrap_or(0.0)
        .max(SMALLEST_SIZE)
}

/// Angle of the motion from `a` to `b`, rad, and its slide along the axis, m, where the axis is well defined.
fn screw(a: &Isometry3<f64>, b: &Isometry3<f64>) -> (f64, Option<f64>) {
    let a_from_b = a.inverse() * b;
    let angle = a_from_b.rotation.angle();
    let axis = a_from_b
        .rotation
        .axis()
        .filter(|_| WELL_TURNED.contains(&angle));
    (
        angle,
        axis.map(|axis| a_from_b.translation.vector.dot(&axis)),
    )
}

/// Whether one of `alternatives` explains a body's track much better than the nominal prediction does.
pub fn better_explanation(
    body: &str,
    tracker_from_body: &[Option<Isometry3<f64>>],
    nominal: &Prediction,
    alternatives: &[Prediction],
) -> Option<Finding> {
    let as_claimed = disagreement(tracker_from_body, &nominal.base_from_link)?;
    if as_claimed < GOOD_ENOUGH {
        return None;
    }
    let judged = alternatives.iter().filter_map(|other| {
        Some((
            disagreement(tracker_from_body, &other.base_from_link)?,
            other,
        ))
    });
    let (off, best) = judged.min_by(|a, b| a.0.total_cmp(&b.0))?;
    if off * MUCH_BETTER > as_claimed {
        return None;
    }
    let text = format!(
        "its motion disagrees with {} by {:.2}°, with {} only by {:.2}°",
        nominal.assumption,
        as_claimed.to_degrees(),
        best.assumption,
        off.to_degrees()
    );
    let remedy = match best.id {
        "wrong-mount" => "correct the body's link in the profile",
        "joint-sign" => {
            "turn the sign of this joint's column, or of its axis in the robot's description"
        }
        "joint-order" => "exchange these joints' columns",
        "clock-lag" => "the joint values lag behind the tracker: synchronise, or record in holds",
        "unit-mismatch" => "correct the unit in the columns' names, or in the column map",
        _ => "check the profile",
    };
    Some(Finding::new(best.id, Severity::Error, body, text, remedy))
}

/// Whether a body's quaternions were written scalar first and read scalar last: then the exchanged ones explain the
/// robot's motion and these do not.
pub fn quaternion_order(
    body: &str,
    tracker_from_body: &[Option<Isometry3<f64>>],
    base_from_link: &[Isometry3<f64>],
) -> Option<Finding> {
    let as_read = disagreement(tracker_from_body, base_from_link)?;
    let exchange = |pose: &Isometry3<f64>| {
        // The file's w, x, y, z were taken for x, y, z, w.
        let c = pose.rotation.coords;
        let q = UnitQuaternion::from_quaternion(Quaternion::new(c.x, c.y, c.z, c.w));
        Isometry3::from_parts(pose.translation, q)
    };
    let exchanged: Vec<_> = tracker_from_body
        .iter()
        .map(|pose| pose.as_ref().map(exchange))
        .collect();
    let other = disagreement(&exchanged, base_from_link)?;
    (as_read > GOOD_ENOUGH && other * MUCH_BETTER < as_read).then(|| {
        let text = format!(
            "its motion disagrees with the robot's by {:.2}°, with the quaternions read scalar first only by {:.2}°",
            as_read.to_degrees(), other.to_degrees()
        );
        let remedy = "the quaternions are written w, x, y, z: rename the columns, or use `quaternion_wxyz` in the column map";
        Finding::new("quaternion-order", Severity::Error, body, text, remedy)
    })
}

/// Whether the tracker's up axis can be the one declared (`+Z`, `-Y`, …): the robot's base stands upright to within
/// `tilt`, rad, so its z axis must be there. `None` also when the text names no axis.
pub fn up_axis(declared: &str, tracker_from_base: &Isometry3<f64>, tilt: f64) -> Option<Finding> {
    let base_up = tracker_from_base.rotation * Vector3::z();
    let axes = [
        ("+X", Vector3::x()),
        ("+Y", Vector3::y()),
        ("+Z", Vector3::z()),
        ("-X", -Vector3::x()),
        ("-Y", -Vector3::y()),
        ("-Z", -Vector3::z()),
    ];
    let (_, up) = axes
        .iter()
        .find(|(name, _)| name.eq_ignore_ascii_case(declared.trim()))?;
    let off = base_up.angle(up);
    if off <= tilt {
        return None;
    }
    let (nearest, _) = axes
        .iter()
        .max_by(|a, b| base_up.dot(&a.1).total_cmp(&base_up.dot(&b.1)))?;
    let text = format!(
        "{declared} is said to be up; the robot's base, as found, points {:.0}° away from it, nearest to {nearest}",
        off.to_degrees()
    );
    let remedy = format!(
        "export with the other axis up; or, if the robot is mounted that way, say `tracker: {{up_axis: {nearest}}}`"
    );
    Some(Finding::new(
        "up-axis",
        Severity::Warning,
        "tracker",
        text,
        remedy,
    ))
}

/// What an alignment of two clocks means for the recording; `None` when they agree to within `tolerance`, s.
pub fn alignment(outcome: &OffsetOutcome, tolerance: f64) -> Option<Finding> {
    let finding = |severity, text: String, remedy: &str| {
        Some(Finding::new("clock-lag", severity, "clocks", text, remedy))
    };
    match *outcome {
        OffsetOutcome::Found(map) => {
            let agree = map.offset.abs() <= tolerance.max(4.0 * map.offset_sigma);
            let text = format!(
                "the tracker's clock is {:.4} s ± {:.1} ms ahead of the robot's and runs {:.0} ppm faster",
                map.offset,
                map.offset_sigma * 1e3,
                map.drift * 1e6
            );
            if agree {
                None
            } else {
                finding(
                    Severity::Warning,
                    text,
                    "the offset is taken into account; a shared clock would be better",
                )
            }
        }
        OffsetOutcome::Ambiguous {
            first,
            second,
            ratio,
        } => finding(
            Severity::Error,
            format!(
                "offsets of {first:.3} s and {second:.3} s explain the motion nearly equally well (ratio {ratio:.2})"
            ),
            "the motion is periodic: move irregularly once at the start, or record static poses",
        ),
        OffsetOutcome::NotExcited { deviation, needed } => finding(
            Severity::Error,
            format!(
                "angular speed varies by {deviation:.4} rad/s, {needed} are needed to align the clocks"
            ),
            "move faster, or record static poses",
        ),
        OffsetOutcome::NoMatch {
            correlation,
            needed,
        } => finding(
            Severity::Error,
            format!("the two motions correlate by {correlation:.2} at most, {needed} are needed"),
            "check that both recordings are of the same motion, and the body's link",
        ),
        OffsetOutcome::TooShort => finding(
            Severity::Error,
            "too few samples in common".to_string(),
            "record at least some seconds with both clocks running",
        ),
    }
}

/// Rows that disagree with all others while the others agree among themselves: the body flipped (`body-flip`), or the
/// robot had not settled, or the two were read at different times (`unsettled-rows`).
pub fn spoiled_rows(
    poses: &Poses,
    body: &str,
    tracker_from_body: &[Option<Isometry3<f64>>],
    base_from_link: &[Isometry3<f64>],
) -> Vec<Finding> {
    let n = tracker_from_body
        .len()
        .min(base_from_link.len())
        .min(poses.len());
    // Disagreement of the rows taken out, rad.
    let mut spoiled: Vec<Option<f64>> = vec![None; n];
    let mut usual = 0.0;
    // The worst rows leave first: they weigh on all others.
    for _ in 0..n {
        let mut off: Vec<Vec<f64>> = vec![Vec::new(); n];
        for (i, j, angle) in pairs(&tracker_from_body[..n], &base_from_link[..n]) {
            if spoiled[i].is_none() && spoiled[j].is_none() {
                off[i].push(angle);
                off[j].push(angle);
            }
        }
        let medians: Vec<(usize, f64)> = off
            .into_iter()
            .enumerate()
            .filter_map(|(i, all)| Some((i, median(all)?)))
            .collect();
        let worst = medians.iter().map(|m| m.1).fold(0.0, f64::max);
        let Some(middle) =
            median(medians.iter().map(|m| m.1).collect()).filter(|_| medians.len() >= 5)
        else {
            break;
        };
        usual = middle;
        let limit = (SPOILED_RATIO * usual).max(GOOD_ENOUGH);
        if worst < limit {
            break;
        }
        for (row, angle) in medians
            .into_iter()
            .filter(|(_, angle)| *angle >= limit.max(NEARLY_WORST * worst))
        {
            spoiled[row] = Some(angle);
        }
    }
    let finding = |id, severity, flipped: bool, remedy: &str| {
        let rows: Vec<usize> = (0..n)
            .filter(|&i| spoiled[i].is_some_and(|angle| (angle > FLIPPED) == flipped))
            .collect();
        let worst = rows.iter().filter_map(|&i| spoiled[i]).fold(0.0, f64::max);
        let text = format!(
            "{} off the robot's model by up to {:.2}°, {:.2}° is usual",
            format_args!("{} {}", counted(rows.len(), "row"), are(rows.len())),
            worst.to_degrees(),
            usual.to_degrees()
        );
        let finding = Finding::new(id, severity, body, text, remedy);
        (!rows.is_empty()).then(|| finding.at_rows(rows.into_iter().map(|i| poses.rows[i])))
    };
    let flip = "its marker pattern is nearly symmetric: move a marker; drop the flipped rows";
    let unsettled = "the robot had not settled, or tracker and robot were read at different times: drop these rows or synchronise the clocks";
    let flips = finding("body-flip", Severity::Error, true, flip);
    flips
        .into_iter()
        .chain(finding(
            "unsettled-rows",
            Severity::Warning,
            false,
            unsettled,
        ))
        .collect()
}
