//! Single rows against the nominal robot, before the fit.
//!
//! A row is named when its body's motion to the other rows disagrees with that of its link ([`calib_checks::model`]) *and*
//! most of its samples deviate from the registration of all rows: one marker out of place, or a pose that the seen
//! markers hardly determine, is no fault of the row. Rows that are the majority within a part of a joint's range are not
//! named one by one.

use std::collections::{BTreeMap, BTreeSet};

use calib_checks::model::{Spoiled, SpoiledRow, spoiled_rows};
use calib_checks::structural::{Chain, Deviation, Hypothesis, apply_all, deviations};
use calib_finding::{Fact, Finding, Subject, catalog};
use calib_profile::Usage;
use calib_urdf::LinkId;
use nalgebra::Isometry3;
use rayon::prelude::*;

use crate::formulate::structural::{Layout, Structural, coupled};
use crate::prepare::inputs::{Inputs, Loaded};
use crate::prepare::tracks::BodyTrack;

/// Parts of a joint's range in which the deviating rows must be the minority.
const PARTS: usize = 4;
/// Wrong rows of a recording, as a part of all, that a robust fit rejects without harm.
const FEW: f64 = 0.1;
/// Rows of such a part that say something.
const ENOUGH_IN_PART: usize = 5;
/// Deviation of orientation, rad (34°), that no motion between two readings explains.
const FLIPPED: f64 = 0.6;
/// Displacement of the centroid, as part of the markers' displacement, up to which a body rotated on the spot.
const ON_THE_SPOT: f64 = 0.5;

/// The way to the next row is tried in steps that shrink by this factor: the nearest misses the right place by a tenth of the way there.
const SHRINKS: f64 = 0.8;
/// Shortest part of the way that is tried.
const SHORTEST: f64 = 0.004;
/// Least of a usual disagreement, rad, that a ratio is formed with: data without noise have none.
const SMALLEST: f64 = 1e-6;
/// What a place on the way may leave of a row's disagreement.
const LEFT: f64 = 0.3;

/// How a row deviates.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    /// The body rotated on the spot.
    Flipped,
    /// It is right on the way to a neighboring row: the robot had not settled, or the two were read at different times.
    Unsettled,
    /// Neither.
    Off,
}

/// A row that deviates.
struct Row {
    row: usize,
    /// Disagreement of its motions with those of the other rows, rad.
    off: f64,
    /// Of the markers from where they should be, rms, m.
    distance: f64,
    /// Rotation against where the body should be, rad; 0 where it has no orientation.
    angle: f64,
    kind: Kind,
}

/// The deviating rows of one body in one recording.
struct Rows<'a> {
    body: &'a str,
    loaded: &'a Loaded,
    rows: Vec<Row>,
    /// Usual disagreement, rad.
    usual: f64,
}

/// Rows that deviate while no structural hypothesis stands out.
#[must_use]
pub fn rows(
    inputs: &Inputs,
    tracks: &BTreeMap<String, BodyTrack>,
    structural: &Structural,
) -> Vec<Finding> {
    let mut all = spoilt(inputs, tracks, structural);
    if all.is_empty() {
        return Vec::new();
    }
    let of_names = exchanged(&mut all);
    let of_names = of_names.iter().map(|of| of.finding(inputs));
    let mut findings: Vec<Finding> = of_names.collect();
    all.par_iter_mut().for_each(|of| {
        of.moving = of.on_the_way(inputs, structural);
    });
    let mut all = deviating(inputs, tracks, structural, &all);
    findings.extend(in_several_bodies(inputs, &mut all));
    for rows in &all {
        match part_of_a_range(inputs, rows) {
            Some(finding) => findings.push(finding),
            None => findings.extend(row_findings(rows)),
        }
    }
    findings
}

/// The rows of each body in each recording whose motions disagree with those of its link.
fn spoilt<'a>(
    inputs: &'a Inputs,
    tracks: &'a BTreeMap<String, BodyTrack>,
    structural: &Structural,
) -> Vec<Spoilt<'a>> {
    // A recording that a mistake explains as a whole has no deviating rows.
    let explained = |name: &str| {
        let mut all = structural.findings.iter();
        all.any(|f| f.severity == calib_finding::Severity::Error && f.subject.is_in(name))
    };
    let bodies = inputs.robot.profile.bodies.iter();
    let tables = bodies.flat_map(|(body, spec)| {
        let recordings = inputs.recordings.values();
        recordings.map(move |loaded| (body.as_str(), spec.link, loaded))
    });
    let tables: Vec<_> = tables.filter(|(_, _, r)| !explained(&r.name)).collect();
    let spoilt = |&(body, link, loaded): &(&'a str, LinkId, &'a Loaded)| {
        let seen = tracks[body].in_recording(&loaded.name);
        if seen.is_empty() || loaded.q.iter().any(Option::is_none) {
            return None;
        }
        let q: Vec<&Vec<f64>> = loaded.q.iter().flatten().collect();
        let at = |q: &[f64]| {
            let q = corrected(q, structural);
            inputs.robot.model.root_from_link(&q, link)
        };
        let poses: Vec<_> = q.iter().map(|q| at(q)).collect();
        let spoiled = spoiled_rows(seen, &poses);
        (!spoiled.rows.is_empty()).then_some(Spoilt {
            body,
            loaded,
            seen,
            poses,
            moving: BTreeSet::new(),
            spoiled,
        })
    };
    tables.par_iter().filter_map(spoilt).collect()
}

