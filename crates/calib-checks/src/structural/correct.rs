//! Corrections that need nothing but the hypothesis.

use nalgebra::Point3;

use super::data::{Body, Data, Measured};
use super::hypothesis::{Hypothesis, Scope, Scoped};
use super::ids::{BodyIndex, JointIndex, RecordingIndex};

/// The data as they would be had the mistake not been made. Hypotheses that estimate something of their own
/// ([`Hypothesis::TrackerMoved`], [`Hypothesis::MissingColumn`]) change nothing here.
#[must_use]
pub(crate) fn correct(scoped: &Scoped, data: &Data) -> Data {
    let mut corrected = data.clone();
    let h = &scoped.hypothesis;
    let inside: Vec<bool> = data
        .recording
        .iter()
        .map(|r| scoped.scope.contains(*r))
        .collect();
    match *h {
        Hypothesis::RowShift { rows } => shift(&mut corrected, data, &inside, rows),
        Hypothesis::Order { order } => {
            let columns = order.columns(&data.chain);
            for i in (0..inside.len()).filter(|&i| inside[i]) {
                let row = columns.iter().map(|column| data.readings[i][column.0]);
                corrected.readings[i] = row.collect();
            }
        }
        Hypothesis::WrongLink { body, link } => corrected.bodies[body.0].link = link,
        Hypothesis::Axis { joint, along } => {
            corrected.chain = corrected.chain.with_axis(joint, along.vector());
        }
        Hypothesis::ExchangedBodies { first, second } => {
            exchange_bodies(&mut corrected, scoped.scope, &inside, first, second)
        }
        Hypothesis::Remounted { body } => remount(&mut corrected, scoped.scope, body),
        Hypothesis::TrackerMoved | Hypothesis::MissingColumn { .. } => {}
        Hypothesis::Lag { recording, seconds } => {
            later(&mut corrected, seconds, |of, _| of == recording);
        }
        Hypothesis::Latency { joint, seconds } => {
            let inside = |of, j| scoped.scope.contains(of) && j == joint;
            later(&mut corrected, seconds, inside);
        }
        Hypothesis::LatencyBeyond { joint, seconds } => {
            let together = data.moving_with(joint);
            let inside = |of, j| scoped.scope.contains(of) && together.contains(&j);
            later(&mut corrected, seconds, inside);
        }
        Hypothesis::StoodAt { joint, value } => {
            // Where every row has a reading, it is the readings that are wrong.
            let empty = empty_rows(scoped.scope, joint, data);
            let rows = corrected.readings.iter_mut().zip(&inside);
            for (row, _) in rows.filter(|(_, inside)| **inside) {
                match empty.is_empty() {
                    true => row[joint.0] = Some(value),
                    false => _ = row[joint.0].get_or_insert(value),
                }
            }
        }
        _ => {
            correct_readings(&mut corrected, h, &inside);
            correct_measured(&mut corrected, h, &inside);
        }
    }
    corrected
}

/// Rows in the scope that do not say where the joint was: those without a reading of it, or all where its readings there never change.
pub(crate) fn open_rows(scope: Scope, joint: JointIndex, data: &Data) -> Vec<usize> {
    let empty = empty_rows(scope, joint, data);
    if !empty.is_empty() || stuck_at(scope, joint, data).is_none() {
        return empty;
    }
    let rows = 0..data.readings.len();
    rows.filter(|&i| scope.contains(data.recording[i]))
        .collect()
}

/// The reading of a joint that is the same in every row of the scope; `None` where there is none.
pub(crate) fn stuck_at(scope: Scope, joint: JointIndex, data: &Data) -> Option<f64> {
    let rows = data.readings.iter().zip(&data.recording);
    let mut inside = rows
        .filter(|(_, r)| scope.contains(**r))
        .map(|(row, _)| row[joint.0]);
    let first = inside.next()?;
    inside.all(|reading| reading == first).then_some(first)?
}

/// Rows in the scope without a reading of the joint.
pub(crate) fn empty_rows(scope: Scope, joint: JointIndex, data: &Data) -> Vec<usize> {
    let rows = 0..data.readings.len();
    rows.filter(|&i| scope.contains(data.recording[i]) && data.readings[i][joint.0].is_none())
        .collect()
}

