//! Which hypotheses are tried on given data, and in which scopes.

use std::collections::BTreeSet;

use super::chain::Motion;
use super::correct::{same_shape, stuck_at};
use super::data::{Body, Data, Measured};
use super::hypothesis::{Direction, Hypothesis, PoseMistake, QuarterTurns, Scope};
use super::ids::{BodyIndex, JointIndex, LinkIndex, RecordingIndex};
use super::order::ColumnOrder;
use super::scan::Scan;
use super::thinning::thinned;
use super::units::{TRACKER_UNITS, UnitMistake};

/// A column whose values differ by less (rad or m) carries no information about its own sign or unit.
const MOVES: f64 = 1e-6;
/// With more recordings a fault in all but one is left to the pairs: the scopes would outnumber the hypotheses.
const MOST_RECORDINGS_EXCEPT: usize = 6;

/// Rows by which the readings of a table may lag.
const LAGS: [i8; 4] = [1, -1, 2, -2];

/// A hypothesis with its scopes.
pub(crate) type Candidate = (Hypothesis, Vec<Scope>);

/// Everything that is tried; the order is fixed.
pub(crate) fn candidates(data: &Data) -> Vec<Candidate> {
    let parts = parts(&recordings_present(data));
    let everywhere = everywhere(data);
    let mut list: Vec<Candidate> = Vec::new();
    of_readings(data, &everywhere, &mut list);
    list.extend(possible_axes(data));
    of_claims(data, &parts, &mut list);
    of_tracker(data, &everywhere, &parts, &mut list);
    of_missing(data, &mut list);
    list
}

/// All data, and the scopes that are a part of them.
pub(super) fn everywhere(data: &Data) -> Vec<Scope> {
    let parts = parts(&recordings_present(data));
    std::iter::once(Scope::All).chain(parts).collect()
}

fn recordings_present(data: &Data) -> Vec<RecordingIndex> {
    let mut present: Vec<RecordingIndex> = data.recording.clone();
    present.sort_unstable();
    present.dedup();
    present
}

/// Scopes that are a part of the data.
fn parts(present: &[RecordingIndex]) -> Vec<Scope> {
    let mut parts = Vec::new();
    if present.len() > 1 {
        parts.extend(present.iter().map(|r| Scope::Recording(*r)));
    }
    if (3..=MOST_RECORDINGS_EXCEPT).contains(&present.len()) {
        parts.extend(present.iter().map(|r| Scope::AllExcept(*r)));
    }
    parts
}

/// The largest difference of a joint's readings.
pub(crate) fn span(data: &Data, joint: JointIndex) -> f64 {
    let values = || data.readings.iter().map(|row| row[joint.0].unwrap_or(0.0));
    let high = values().fold(f64::NEG_INFINITY, f64::max);
    let low = values().fold(f64::INFINITY, f64::min);
    if high >= low { high - low } else { 0.0 }
}

/// A joint that is recorded turns further, rad (3°).
const LEAST_TURN: f64 = 0.05;
/// A joint that is recorded slides further, m.
const LEAST_WAY: f64 = 2e-3;

fn of_readings(data: &Data, scopes: &[Scope], list: &mut Vec<Candidate>) {
    use UnitMistake::{DegreesReadAsRadians, RadiansReadAsDegrees};
    let joints = data.relevant_joints();
    let empty = data.assumed_zero();
    let mut add = |h: Hypothesis| list.push((h, scopes.to_vec()));
    let lengths = || {
        let all = TRACKER_UNITS.into_iter();
        all.map(|(unit, read_as)| UnitMistake::Length { unit, read_as })
    };
    for &joint in &joints {
        let Some(revolute) = data.chain.turns(joint.0) else {
            continue;
        };
        if span(data, joint) > MOVES {
            add(Hypothesis::Sign { joint });
            let units = match revolute {
                true => vec![DegreesReadAsRadians, RadiansReadAsDegrees],
                false => lengths().collect(),
            };
            // A unit that leaves a joint hardly any motion says that it stood still: that is another mistake.
            let least = if revolute { LEAST_TURN } else { LEAST_WAY };
            units
                .into_iter()
                .filter(|unit| unit.factor() > 1.0 || span(data, joint) * unit.factor() > least)
                .for_each(|mistake| add(Hypothesis::Unit { joint, mistake }));
        }
        // Of an empty column it is asked where the joint stood.
        if revolute && !empty.iter().any(|e| e.0 == joint) {
            for turns in [
                QuarterTurns::Plus90,
                QuarterTurns::Minus90,
                QuarterTurns::Half,
            ] {
                add(Hypothesis::Offset { joint, turns });
            }
        }
    }
    for (n, &first) in joints.iter().enumerate() {
        for &second in &joints[n + 1..] {
            if span(data, first).max(span(data, second)) > MOVES {
                add(Hypothesis::Exchange { first, second });
            }
        }
    }
    for order in ColumnOrder::of(data) {
        add(Hypothesis::Order { order });
    }
    for &joint in &joints {
        for &source in &joints {
            let alike = joint != source && data.chain.turns(joint.0) == data.chain.turns(source.0);
            if alike && span(data, source) > MOVES {
                for factor in [1.0, -1.0] {
                    add(Hypothesis::Coupling {
                        joint,
                        source,
                        factor,
                    });
                }
            }
        }
    }
    // With a single moving column of a kind its own unit is the same hypothesis.
    let moving = |turning| {
        let of_kind = |j: &&JointIndex| data.chain.turns(j.0) == Some(turning);
        let moves = |j: &&JointIndex| span(data, **j) > MOVES;
        joints.iter().filter(of_kind).filter(moves).count()
    };
    // Of a robot that only slides, another unit of its joints is as good a guess as another one of the tracker.
    for mistake in [DegreesReadAsRadians, RadiansReadAsDegrees]
        .into_iter()
        .chain(lengths())
    {
        if moving(mistake.of_angles()) > 1 {
            add(Hypothesis::Units { mistake });
        }
    }
    for rows in LAGS {
        add(Hypothesis::RowShift { rows });
    }
}