/// The findings of deviating rows, by how they deviate.
fn row_findings(rows: &Rows<'_>) -> Vec<Finding> {
    let of_kind = |id, kind: Kind| {
        let of_kind: Vec<&Row> = rows.rows.iter().filter(|row| row.kind == kind).collect();
        let largest = |of: fn(&Row) -> f64| of_kind.iter().map(|row| of(row)).fold(0.0, f64::max);
        let subject = Subject::body(rows.body).in_recording(&rows.loaded.name);
        (!of_kind.is_empty()).then(|| {
            Finding::of_kind(id, "model", subject)
                .with("count", Fact::count(of_kind.len()))
                .with("position", Fact::meters(largest(|row| row.distance)))
                .with("angle", Fact::radians(largest(|row| row.angle)))
                .with(
                    "ratio",
                    Fact::ratio(largest(|row| row.off) / rows.usual.max(SMALLEST)),
                )
                .at_rows(of_kind.iter().map(|row| rows.loaded.poses.rows[row.row]))
        })
    };
    [
        of_kind(catalog::BODY_FLIP, Kind::Flipped),
        of_kind(catalog::UNSETTLED_ROWS, Kind::Unsettled),
        of_kind(catalog::ROW_OUTLIER, Kind::Off),
    ]
    .into_iter()
    .flatten()
    .collect()
}

/// Joint positions with the zeros, gains and couplings that the fit estimates.
fn corrected(q: &[f64], structural: &Structural) -> Vec<f64> {
    let mut read = q.to_vec();
    for scoped in &structural.of_fit {
        match scoped.hypothesis {
            Hypothesis::Zero { joint, offset } => read[joint.0] += offset,
            Hypothesis::Gain { joint, factor } => read[joint.0] *= factor,
            _ => {}
        }
    }
    let mut moved = read.clone();
    for c in &structural.couplings {
        moved[c.joint.0] += c.factor * read[c.source.0];
    }
    moved
}

/// Whether a row is right somewhere on the way to the row before or after it; `off`: its disagreement at joint positions, rad.
fn on_the_way(q: &[&Vec<f64>], row: &SpoiledRow, off: impl Fn(&[f64]) -> Option<f64>) -> bool {
    let neighbors = [row.row.checked_sub(1), row.row.checked_add(1)];
    let neighbors = neighbors.into_iter().flatten().filter_map(|k| q.get(k));
    let parts = || {
        let shorter = |part: &f64| Some(part * SHRINKS);
        std::iter::successors(Some(1.0), shorter).take_while(|part| *part > SHORTEST)
    };
    let own = q[row.row];
    let mut places = neighbors.flat_map(|other| {
        parts().map(move |part| -> Vec<f64> {
            let between = own.iter().zip(other.iter());
            between.map(|(a, b)| a + part * (b - a)).collect()
        })
    });
    places.any(|there| off(&there).is_some_and(|off| off < LEFT * row.off))
}

/// Rows of one body in one recording whose motions disagree.
struct Spoilt<'a> {
    body: &'a str,
    loaded: &'a Loaded,
    /// `tracker_from_body` per row.
    seen: &'a [Option<Isometry3<f64>>],
    /// `base_from_link` per row.
    poses: Vec<Isometry3<f64>>,
    /// Those that are right on the way to a neighboring row, once they were asked.
    moving: BTreeSet<usize>,
    spoiled: Spoiled,
}

/// Rows of a recording in which two bodies are each where the other should be.
#[derive(Debug, Clone)]
pub(super) struct Exchanged<'a> {
    pub(super) loaded: &'a Loaded,
    pub(super) bodies: [&'a str; 2],
    pub(super) rows: BTreeSet<usize>,
}

