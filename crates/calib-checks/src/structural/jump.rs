//! Did the tracker, a body on its link or the zero of a joint move at one row, and too far for a fit to find it? Or were two bodies exchanged there,
//! or rows of one table [lost](super::lost)?
//!
//! Asked where the data disagree with the robot and nothing is named. Sums over rows add up, so every place at which a recording
//! may be cut costs two registrations: of the rows before and of those after, with a tracker and markers of their own,
//!
//! ```text
//! r = argmin  f(rows ≤ r) + f(rows > r)                                                               (7)
//! ```
//!
//! The other recordings join the side with which their residual is smaller. Then each thing that may have moved is estimated
//! alone, all else being the same before and after; the best is named where nominal errors explain what it leaves.

use calib_geometry::registration::rigid_registration;
use calib_geometry::statistics::median;
use nalgebra::{Isometry3, Point3};
use rayon::prelude::*;
use serde::Serialize;

use super::apply::apply;
use super::correct::same_shape;
use super::data::Data;
use super::hypothesis::{Hypothesis, Scope, Scoped};
use super::ids::{BodyIndex, JointIndex, RecordingIndex};
use super::moments::{Moments, Normal};
use super::scan::{Fit, Scan};
use super::special::{estimated, rigid_motion};
use super::thinning::thinned;
use super::{Options, Outcome};

/// Rows of a recording on either side of the change.
const LEAST_ROWS: usize = 4;
/// Rows to either side of the cut at which the change is tried too.
const BESIDE: usize = 3;
/// First step of the search for a zero: rad, m.
const STEP: (f64, f64) = (0.01, 0.005);
/// Rounds of that search, each with half the step.
const REFINEMENTS: usize = 4;
/// Index of the rows after the change, where those before have 0.
const AFTER: Scope = Scope::Recording(RecordingIndex(1));
/// The rows before.
const BEFORE: Scope = Scope::Recording(RecordingIndex(0));

/// What moved.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub enum Moved {
    /// The tracker, or the whole robot.
    Tracker,
    /// A body on its link.
    Body(BodyIndex),
    /// The zero of a joint.
    Joint(JointIndex),
    /// Nothing: two bodies have each other's names on one side.
    Names {
        /// The smaller index.
        first: BodyIndex,
        /// The larger index.
        second: BodyIndex,
        /// From the row on, or up to it.
        after: bool,
    },
    /// Nothing: rows of one table were lost there, and from there on readings and tracker data are paired otherwise.
    Rows {
        /// What belongs to a row stands this many rows earlier among the readings; negative: later.
        by: i8,
    },
}

/// How far it moved.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Size {
    /// Of the robot's root in the tracker's frame, of the middle of the body's markers in its link, of a joint that slides, m.
    pub distance: Option<f64>,
    /// Of the tracker, of a body with three markers or more, of a joint that turns, rad.
    pub angle: Option<f64>,
}

/// A change at one row that nominal errors explain.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Jump {
    /// What moved.
    pub moved: Moved,
    /// The recording in which it moved.
    pub recording: RecordingIndex,
    /// Its last row before, of the input.
    pub before: usize,
    /// Its first row after; rows between the two were not looked at.
    pub after: usize,
    /// Other recordings that were made after the change.
    pub later: Vec<RecordingIndex>,
    /// How far.
    pub size: Size,
    /// Residual of the registration with the change, rms, m.
    pub rms: f64,
    /// What else may have moved there: it leaves hardly more.
    pub rivals: Vec<Moved>,
}

/// A recording cut in two, and where the other recordings belong.
struct Cut {
    recording: usize,
    /// Row of the thinned data.
    after: usize,
    later: Vec<usize>,
}

