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

use crate::statistics::median;
use crate::sync::OffsetOutcome;
use calib_finding::{About, Fact, Finding, Subject, Unit, catalog};
use calib_recording::Poses;
use nalgebra::{Isometry3, Quaternion, UnitQuaternion, Vector3};

/// Disagreement, rad (1°), below which the model is not blamed: nominal robots are that good.
pub const GOOD_ENOUGH: f64 = 0.0175;
/// Median disagreement, rad (11°), that no error of a nominal URDF reaches.
const NOT_ITS_MOTION: f64 = 0.2;
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

/// What may be wrong, where the nominal prediction does not explain a body's motion.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Mistake {
    /// A joint has the opposite sign.
    JointSign {
        /// The joint.
        joint: String,
    },
    /// Two joints' columns are exchanged.
    JointOrder {
        /// One joint.
        joint: String,
        /// The other joint.
        other: String,
    },
    /// All joint angles are degrees that were read as radians.
    AnglesInDegrees,
    /// All joint angles are radians that were read as degrees.
    AnglesInRadians,
    /// The tracker's lengths are a thousand times too large.
    LengthsTooLarge,
    /// The tracker's lengths are a thousand times too small.
    LengthsTooSmall,
    /// The body is on another link.
    OtherLink {
        /// That link.
        link: String,
    },
    /// The joint values belong to another row.
    OtherRow {
        /// Rows from the tracker's row to that of the joint values.
        by: isize,
    },
}

impl Mistake {
    fn finding(&self, body: &str) -> Finding {
        let unit = |kind| Finding::of_kind(catalog::UNIT_MISMATCH, kind, Subject::body(body));
        match self {
            Mistake::JointSign { joint } => Finding::new(catalog::JOINT_SIGN, Subject::body(body))
                .with("joint", Fact::name(joint)),
            Mistake::JointOrder { joint, other } => {
                Finding::new(catalog::JOINT_ORDER, Subject::body(body))
                    .with("joint", Fact::name(joint))
                    .with("other", Fact::name(other))
            }
            Mistake::AnglesInDegrees => unit("all_degrees"),
            Mistake::AnglesInRadians => unit("all_radians"),
            Mistake::LengthsTooLarge => unit("lengths_too_large"),
            Mistake::LengthsTooSmall => unit("lengths_too_small"),
            Mistake::OtherLink { link } => {
                Finding::of_kind(catalog::WRONG_MOUNT, "other_link", Subject::body(body))
                    .with("other", Fact::name(link))
            }
            Mistake::OtherRow { by } => {
                let kind = if *by < 0 { "rows_before" } else { "rows_after" };
                Finding::of_kind(catalog::CLOCK_LAG, kind, Subject::body(body))
                    .with("rows", Fact::count(by.unsigned_abs()))
            }
        }
    }
}

/// Predictions under one assumption, for the rows of a table.
#[derive(Clone, Debug)]
pub struct Prediction {
    /// What is assumed to be wrong.
    pub mistake: Mistake,
    /// `base_from_link` per row, m.
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
    let center = places.iter().sum::<Vector3<f64>>() / places.len().max(1) as f64;
    let distances = places.iter().map(|place| (place - center).norm());
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

/// Whether one of `alternatives` explains a body's track much better than `base_from_link` of its link in the
/// profile does.
pub fn better_explanation(
    body: &str,
    link: &str,
    tracker_from_body: &[Option<Isometry3<f64>>],
    base_from_link: &[Isometry3<f64>],
    alternatives: &[Prediction],
) -> Option<Finding> {
    let as_claimed = disagreement(tracker_from_body, base_from_link)?;
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
    Some(
        best.mistake
            .finding(body)
            .with("link", Fact::name(link))
            .with("claimed", Fact::radians(as_claimed))
            .with("explained", Fact::radians(off)),
    )
}

/// A body whose motion has nothing to do with that of its link, and that no single mistake explains.
pub fn moves_alone(body: &str, link: &str, disagreement: f64) -> Option<Finding> {
    (disagreement > NOT_ITS_MOTION).then(|| {
        Finding::of_kind(catalog::WRONG_MOUNT, "no_link", Subject::body(body))
            .with("link", Fact::name(link))
            .with("claimed", Fact::radians(disagreement))
    })
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
        Finding::new(catalog::QUATERNION_ORDER, Subject::body(body))
            .with("claimed", Fact::radians(as_read))
            .with("explained", Fact::radians(other))
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
    Some(
        Finding::new(catalog::UP_AXIS, About::Tracker)
            .with("declared", Fact::name(declared))
            .with("off", Fact::radians(off))
            .with("nearest", Fact::choice(nearest)),
    )
}

/// What an alignment of two clocks means for the recording; `None` when they agree to within `tolerance`, s.
pub fn alignment(outcome: &OffsetOutcome, tolerance: f64) -> Option<Finding> {
    let of_kind = |kind| Finding::of_kind(catalog::CLOCK_LAG, kind, About::Clocks);
    Some(match *outcome {
        OffsetOutcome::Found(map) => {
            if map.offset.abs() <= tolerance.max(4.0 * map.offset_sigma) {
                return None;
            }
            of_kind("offset")
                .with("offset", Fact::seconds(map.offset))
                .with("sigma", Fact::seconds(map.offset_sigma))
                .with("drift", Fact::ratio(map.drift))
        }
        OffsetOutcome::Ambiguous {
            first,
            second,
            ratio,
        } => of_kind("ambiguous")
            .with("first", Fact::seconds(first))
            .with("second", Fact::seconds(second))
            .with("ratio", Fact::ratio(ratio)),
        OffsetOutcome::NotExcited { deviation, needed } => of_kind("not_excited")
            .with("deviation", Fact::number(deviation, Unit::RadianPerSecond))
            .with("needed", Fact::number(needed, Unit::RadianPerSecond)),
        OffsetOutcome::NoMatch {
            correlation,
            needed,
        } => of_kind("no_match")
            .with("correlation", Fact::ratio(correlation))
            .with("needed", Fact::ratio(needed)),
        OffsetOutcome::TooShort => of_kind("too_short"),
    })
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
    let of_rows = |id, flipped: bool| {
        let rows: Vec<usize> = (0..n)
            .filter(|&i| spoiled[i].is_some_and(|angle| (angle > FLIPPED) == flipped))
            .collect();
        let worst = rows.iter().filter_map(|&i| spoiled[i]).fold(0.0, f64::max);
        (!rows.is_empty()).then(|| {
            Finding::of_kind(id, "model", Subject::body(body))
                .with("count", Fact::count(rows.len()))
                .with("worst", Fact::radians(worst))
                .with("usual", Fact::radians(usual))
                .at_rows(rows.into_iter().map(|i| poses.rows[i]))
        })
    };
    let flips = of_rows(catalog::BODY_FLIP, true);
    let unsettled = of_rows(catalog::UNSETTLED_ROWS, false);
    flips.into_iter().chain(unsettled).collect()
}