impl Exchanged<'_> {
    /// An error where so many rows are wrong that one cannot rely on a robust fit to leave them all out.
    pub(super) fn finding(&self, inputs: &Inputs) -> Finding {
        let few = self.rows.len() as f64 <= FEW * self.loaded.poses.len() as f64;
        let kind = match few && inputs.robot.profile.solve.robust {
            true => "exchanged_few",
            false => "exchanged",
        };
        let subject = Subject::recording(&self.loaded.name);
        let [first, second] = self.bodies;
        Finding::of_kind(catalog::ROW_OUTLIER, kind, subject)
            .with("count", Fact::count(self.rows.len()))
            .with("first", Fact::name(first))
            .with("second", Fact::name(second))
            .at_rows(self.rows.iter().map(|row| self.loaded.poses.rows[*row]))
    }
}

/// Rows in which two bodies are each where the other should be.
pub(super) fn exchanged_rows<'a>(
    inputs: &'a Inputs,
    tracks: &'a BTreeMap<String, BodyTrack>,
    structural: &Structural,
) -> Vec<Exchanged<'a>> {
    exchanged(&mut spoilt(inputs, tracks, structural))
}

/// The same among rows that disagree; they are taken out of `all`.
fn exchanged<'a>(all: &mut [Spoilt<'a>]) -> Vec<Exchanged<'a>> {
    let mut found = Vec::new();
    for k in 0..all.len() {
        for other in k + 1..all.len() {
            let (before, from) = all.split_at_mut(other);
            let (first, second) = (&mut before[k], &mut from[0]);
            if first.loaded.name != second.loaded.name {
                continue;
            }
            let rows: BTreeSet<usize> = first.exchanged_with(second).collect();
            if rows.is_empty() {
                continue;
            }
            for of in [&mut *first, &mut *second] {
                of.spoiled.rows.retain(|row| !rows.contains(&row.row));
            }
            found.push(Exchanged {
                loaded: first.loaded,
                bodies: [first.body, second.body],
                rows,
            });
        }
    }
    found
}

impl Spoilt<'_> {
    /// Rows that are right somewhere on the way to a neighboring row.
    fn on_the_way(&self, inputs: &Inputs, structural: &Structural) -> BTreeSet<usize> {
        let link = inputs.robot.profile.bodies[self.body].link;
        let q: Vec<&Vec<f64>> = self.loaded.q.iter().flatten().collect();
        let is_on_the_way = |row: &&SpoiledRow| {
            on_the_way(&q, row, |there| {
                let q = corrected(there, structural);
                let there = inputs.robot.model.root_from_link(&q, link);
                let spoiled = &self.spoiled;
                spoiled.disagreement_at(row.row, &there, self.seen, &self.poses)
            })
        };
        let rows = self.spoiled.rows.iter().filter(is_on_the_way);
        rows.map(|row| row.row).collect()
    }

    /// Rows in which both bodies disagree with the others, and neither does with the other's pose.
    fn exchanged_with<'s>(&'s self, other: &'s Self) -> impl Iterator<Item = usize> + 's {
        let agrees = |of: &Self, row: &SpoiledRow, instead: &Self| {
            let there = instead.seen.get(row.row).copied().flatten();
            let mut seen = of.seen.to_vec();
            seen[row.row] = there;
            let spoiled = &of.spoiled;
            let off = spoiled.disagreement_at(row.row, &of.poses[row.row], &seen, &of.poses);
            off.is_some_and(|off| off < LEFT * row.off)
        };
        let both = self.spoiled.rows.iter().filter_map(move |row| {
            let others = &other.spoiled.rows;
            let place = others.binary_search_by_key(&row.row, |r| r.row).ok()?;
            Some((row, &others[place]))
        });
        both.filter(move |(row, of_other)| {
            agrees(self, row, other) && agrees(other, of_other, self)
        })
        .map(|(row, _)| row.row)
    }
}

/// Whether so few rows of a recording are wrong that a robust fit is right.
fn few(inputs: &Inputs, loaded: &Loaded, rows: usize) -> bool {
    inputs.robot.profile.solve.robust && rows as f64 <= FEW * loaded.poses.len() as f64
}

/// The rows most of whose samples deviate from the registration, and how.
fn deviating<'a>(
    inputs: &Inputs,
    tracks: &BTreeMap<String, BodyTrack>,
    structural: &Structural,
    all: &[Spoilt<'a>],
) -> Vec<Rows<'a>> {
    // A model that was read is a tree, and what a reader lets through does not contradict itself.
    let Ok(chain) = Chain::from_model(&inputs.robot.model) else {
        return Vec::new();
    };
    let chain = coupled(chain, &structural.couplings);
    let validation = |of: &Spoilt<'_>| of.loaded.spec.usage == Usage::Validation;
    let layout = Layout::new(inputs, tracks, &chain, all.iter().any(validation));
    let Ok(found) = deviations(&apply_all(&structural.of_fit, &layout.data)) else {
        return Vec::new();
    };
    // (recording, row, body) → deviation
    let mut by_row: BTreeMap<(&str, usize, &str), Deviation> = BTreeMap::new();
    for deviation in &found.rows {
        let recording = layout.data.recording[deviation.row];
        let recording = layout.recordings[recording.0].name.as_str();
        let body = layout.body(deviation.body);
        by_row.insert((recording, layout.rows[deviation.row], body), *deviation);
    }
    let mut kept = Vec::new();
    for Spoilt {
        body,
        loaded,
        moving,
        spoiled,
        ..
    } in all
    {
        let row = |row: &SpoiledRow| {
            let deviation = by_row.get(&(loaded.name.as_str(), row.row, *body))?;
            deviation.whole().then(|| Row {
                row: row.row,
                off: row.off,
                distance: deviation.distance,
                angle: deviation.angle.unwrap_or(0.0),
                kind: kind(row.off, deviation, moving.contains(&row.row)),
            })
        };
        kept.push(Rows {
            body,
            loaded,
            rows: spoiled.rows.iter().filter_map(row).collect(),
            usual: spoiled.usual,
        });
    }
    kept.retain(|rows| !rows.rows.is_empty());
    kept
}