/// The change that explains the data and leaves at most a residual of `most`, m, if one does; `outcome`: of the other hypotheses.
pub(super) fn jump(all: &Data, outcome: &Outcome, most: f64, options: &Options) -> Option<Jump> {
    let limit = outcome.expected?.limit;
    // The rows are regrouped: who states mounts of recordings knows of a change.
    if all.bodies.iter().any(|body| !body.mounts.is_empty()) {
        return None;
    }
    let rows = thinned(all, options.most_rows);
    let data = with_zeros(all).select(&rows);
    let scan = Scan::new(&data, &[]);
    let mut best: Option<Jump> = None;
    for recording in 0..data.recordings() {
        let Some(cut) = cut(&scan, recording) else {
            continue;
        };
        let found = moved_at(&data, &cut, outcome, options);
        let found = found.map(|jump| Jump {
            before: rows[jump.before],
            after: rows[jump.after],
            ..jump
        });
        if let Some(found) = found.filter(|f| best.as_ref().is_none_or(|b| f.rms < b.rms)) {
            best = Some(found);
        }
    }
    let explains = |jump: &Jump| jump.rms <= limit.min(most);
    best.filter(explains)
}

/// Empty columns are 0 in their own recording; in a group with others they would be missing.
fn with_zeros(data: &Data) -> Data {
    let mut filled = data.clone();
    for (joint, recording) in data.assumed_zero() {
        let rows = filled.readings.iter_mut().zip(&data.recording);
        for (row, _) in rows.filter(|(_, of)| **of == recording) {
            row[joint.0] = Some(0.0);
        }
    }
    filled
}

/// Equation (7), and the side of each other recording.
fn cut(scan: &Scan<'_>, recording: usize) -> Option<Cut> {
    let of_recording = |i: &usize| scan.data.recording[*i].0 == recording;
    let rows: Vec<usize> = (0..scan.data.readings.len()).filter(of_recording).collect();
    if rows.len() < 2 * LEAST_ROWS {
        return None;
    }
    let until = running(scan, rows.iter());
    let mut from = running(scan, rows.iter().rev());
    from.reverse();
    let sides = |k: usize| (residual(&[&until[k - 1]]), residual(&[&from[k]]));
    let (at, _) = (LEAST_ROWS..=rows.len() - LEAST_ROWS)
        .map(|k| (k, sides(k).0 + sides(k).1))
        .min_by(|a, b| a.1.total_cmp(&b.1))?;
    let (before, after) = sides(at);
    let n = scan.channels.len();
    let others = (0..scan.recordings).filter(|r| *r != recording);
    let later = others.filter(|r| {
        let other = &scan.sums[r * n..(r + 1) * n];
        let joins = |side: &Vec<Moments>, alone: f64| residual(&[side, other]) - alone;
        joins(&from[at], after) < joins(&until[at - 1], before)
    });
    Some(Cut {
        recording,
        after: rows[at],
        later: later.collect(),
    })
}

/// The sums of each channel over the rows up to each.
pub(super) fn running<'r>(
    scan: &Scan<'_>,
    rows: impl Iterator<Item = &'r usize>,
) -> Vec<Vec<Moments>> {
    let (n, bodies) = (scan.channels.len(), scan.data.bodies.len());
    let mut sums = vec![Moments::ZERO; n];
    let mut all = Vec::new();
    for &i in rows {
        for (k, channel) in scan.channels.iter().enumerate() {
            let weight = scan.weights[i * n + k];
            if weight > 0.0 {
                let pose = &scan.poses[i * bodies + channel.body];
                sums[k].add(&scan.points[i * n + k], &pose.into(), weight);
            }
        }
        all.push(sums.clone());
    }
    all
}

/// Weighted sum of squared residuals of one registration of the parts, m².
pub(super) fn residual(parts: &[&[Moments]]) -> f64 {
    let mut normal = Normal::new();
    for k in 0..parts[0].len() {
        let mut total = Moments::ZERO;
        parts.iter().for_each(|part| total.include(&part[k]));
        normal.include(&total);
    }
    normal.solve().f.max(0.0)
}