fn correct_readings(data: &mut Data, h: &Hypothesis, inside: &[bool]) {
    let chain = &data.chain;
    for (row, _) in data
        .readings
        .iter_mut()
        .zip(inside)
        .filter(|(_, inside)| **inside)
    {
        if let Hypothesis::Exchange { first, second } = *h {
            row.swap(first.0, second.0);
        }
        if let Hypothesis::Units { mistake } = *h {
            for (joint, q) in row.iter_mut().enumerate() {
                if chain.turns(joint) == Some(mistake.of_angles()) {
                    *q = q.map(|q| q * mistake.factor());
                }
            }
        }
        if let Some(a) = h.affine() {
            let source = row[a.source].unwrap_or(0.0);
            // An empty column stays empty unless something is added to it.
            let added = a.coupling * source + a.offset;
            row[a.joint] = match row[a.joint] {
                Some(q) => Some(a.factor * q + added),
                None if added != 0.0 => Some(added),
                None => None,
            };
        }
    }
}

/// Readings of the recordings and joints that are meant, as they were `seconds` later.
fn later(data: &mut Data, seconds: f64, meant: impl Fn(RecordingIndex, JointIndex) -> bool) {
    let rows = data.readings.iter_mut().zip(&data.rates);
    for ((row, rates), of) in rows.zip(&data.recording) {
        let Some(rates) = rates else {
            continue;
        };
        for (j, (q, rate)) in row.iter_mut().zip(rates).enumerate() {
            if meant(*of, JointIndex(j)) {
                *q = q.map(|q| q + rate * seconds);
            }
        }
    }
}

fn correct_measured(data: &mut Data, h: &Hypothesis, inside: &[bool]) {
    for (b, body) in data.bodies.iter_mut().enumerate() {
        match &mut body.measured {
            Measured::Markers(points) => {
                for (row, _) in points.iter_mut().zip(inside).filter(|(_, inside)| **inside) {
                    for point in row.iter_mut().flatten() {
                        if let Some(p) = h.point(&point.coords) {
                            *point = Point3::from(p);
                        }
                    }
                }
            }
            Measured::Poses {
                tracker_from_body, ..
            } => {
                for (pose, _) in tracker_from_body
                    .iter_mut()
                    .zip(inside)
                    .filter(|(_, inside)| **inside)
                {
                    if let Some(old) = pose
                        && let Some(new) = h.pose(BodyIndex(b), old)
                    {
                        *pose = Some(new);
                    }
                }
            }
        }
    }
}

/// The row whose readings row i needs under a shift; `None` at the ends of its recording.
pub(crate) fn shifted_row(recording: &[RecordingIndex], i: usize, rows: i8) -> Option<usize> {
    let from = i.checked_add_signed(-isize::from(rows))?;
    (recording.get(from)? == &recording[i]).then_some(from)
}

fn shift(corrected: &mut Data, data: &Data, inside: &[bool], rows: i8) {
    for i in (0..inside.len()).filter(|&i| inside[i]) {
        corrected.readings[i] = match shifted_row(&data.recording, i, rows) {
            Some(from) => data.readings[from].clone(),
            // No partner: a row without readings is not used.
            None => vec![None; data.readings[i].len()],
        };
    }
}

fn exchange_bodies(
    data: &mut Data,
    scope: Scope,
    inside: &[bool],
    first: BodyIndex,
    second: BodyIndex,
) {
    if scope == Scope::All {
        let link = data.bodies[first.0].link;
        data.bodies[first.0].link = data.bodies[second.0].link;
        data.bodies[second.0].link = link;
        return;
    }
    let (head, tail) = data.bodies.split_at_mut(second.0);
    for i in (0..inside.len()).filter(|&i| inside[i]) {
        match (&mut head[first.0].measured, &mut tail[0].measured) {
            (Measured::Markers(a), Measured::Markers(b)) => std::mem::swap(&mut a[i], &mut b[i]),
            (
                Measured::Poses {
                    tracker_from_body: a,
                    ..
                },
                Measured::Poses {
                    tracker_from_body: b,
                    ..
                },
            ) => {
                std::mem::swap(&mut a[i], &mut b[i]);
            }
            _ => {}
        }
    }
}

/// Gives the recordings of the scope a mount of their own.
pub(crate) fn remount(data: &mut Data, scope: Scope, body: BodyIndex) {
    let recordings = data.recordings();
    let old: Vec<u32> = (0..recordings)
        .map(|r| data.mount(body, RecordingIndex(r)))
        .collect();
    let next = old.iter().max().map_or(1, |m| m + 1);
    let new = old.iter().enumerate();
    data.bodies[body.0].mounts = new
        .map(|(r, m)| {
            if scope.contains(RecordingIndex(r)) {
                next
            } else {
                *m
            }
        })
        .collect();
}

/// Can the two bodies' samples be exchanged in a single recording?
pub(crate) fn same_shape(a: &Body, b: &Body) -> bool {
    match (&a.measured, &b.measured) {
        (Measured::Markers(a), Measured::Markers(b)) => {
            a.first().map(Vec::len) == b.first().map(Vec::len)
        }
        (Measured::Poses { .. }, Measured::Poses { .. }) => true,
        _ => false,
    }
}
