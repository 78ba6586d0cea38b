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
//! sign); the slide does. It is compared in units of how far the body moved: `√(Δθ² + (Δd/L)²)`, L the distance between
//! the two poses, or the median distance of the body from the middle of its way where that is more. An error of an axis
//! makes an error of the slide in proportion to the way.
//!
//! What this cannot see: a sign error of the only joint that moves (a mount turned by half a turn explains it), and
//! links between which no joint moved.

use crate::statistics::median;
use crate::sync::OffsetOutcome;
use calib_finding::{About, Fact, Finding, Unit, catalog};
use nalgebra::{Isometry3, Vector3};

/// Disagreement, rad (1°), below which the model is not blamed: nominal robots are that good.
const GOOD_ENOUGH: f64 = 0.0175;
/// A row that disagrees with the others by this many times their usual disagreement does not belong to them.
const SPOILED_RATIO: f64 = 6.0;
/// Rows within this part of the worst leave together with it.
const NEARLY_WORST: f64 = 0.7;
/// Turn that counts, rad: pairs of rows that turned less say nothing.
const TURNED: f64 = 0.05;

/// Angles, rad, between which a motion's axis is known to about its rotation noise; at π its sign is open.
const WELL_TURNED: std::ops::Range<f64> = 0.4..2.9;

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

/// Rows up to which each is compared with many others.
const LONG: usize = 4096;
/// Steps from a row to the rows that it is compared with, where a table is not short; and where it is long.
const STEPS: (usize, usize) = (24, 8);

/// Pairs of rows that turned in one of the two, and by how much they disagree: every row with every other in short tables.
fn pairs<'a>(
    tracker_from_body: &'a [Option<Isometry3<f64>>],
    base_from_link: &'a [Isometry3<f64>],
) -> impl Iterator<Item = (usize, usize, f64)> + 'a {
    let n = tracker_from_body.len().min(base_from_link.len());
    // With steps of growing size, the largest nearly half of the table.
    let count = if n > LONG { STEPS.1 } else { STEPS.0 };
    let steps: Vec<usize> = match n {
        0..=128 => (1..n).collect(),
        _ => (0..count)
            .map(|k| 1 + k * k * n * STEPS.0 * STEPS.0 / (1200 * count * count))
            .collect(),
    };
    let size = size(tracker_from_body);
    steps
        .into_iter()
        .flat_map(move |step| (0..n.saturating_sub(step)).map(move |i| (i, i + step)))
        .filter_map(move |(i, j)| {
            let measured = screw(&tracker_from_body[i]?, &tracker_from_body[j]?);
            let predicted = screw(&base_from_link[i], &base_from_link[j]);
            Some((i, j, measured.off(&predicted, size)?))
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

/// A motion from one pose to another.
struct Screw {
    /// Angle, rad.
    angle: f64,
    /// Slide along the axis, m, where the axis is well defined.
    slide: Option<f64>,
    /// Distance between the poses, m.
    distance: f64,
}

impl Screw {
    /// By how much a motion is off the predicted one, (1), rad; `None` where neither turns.
    fn off(&self, predicted: &Self, size: f64) -> Option<f64> {
        let length = size.max(self.distance);
        let slides = self.slide.zip(predicted.slide);
        let slide = slides.map_or(0.0, |(a, b)| (a - b) / length);
        let turned = self.angle.max(predicted.angle) > TURNED;
        turned.then(|| (self.angle - predicted.angle).hypot(slide))
    }
}

fn screw(a: &Isometry3<f64>, b: &Isometry3<f64>) -> Screw {
    let a_from_b = a.inverse() * b;
    let angle = a_from_b.rotation.angle();
    let axis = a_from_b
        .rotation
        .axis()
        .filter(|_| WELL_TURNED.contains(&angle));
    let moved = a_from_b.translation.vector;
    Screw {
        angle,
        slide: axis.map(|axis| moved.dot(&axis)),
        distance: moved.norm(),
    }
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
                .with("sigma_drift", Fact::ratio(map.drift_sigma))
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
        OffsetOutcome::NotMoved { motion, needed } => of_kind("not_moved")
            .with("motion", Fact::meters(motion))
            .with("needed", Fact::meters(needed)),
        OffsetOutcome::NoMatch {
            correlation,
            needed,
        } => of_kind("no_match")
            .with("correlation", Fact::ratio(correlation))
            .with("needed", Fact::ratio(needed)),
        OffsetOutcome::TooShort => of_kind("too_short"),
    })
}

/// A row that disagrees with the others.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpoiledRow {
    /// Row of the table.
    pub row: usize,
    /// Disagreement (1) with the other rows, median, rad.
    pub off: f64,
}

/// Rows that disagree with all others while the others agree among themselves.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Spoiled {
    /// In order.
    pub rows: Vec<SpoiledRow>,
    /// Usual disagreement, rad.
    pub usual: f64,
}

/// The rows whose motions disagree with all others. Where the others disagree as well, none is named.
pub fn spoiled_rows(
    tracker_from_body: &[Option<Isometry3<f64>>],
    base_from_link: &[Isometry3<f64>],
) -> Spoiled {
    let n = tracker_from_body.len().min(base_from_link.len());
    // Disagreement of the rows taken out, rad.
    let mut spoiled: Vec<Option<f64>> = vec![None; n];
    let mut usual = 0.0;
    let pairs: Vec<(usize, usize, f64)> =
        pairs(&tracker_from_body[..n], &base_from_link[..n]).collect();
    // The worst rows leave first: they weigh on all others.
    for _ in 0..n {
        let mut off: Vec<Vec<f64>> = vec![Vec::new(); n];
        for &(i, j, angle) in &pairs {
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
    let rows = spoiled.into_iter().enumerate();
    let rows = rows.filter_map(|(row, off)| Some(SpoiledRow { row, off: off? }));
    Spoiled {
        rows: rows.collect(),
        usual,
    }
}

/// Rows that one row is compared with at most, evenly over all: a median needs no more.
const COMPARED: usize = 64;

impl Spoiled {
    /// Disagreement (1) of a row with the rows that are not spoiled, median, rad, if its link had been at
    /// `base_from_link_there`; `None` where it turned against none of them.
    pub fn disagreement_at(
        &self,
        row: usize,
        base_from_link_there: &Isometry3<f64>,
        tracker_from_body: &[Option<Isometry3<f64>>],
        base_from_link: &[Isometry3<f64>],
    ) -> Option<f64> {
        let seen = tracker_from_body.get(row)?.as_ref()?;
        let size = size(tracker_from_body);
        let good: Vec<usize> = (0..base_from_link.len())
            .filter(|other| {
                *other != row && self.rows.binary_search_by_key(other, |r| r.row).is_err()
            })
            .collect();
        let others = good.iter().step_by(good.len().div_ceil(COMPARED).max(1));
        let off = others.filter_map(|&other| {
            let measured = screw(seen, tracker_from_body[other].as_ref()?);
            let predicted = screw(base_from_link_there, &base_from_link[other]);
            measured.off(&predicted, size)
        });
        median(off.collect())
    }
}