/// What moved, and where: at the cut or beside it, the thing that leaves the least residual.
fn moved_at(data: &Data, cut: &Cut, outcome: &Outcome, options: &Options) -> Option<Jump> {
    let rows: Vec<usize> = (0..data.readings.len())
        .filter(|&i| data.recording[i].0 == cut.recording)
        .collect();
    let bodies = (0..data.bodies.len()).map(|b| Moved::Body(BodyIndex(b)));
    let joints = outcome.design.moving.iter().map(|j| Moved::Joint(*j));
    let things = std::iter::once(Moved::Tracker)
        .chain(bodies)
        .chain(joints)
        .chain(names(data));
    let at = |after: usize, things: Vec<Moved>| -> Vec<(Moved, f64, Size)> {
        let grouped = grouped(data, cut, after);
        let each = things.into_par_iter().map(|moved| {
            let (rms, size) = match moved {
                Moved::Tracker => tracker(&grouped),
                Moved::Body(body) => remounted(&grouped, body),
                Moved::Joint(joint) => zero(&grouped, joint),
                Moved::Names {
                    first,
                    second,
                    after,
                } => exchanged(&grouped, (first, second), after),
                // These are looked for by sums of their own.
                Moved::Rows { .. } => (f64::INFINITY, Size::default()),
            };
            (moved, rms, size)
        });
        let mut tried: Vec<_> = each.collect();
        tried.sort_by(|a, b| a.1.total_cmp(&b.1));
        tried
    };
    let mut place = rows.iter().position(|i| *i == cut.after)?;
    let mut tried = at(rows[place], things.collect());
    // The sides have markers and a tracker of their own, which a row of the other side may suit by chance.
    let beside = |k: usize| {
        let (moved, rms, _) = *at(rows[k], vec![tried[0].0]).first()?;
        Some((k, moved, rms))
    };
    let near = place.saturating_sub(BESIDE).max(1)..(place + BESIDE + 1).min(rows.len());
    let best = near.filter_map(beside).min_by(|a, b| a.2.total_cmp(&b.2));
    if let Some((k, ..)) = best.filter(|(k, _, rms)| *k != place && *rms < tried[0].1) {
        place = k;
        tried = at(rows[place], tried.iter().map(|t| t.0).collect());
    }
    let &(moved, rms, size) = tried.first()?;
    let near = tried[1..].iter().filter(|t| t.1 < rms * options.name_ratio);
    Some(Jump {
        moved,
        recording: RecordingIndex(cut.recording),
        before: rows[place - 1],
        after: rows[place],
        later: cut.later.iter().copied().map(RecordingIndex).collect(),
        size,
        rms,
        rivals: near.map(|t| t.0).collect(),
    })
}

/// Pairs of bodies whose samples could have been exchanged, on either side.
fn names(data: &Data) -> Vec<Moved> {
    let mut names = Vec::new();
    for (a, body) in data.bodies.iter().enumerate() {
        for (b, other) in data.bodies.iter().enumerate().skip(a + 1) {
            if same_shape(body, other) {
                names.extend([true, false].map(|after| Moved::Names {
                    first: BodyIndex(a),
                    second: BodyIndex(b),
                    after,
                }));
            }
        }
    }
    names
}

/// The rows before a change as recording 0, those from row `after` of the cut recording on, and of later ones, as [`AFTER`].
fn grouped(data: &Data, cut: &Cut, after: usize) -> Data {
    let mut grouped = data.clone();
    for (i, recording) in grouped.recording.iter_mut().enumerate() {
        let r = recording.0;
        let inside = cut.later.contains(&r) || (r == cut.recording && i >= after);
        *recording = RecordingIndex(usize::from(inside));
    }
    grouped
}

/// The tracker moved before the rows of [`AFTER`]: what is left, and how far.
fn tracker(grouped: &Data) -> (f64, Size) {
    let moved = Scoped {
        hypothesis: Hypothesis::TrackerMoved,
        scope: AFTER,
    };
    let settled = apply(&moved, grouped);
    let fit = Scan::new(&settled, &[]).fit(None);
    let root = fit.registration.q.tr_mul(&-fit.registration.c) + fit.center;
    let back = rigid_motion(AFTER, grouped, &settled);
    let size = back.map_or(Size::default(), |back| {
        displacement(&back.inverse(), &Point3::from(root))
    });
    (fit.score.rms, size)
}