fn of_claims(data: &Data, parts: &[Scope], list: &mut Vec<Candidate>) {
    let group = |link| data.chain.rigid_group(link);
    let mut groups: Vec<LinkIndex> = (0..data.chain.links())
        .map(|l| group(LinkIndex(l)))
        .collect();
    groups.sort_unstable();
    groups.dedup();
    for (b, body) in data.bodies.iter().enumerate() {
        for &link in groups.iter().filter(|link| **link != group(body.link)) {
            list.push((
                Hypothesis::WrongLink {
                    body: BodyIndex(b),
                    link,
                },
                vec![Scope::All],
            ));
        }
        list.push((Hypothesis::Remounted { body: BodyIndex(b) }, single(parts)));
        for (c, other) in data.bodies.iter().enumerate().skip(b + 1) {
            let h = Hypothesis::ExchangedBodies {
                first: BodyIndex(b),
                second: BodyIndex(c),
            };
            if group(body.link) != group(other.link) {
                list.push((h, vec![Scope::All]));
            }
        }
    }
    list.retain(|c| !c.1.is_empty());
}

/// Only single recordings: the complement is the same partition.
fn single(parts: &[Scope]) -> Vec<Scope> {
    let only: Vec<Scope> = parts
        .iter()
        .copied()
        .filter(|s| matches!(s, Scope::Recording(_)))
        .collect();
    // With two recordings the one is the complement of the other.
    if only.len() == 2 {
        only[1..].to_vec()
    } else {
        only
    }
}

fn of_tracker(data: &Data, everywhere: &[Scope], parts: &[Scope], list: &mut Vec<Candidate>) {
    for (unit, read_as) in TRACKER_UNITS {
        list.push((
            Hypothesis::TrackerUnit { unit, read_as },
            everywhere.to_vec(),
        ));
    }
    list.push((Hypothesis::Mirrored, everywhere.to_vec()));
    let one = single(parts);
    if !one.is_empty() {
        for rotation in 1..24 {
            list.push((Hypothesis::TrackerAxes { rotation }, one.clone()));
        }
        list.push((Hypothesis::TrackerMoved, one));
    }
    let posed: Vec<BodyIndex> = data
        .bodies
        .iter()
        .enumerate()
        .filter(|(_, b)| matches!(b.measured, Measured::Poses { .. }))
        .map(|(b, _)| BodyIndex(b))
        .collect();
    if posed.is_empty() {
        return;
    }
    let mut which = vec![None];
    if data.bodies.len() > 1 {
        which.extend(posed.into_iter().map(Some));
    }
    for body in which {
        for mistake in [
            PoseMistake::ScalarFirstReadAsLast,
            PoseMistake::ScalarLastReadAsFirst,
            PoseMistake::Inverse,
            PoseMistake::Transposed,
        ] {
            list.push((Hypothesis::Poses { body, mistake }, everywhere.to_vec()));
        }
    }
}