/// A flip is a rotation of the marker pattern on the spot.
fn kind(off: f64, deviation: &Deviation, moving: bool) -> Kind {
    if moving && off < FLIPPED {
        return Kind::Unsettled;
    }
    let turned = deviation.angle.is_some_and(|angle| angle > FLIPPED);
    if turned && deviation.shift < ON_THE_SPOT * deviation.distance {
        Kind::Flipped
    } else {
        Kind::Off
    }
}

/// Rows in which several bodies deviate at once: not the bodies are wrong there, but what the joints are said to be, or the tracker's frame.
fn in_several_bodies(inputs: &Inputs, all: &mut Vec<Rows<'_>>) -> Vec<Finding> {
    let mut count: BTreeMap<(String, usize), usize> = BTreeMap::new();
    let far = |row: &Row| row.kind != Kind::Unsettled;
    for rows in all.iter() {
        for row in rows.rows.iter().filter(|row| far(row)) {
            let key = (rows.loaded.name.clone(), row.row);
            *count.entry(key).or_default() += 1;
        }
    }
    count.retain(|_, bodies| *bodies > 1);
    let mut by_recording: BTreeMap<String, BTreeSet<u64>> = BTreeMap::new();
    for rows in all.iter_mut() {
        let name = &rows.loaded.name;
        rows.rows.retain(|row| {
            let several = count.contains_key(&(name.clone(), row.row));
            if several {
                let number = rows.loaded.poses.rows[row.row];
                by_recording.entry(name.clone()).or_default().insert(number);
            }
            !several
        });
    }
    all.retain(|rows| !rows.rows.is_empty());
    let finding = |(recording, rows): (String, BTreeSet<u64>)| {
        let kind = match few(inputs, &inputs.recordings[&recording], rows.len()) {
            true => "several_bodies_few",
            false => "several_bodies",
        };
        Finding::of_kind(catalog::ROW_OUTLIER, kind, Subject::recording(recording))
            .with("count", Fact::count(rows.len()))
            .at_rows(rows)
    };
    by_recording.into_iter().map(finding).collect()
}

/// The part of a joint's range in which most rows deviate: the range is the cause, not the rows.
fn part_of_a_range(inputs: &Inputs, rows: &Rows<'_>) -> Option<Finding> {
    let model = &inputs.robot.model;
    let q: Vec<&Vec<f64>> = rows.loaded.q.iter().flatten().collect();
    let off: BTreeSet<usize> = rows.rows.iter().map(|row| row.row).collect();
    for joint in model.independent_joints() {
        let at = |row: usize| q[row][joint.index()];
        let (low, high) = (0..q.len()).fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), row| {
            (l.min(at(row)), h.max(at(row)))
        });
        let width = (high - low) / PARTS as f64;
        if width <= 0.0 {
            continue;
        }
        for part in 0..PARTS {
            let (from, to) = (low + width * part as f64, low + width * (part + 1) as f64);
            let inside = (0..q.len()).filter(|&row| (from..=to).contains(&at(row)));
            let (mut count, mut wrong) = (0, 0);
            for row in inside {
                count += 1;
                wrong += usize::from(off.contains(&row));
            }
            if count >= ENOUGH_IN_PART && 2 * wrong > count {
                let number = |value| match model.joint(joint).kind.turns() {
                    true => Fact::radians(value),
                    false => Fact::meters(value),
                };
                let subject = Subject::body(rows.body).in_recording(&rows.loaded.name);
                return Some(
                    Finding::of_kind(catalog::MODEL_DISAGREES, "range", subject)
                        .with("joint", Fact::name(&model.joint(joint).name))
                        .with("low", number(from))
                        .with("high", number(to))
                        .with("count", Fact::count(wrong))
                        .with("rows", Fact::count(count)),
                );
            }
        }
    }
    None
}