/// Two bodies were exchanged in the rows of [`AFTER`], or in those before: what is left.
fn exchanged(grouped: &Data, (first, second): (BodyIndex, BodyIndex), after: bool) -> (f64, Size) {
    let exchanged = Scoped {
        hypothesis: Hypothesis::ExchangedBodies { first, second },
        scope: if after { AFTER } else { BEFORE },
    };
    let rms = Scan::new(&apply(&exchanged, grouped), &[]).none().rms;
    (rms, Size::default())
}

/// A body moved on its link before the rows of [`AFTER`]: what is left, and how far.
fn remounted(grouped: &Data, body: BodyIndex) -> (f64, Size) {
    let scan = Scan::new(grouped, &[]);
    let moved = Scoped {
        hypothesis: Hypothesis::Remounted { body },
        scope: AFTER,
    };
    let fit: Fit = scan.fit(Some(&moved));
    let n = scan.channels.len();
    let seen = |k: &usize| (0..2).all(|r| scan.sums[r * n + k].w > 0.0);
    let own = (0..n).filter(|k| scan.channels[*k].body == body.0);
    let own: Vec<usize> = own.filter(seen).collect();
    let places = |r: usize| -> Vec<Point3<f64>> {
        let points = own.iter().map(|k| fit.points[r * n + k]);
        points.map(Point3::from).collect()
    };
    let (from, to) = (places(0), places(1));
    let middle = |points: &[Point3<f64>]| {
        let sum: nalgebra::Vector3<f64> = points.iter().map(|p| p.coords).sum();
        Point3::from(sum / points.len().max(1) as f64)
    };
    let size = match rigid_registration(&from, &to, None) {
        Ok(found) => displacement(&found.b_from_a, &middle(&from)),
        Err(_) => Size {
            distance: (!own.is_empty()).then(|| (middle(&to) - middle(&from)).norm()),
            angle: None,
        },
    };
    (fit.score.rms, size)
}

/// The zero of a joint changed before the rows of [`AFTER`]: what is left, and by how much.
fn zero(grouped: &Data, joint: JointIndex) -> (f64, Size) {
    let all = 0..grouped.readings.len();
    let rows: Vec<usize> = all
        .filter(|&i| AFTER.contains(grouped.recording[i]) && grouped.readings[i][joint.0].is_some())
        .collect();
    let turns = grouped.chain.turns(joint.0) == Some(true);
    let (found, _) = estimated(grouped.clone(), joint, &rows, &[]);
    let offsets = rows.iter().filter_map(|&i| {
        let d = found.readings[i][joint.0]? - grouped.readings[i][joint.0]?;
        Some(if turns { d.sin().atan2(d.cos()) } else { d })
    });
    let Some(mut offset) = median(offsets.collect()) else {
        return (f64::INFINITY, Size::default());
    };
    let left = |offset: f64| {
        let mut shifted = grouped.clone();
        for &i in &rows {
            let reading = &mut shifted.readings[i][joint.0];
            *reading = reading.map(|q| q + offset);
        }
        Scan::new(&shifted, &[]).none().rms
    };
    // The squared residual is nearly a parabola of the offset.
    let mut step = if turns { STEP.0 } else { STEP.1 };
    let mut rms = left(offset);
    for _ in 0..REFINEMENTS {
        let (a, b, c) = (left(offset - step), rms, left(offset + step));
        let (a, b, c) = (a * a, b * b, c * c);
        let bend = a - 2.0 * b + c;
        let to = match bend > 0.0 {
            true => offset + (0.5 * (a - c) / bend).clamp(-2.0, 2.0) * step,
            false => offset + if a < c { -step } else { step },
        };
        let there = left(to);
        if there < rms {
            (offset, rms) = (to, there);
        }
        step *= 0.5;
    }
    let size = Size {
        distance: (!turns).then_some(offset.abs()),
        angle: turns.then_some(offset.abs()),
    };
    (rms, size)
}

fn displacement(motion: &Isometry3<f64>, of: &Point3<f64>) -> Size {
    Size {
        distance: Some((motion * of - of).norm()),
        angle: Some(motion.rotation.angle()),
    }
}