/// Joints that never moved by their readings, in all recordings or in one of a few, and may have stood elsewhere or moved.
pub(crate) fn of_still(data: &Data) -> Vec<Candidate> {
    let present = recordings_present(data);
    let few = present.len() <= MOST_RECORDINGS_EXCEPT;
    let parts: Vec<Scope> = present.into_iter().map(Scope::Recording).collect();
    let joints = data.relevant_joints().into_iter();
    let still = joints.filter(|joint| data.chain.turns(joint.0).is_some());
    let of = |joint: JointIndex| {
        let stuck = |scope: &Scope| stuck_at(*scope, joint, data).is_some();
        let scopes: Vec<Scope> = match stuck(&Scope::All) {
            true => vec![Scope::All],
            false if few => parts.iter().copied().filter(stuck).collect(),
            false => Vec::new(),
        };
        (!scopes.is_empty()).then_some((Hypothesis::MissingColumn { joint }, scopes))
    };
    still.filter_map(of).collect()
}

/// Axes of joints along other coordinates than the model has them: a URDF has `1 0 0` where none is written. A reversed axis is the sign of the joint; only
/// of a joint that follows another one, which has no sign of its own, it is the multiplier. An axis between coordinates was written with care.
fn of_axes(data: &Data) -> Vec<Candidate> {
    /// A cosine from which on a direction is that of a coordinate axis.
    const ALONG: f64 = 1.0 - 1e-6;
    let bodies = data.bodies.iter();
    let paths = bodies.flat_map(|body| data.chain.path(body.link));
    let joints: BTreeSet<JointIndex> = paths.collect();
    let moving = joints.into_iter().filter_map(|joint| {
        let own = &data.chain.joints()[joint.0];
        let moves = own
            .law
            .iter()
            .any(|(source, _)| span(data, *source) > MOVES);
        let follows = own.law.iter().all(|(source, _)| *source != joint);
        match own.motion {
            Motion::Revolute(axis) | Motion::Prismatic(axis) if moves => {
                Some((joint, axis, follows))
            }
            _ => None,
        }
    });
    moving
        .filter(|(_, axis, _)| axis.amax() > ALONG)
        .flat_map(|(joint, axis, follows)| {
            let others = Direction::ALL.into_iter().filter(move |along| {
                let same = along.vector().dot(&axis);
                same.abs() < 0.5 || follows && same < 0.0
            });
            others.map(move |along| (Hypothesis::Axis { joint, along }, vec![Scope::All]))
        })
        .collect()
}

/// Axes of joints that some of the rows allow: most are far from all of them.
fn possible_axes(data: &Data) -> Vec<Candidate> {
    /// Rows that are looked at.
    const ROWS: usize = 60;
    /// An axis that leaves more than this many times the residual of the data as they are explains nothing.
    const MOST: f64 = 1.2;
    let mut axes = of_axes(data);
    let part = data.select(&thinned(data, ROWS));
    let scan = Scan::new(&part, &[]);
    let most = MOST * scan.none().score;
    axes.retain(|(hypothesis, scopes)| {
        let scored = scan.score(hypothesis, scopes, most);
        scored.iter().any(|s| s.score.score <= most)
    });
    axes
}

fn of_missing(data: &Data, list: &mut Vec<Candidate>) {
    let empty = data.assumed_zero();
    let present = recordings_present(data);
    for joint in data.relevant_joints() {
        let at: Vec<RecordingIndex> = empty.iter().filter(|e| e.0 == joint).map(|e| e.1).collect();
        if data.chain.turns(joint.0).is_none() || at.is_empty() {
            continue;
        }
        // Everywhere: in all recordings without the column.
        let everywhere = at.len() == present.len();
        let mut scopes = Vec::new();
        if everywhere || at.len() > 1 {
            scopes.push(Scope::All);
        }
        if !everywhere {
            scopes.extend(at.into_iter().map(Scope::Recording));
        }
        list.push((Hypothesis::MissingColumn { joint }, scopes));
    }
    let bodies = &data.bodies;
    for (a, body) in bodies.iter().enumerate() {
        for (b, other) in bodies.iter().enumerate().skip(a + 1) {
            if present.len() > 1 && same_shape(body, other) {
                let h = Hypothesis::ExchangedBodies {
                    first: BodyIndex(a),
                    second: BodyIndex(b),
                };
                let scopes = present
                    .iter()
                    .filter(|r| seen_together(data, **r, body, other));
                let scopes: Vec<Scope> = scopes.map(|r| Scope::Recording(*r)).collect();
                if !scopes.is_empty() {
                    list.push((h, scopes));
                }
            }
        }
    }
}

/// Whether a row of the recording has both bodies. Those that are never seen together, as a body before and after it
/// moved on its link, cannot have been exchanged.
fn seen_together(data: &Data, recording: RecordingIndex, a: &Body, b: &Body) -> bool {
    let rows = data.recording.iter().enumerate();
    let mut rows = rows.filter(|(_, r)| **r == recording);
    rows.any(|(row, _)| a.measured.seen(row) && b.measured.seen(row))
}
