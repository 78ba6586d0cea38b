//! The rows of a table, in one pass.

use super::header::{BodyPlan, Column, Layout, Rotation, SlotKind};
use crate::column_map::{ColumnMap, Delimiter};
use crate::error::{At, Placed, Problem, excerpt};
use crate::growth::push;
use crate::model::{
    BodyStream, JointStream, MarkerSample, MarkerStream, Meta, Recording, Timeline, TorqueStream,
};
use crate::text::{Lines, Number, Separator, cells, not_a_number, number};
use calib_finding::{Fact, Finding, Subject, catalog};
use nalgebra::{Isometry3, Point3, Quaternion, Translation3, UnitQuaternion, Vector3};
use std::collections::BTreeMap;
use std::io::BufRead;

/// How far a quaternion's length may be from 1. Four written decimals (NDI) give 1e-4; swapped or scaled columns
/// give tenths.
pub(crate) const UNIT_TOLERANCE: f64 = 5e-3;

/// A long table may be this many times larger when written wide; more means that the names are no names.
const MAX_SPARSITY: usize = 100;

/// Cells that any long table may have when written wide.
const ALWAYS_ALLOWED: usize = 1 << 20;

/// The comment that a table carries which is written while it is recorded: such a table may end in the middle of a
/// row, and a row is whole when its line break is there.
pub const WRITTEN_LIVE: &str = "written live: a last line without line break was cut off";

/// Reads a wide or long table. `map` must be resolved (no preset left).
pub(crate) fn read_table(input: impl BufRead, map: Option<&ColumnMap>) -> Placed<Recording> {
    let mut lines = Lines::new(input);
    let mut comments = Vec::new();
    let (layout, separator) = match read_header(&mut lines, map, &mut comments)? {
        Some(found) => found,
        None if lines.number() == 0 => return Err((At::File, Problem::Empty)),
        None => return Err((At::Line(lines.number()), Problem::NoRows)),
    };
    let mut rows = Rows::new(layout, separator, map);
    let live = comments.iter().any(|comment| comment == WRITTEN_LIVE);
    let mut cut = None;
    loop {
        let number = lines.number() + 1;
        let Some((line, whole)) = lines.next_whole()? else {
            break;
        };
        if live && !whole {
            cut = Some(number);
            break;
        }
        if let Some(comment) = line.strip_prefix('#') {
            comments.push(comment.trim().to_string());
        } else if !line.bytes().all(|b| b.is_ascii_whitespace()) {
            rows.read(number, line)?;
        }
    }
    if rows.timeline.rows.is_empty() {
        return Err((At::Line(lines.number()), Problem::NoRows));
    }
    let mut recording = rows.finish()?;
    recording.meta.findings.extend(
        cut.map(|line| Finding::new(catalog::ROW_CUT_OFF, Subject::default()).at_rows([line])),
    );
    recording.meta.comments = comments;
    Ok(recording)
}

fn read_header<R: BufRead>(
    lines: &mut Lines<R>,
    map: Option<&ColumnMap>,
    comments: &mut Vec<String>,
) -> Placed<Option<(Layout, Separator)>> {
    let given = map
        .and_then(|map| map.delimiter)
        .map(|delimiter| match delimiter {
            Delimiter::Comma => Separator::Byte(b','),
            Delimiter::Semicolon => Separator::Byte(b';'),
            Delimiter::Tab => Separator::Byte(b'\t'),
            Delimiter::Space => Separator::Blanks,
        });
    for _ in 0..map.map_or(0, |map| map.skip_lines) {
        if lines.next()?.is_none() {
            return Ok(None);
        }
    }
    if let Some(map) = map
        && !map.names.is_empty()
    {
        let separator = given.unwrap_or(Separator::Byte(b','));
        return Ok(Some((
            Layout::new(lines.number(), map.names.clone(), Some(map))?,
            separator,
        )));
    }
    loop {
        let number = lines.number() + 1;
        let Some(line) = lines.next()? else {
            return Ok(None);
        };
        if let Some(comment) = line
            .strip_prefix('#')
            .filter(|_| !map_names_start_with_hash(map))
        {
            comments.push(comment.trim().to_string());
        } else if !line.trim().is_empty() {
            let separator = given.unwrap_or_else(|| Separator::guess(line));
            let names = cells(line, separator).map(str::to_string).collect();
            return Ok(Some((Layout::new(number, names, map)?, separator)));
        }
    }
}

/// A map that names a column `#…` reads a header line that starts with `#`.
fn map_names_start_with_hash(map: Option<&ColumnMap>) -> bool {
    map.is_some_and(|map| {
        map.time.iter().any(|time| time.column.starts_with('#'))
            || map.joint_columns.iter().any(|c| c.starts_with('#'))
    })
}

/// Everything that grows while rows are read.
struct Rows<'a> {
    layout: Layout,
    separator: Separator,
    map: Option<&'a ColumnMap>,
    /// Numbers of the current row; NaN = empty. Never leaves this module.
    values: Vec<f64>,
    states: Vec<State>,
    entity: String,
    labels: Vec<Vec<String>>,
    texts: Vec<String>,
    timeline: Timeline,
    times: Vec<f64>,
    received: Vec<f64>,
    joints: Vec<Vec<Option<f64>>>,
    torques: Vec<Vec<Option<f64>>>,
    markers: Vec<Vec<MarkerSample>>,
    bodies: Vec<Vec<Option<Isometry3<f64>>>>,
    /// Long tables: name → stream, names in order, current frame, samples given.
    long: BTreeMap<String, usize>,
    long_names: Vec<String>,
    frame: Option<f64>,
    samples: usize,
    dense: usize,
    zeros: BTreeMap<String, Vec<u64>>,
    nans: BTreeMap<String, Vec<u64>>,
}

#[derive(Clone, Copy, PartialEq)]
enum State {
    Measured,
    Filled,
    Lost,
}

impl<'a> Rows<'a> {
    fn new(layout: Layout, separator: Separator, map: Option<&'a ColumnMap>) -> Self {
        let long = layout.entity.is_some();
        let streams = |count: usize| if long { 0 } else { count };
        Rows {
            values: vec![f64::NAN; layout.slots.len()],
            states: vec![State::Measured; layout.markers.len()],
            entity: String::new(),
            labels: vec![Vec::new(); layout.labels.len()],
            texts: vec![String::new(); layout.labels.len()],
            timeline: Timeline::default(),
            times: Vec::new(),
            received: Vec::new(),
            joints: vec![Vec::new(); layout.joints.len()],
            torques: vec![Vec::new(); layout.torques.len()],
            markers: vec![Vec::new(); streams(layout.markers.len())],
            bodies: vec![Vec::new(); streams(layout.bodies.len())],
            long: BTreeMap::new(),
            long_names: Vec::new(),
            frame: None,
            samples: 0,
            dense: 0,
            zeros: BTreeMap::new(),
            nans: BTreeMap::new(),
            layout,
            separator,
            map,
        }
    }

    fn at(&self, line: u64, column: usize) -> At {
        let name = self
            .layout
            .names
            .get(column)
            .filter(|name| !name.is_empty());
        At::Cell {
            line,
            column: name.cloned().unwrap_or_else(|| format!("#{}", column + 1)),
        }
    }

    fn read(&mut self, line: u64, text: &str) -> Placed<()> {
        let header = self.layout.columns.len();
        let mut found = 0;
        let mut row = cells(text, self.separator);
        loop {
            let i = found;
            if let Some(&Column::Number { slot, scale }) = self.layout.columns.get(i)
                && let Some(value) = row.decimal()
            {
                self.values[slot] = if scale == 1.0 { value } else { value / scale };
                found += 1;
                continue;
            }
            let Some(cell) = row.next() else { break };
            found += 1;
            let Some(&column) = self.layout.columns.get(i) else {
                if cell.is_empty() && i == header && row.is_at_end() {
                    found = i;
                    break;
                }
                continue;
            };
            match column {
                Column::Ignore => {}
                Column::Number { slot, scale } => {
                    self.values[slot] = match number(cell) {
                        Number::Value(value) => value / scale,
                        Number::Empty => f64::NAN,
                        kind => self.unusual(line, i, slot, cell, kind)? / scale,
                    };
                }
                Column::Label(label) => cell.clone_into(&mut self.texts[label]),
                Column::Entity => cell.clone_into(&mut self.entity),
                Column::State(marker) => {
                    self.states[marker] = match cell {
                        "" | "measured" => State::Measured,
                        "filled" => State::Filled,
                        "lost" => State::Lost,
                        _ => {
                            let problem = Problem::Unexpected {
                                found: excerpt(cell, 40),
                                expected: "measured, filled or lost".to_string(),
                            };
                            return Err((self.at(line, i), problem));
                        }
                    };
                }
            }
        }
        if found != header {
            return Err((
                At::Line(line),
                Problem::Ragged {
                    found,
                    expected: header,
                },
            ));
        }
        let new_sample = self.instant(line)?;
        if self.layout.entity.is_some() {
            self.long_row(line, new_sample)
        } else {
            self.wide_row(line)
        }
    }

    /// A cell that is no plain number: a lost code, `nan`, a decimal comma, or an error.
    fn unusual(
        &mut self,
        line: u64,
        column: usize,
        slot: usize,
        cell: &str,
        kind: Number,
    ) -> Placed<f64> {
        let kind = match kind {
            Number::Text
                if self
                    .map
                    .is_some_and(|map| map.lost.iter().any(|code| code == cell)) =>
            {
                return Ok(f64::NAN);
            }
            Number::Text
                if self.map.is_some_and(|map| map.decimal_comma)
                    && cell.matches(',').count() == 1 =>
            {
                match number(&cell.replace(',', ".")) {
                    Number::Value(value) => return Ok(value),
                    kind => kind,
                }
            }
            kind => kind,
        };
        if kind == Number::Nan && self.layout.slots[slot].kind == SlotKind::Tracker {
            let rows = self
                .nans
                .entry(self.layout.names[column].clone())
                .or_default();
            rows.push(line);
            return Ok(f64::NAN);
        }
        let expected = if cell.contains(',') {
            "a number with a decimal point (a column map can say `decimal_comma: true`)"
        } else {
            "a number, or nothing where the sample was lost"
        };
        Err((self.at(line, column), not_a_number(cell, kind, expected)))
    }

    /// Time, counter and labels of the row; whether it starts a new sample.
    fn instant(&mut self, line: u64) -> Placed<bool> {
        let clock = |slot: Option<usize>| match slot {
            Some(slot) if self.values[slot].is_nan() => {
                let problem = Problem::Unexpected {
                    found: String::new(),
                    expected: "a time in every row".to_string(),
                };
                Err((self.at(line, self.layout.slots[slot].column), problem))
            }
            Some(slot) => Ok(Some(self.values[slot])),
            None => Ok(None),
        };
        let time = clock(self.layout.time)?;
        let received = clock(self.layout.received)?;
        if let (Some(found), Some(&previous)) = (time, self.times.last())
            && found < previous
        {
            return Err((At::Line(line), Problem::TimeBackwards { previous, found }));
        }
        if self.layout.entity.is_some() {
            let frame = self.layout.counter.map(|slot| self.values[slot]).or(time);
            let Some(frame) = frame.filter(|frame| !frame.is_nan()) else {
                let problem = Problem::Unexpected {
                    found: String::new(),
                    expected: "a frame number in every row".to_string(),
                };
                return Err((At::Line(line), problem));
            };
            match self.frame {
                Some(previous) if frame == previous => return Ok(false),
                Some(previous) if frame < previous => {
                    let problem = Problem::FrameBackwards {
                        previous: previous as i64,
                        found: frame as i64,
                    };
                    return Err((At::Line(line), problem));
                }
                _ => self.frame = Some(frame),
            }
        }
        push(&mut self.timeline.rows, line);
        time.into_iter().for_each(|t| push(&mut self.times, t));
        let received = received.into_iter();
        received.for_each(|t| push(&mut self.received, t));
        for (texts, text) in self.labels.iter_mut().zip(&self.texts) {
            push(texts, text.clone());
        }
        Ok(true)
    }

    fn wide_row(&mut self, line: u64) -> Placed<()> {
        let given = |value: f64| if value.is_nan() { None } else { Some(value) };
        for ((_, _, slot), stream) in self.layout.joints.iter().zip(&mut self.joints) {
            push(stream, given(self.values[*slot]));
        }
        for ((_, slot), stream) in self.layout.torques.iter().zip(&mut self.torques) {
            push(stream, given(self.values[*slot]));
        }
        for i in 0..self.markers.len() {
            let sample = self.marker(line, i)?;
            push(&mut self.markers[i], sample);
        }
        for i in 0..self.bodies.len() {
            let pose = self.body(line, i)?;
            push(&mut self.bodies[i], pose);
        }
        Ok(())
    }

    fn long_row(&mut self, line: u64, _new_sample: bool) -> Placed<()> {
        let column = self.layout.entity.unwrap_or_default();
        if self.entity.is_empty() {
            let problem = Problem::Unexpected {
                found: String::new(),
                expected: "the name of a marker or body".to_string(),
            };
            return Err((self.at(line, column), problem));
        }
        let is_body = !self.layout.bodies.is_empty();
        let stream = match self.long.get(&self.entity) {
            Some(&stream) => stream,
            None => {
                let stream = self.long_names.len();
                self.long.insert(self.entity.clone(), stream);
                self.long_names.push(self.entity.clone());
                if is_body {
                    self.bodies.push(Vec::new())
                } else {
                    self.markers.push(Vec::new())
                }
                stream
            }
        };
        let sample = self.timeline.rows.len() - 1;
        let length = if is_body {
            self.bodies[stream].len()
        } else {
            self.markers[stream].len()
        };
        if length > sample {
            let problem = Problem::RepeatedSample {
                entity: if is_body { "body" } else { "marker" },
                name: self.entity.clone(),
                frame: self.frame.unwrap_or_default() as i64,
            };
            return Err((At::Line(line), problem));
        }
        self.samples += 1;
        self.dense += sample + 1 - length;
        self.not_too_sparse(line)?;
        if is_body {
            let pose = self.body(line, 0)?;
            self.bodies[stream].resize(sample, None);
            push(&mut self.bodies[stream], pose);
        } else {
            let point = self.marker(line, 0)?;
            self.markers[stream].resize(sample, MarkerSample::Lost);
            push(&mut self.markers[stream], point);
        }
        Ok(())
    }

    fn not_too_sparse(&self, line: u64) -> Placed<()> {
        if self.dense > ALWAYS_ALLOWED + MAX_SPARSITY * self.samples {
            let problem = Problem::TooSparse {
                entities: self.long_names.len(),
                frames: self.timeline.rows.len(),
                samples: self.samples,
            };
            return Err((At::Line(line), problem));
        }
        Ok(())
    }

    fn name_of<'b>(&'b self, plan: &'b str) -> &'b str {
        if plan.is_empty() { &self.entity } else { plan }
    }

    fn marker(&mut self, line: u64, index: usize) -> Placed<MarkerSample> {
        let plan = &self.layout.markers[index];
        let [x, y, z] = plan.slots.map(|slot| self.values[slot]);
        let given = [x, y, z].iter().filter(|value| !value.is_nan()).count();
        let state = self.states[index];
        if given == 0 || state == State::Lost {
            return Ok(MarkerSample::Lost);
        }
        if given < 3 {
            let name = self.name_of(&plan.name).to_string();
            return Err((
                At::Line(line),
                Problem::PartlyLost {
                    entity: "marker",
                    name,
                    given,
                    needed: 3,
                },
            ));
        }
        if x == 0.0 && y == 0.0 && z == 0.0 && !self.map.is_some_and(|map| map.zero_is_a_point) {
            let name = self.name_of(&plan.name).to_string();
            self.zeros.entry(name).or_default().push(line);
            return Ok(MarkerSample::Lost);
        }
        let point = Point3::new(x, y, z);
        Ok(if state == State::Filled {
            MarkerSample::Filled(point)
        } else {
            MarkerSample::Measured(point)
        })
    }

    fn body(&mut self, line: u64, index: usize) -> Placed<Option<Isometry3<f64>>> {
        let BodyPlan {
            name,
            position,
            rotation,
        } = &self.layout.bodies[index];
        let name = self.name_of(name).to_string();
        let slots = position.iter().chain(rotation.slots());
        let needed = 3 + rotation.slots().len();
        let given = slots
            .clone()
            .filter(|&&slot| !self.values[slot].is_nan())
            .count();
        if given == 0 {
            return Ok(None);
        }
        if given < needed {
            return Err((
                At::Line(line),
                Problem::PartlyLost {
                    entity: "body",
                    name,
                    given,
                    needed,
                },
            ));
        }
        if slots.clone().all(|&slot| self.values[slot] == 0.0)
            && matches!(rotation, Rotation::Quaternion(_))
        {
            self.zeros.entry(name).or_default().push(line);
            return Ok(None);
        }
        let value = |slot: usize| self.values[slot];
        let rotation = match rotation {
            Rotation::Quaternion([x, y, z, w]) => {
                let q = Quaternion::new(value(*w), value(*x), value(*y), value(*z));
                let norm = q.norm();
                if (norm - 1.0).abs() > UNIT_TOLERANCE {
                    return Err((
                        At::Line(line),
                        Problem::NotUnit {
                            body: name,
                            norm,
                            tolerance: UNIT_TOLERANCE,
                        },
                    ));
                }
                UnitQuaternion::from_quaternion(q)
            }
            Rotation::Vector(slots) => {
                let [x, y, z] = slots.map(value);
                UnitQuaternion::from_scaled_axis(Vector3::new(x, y, z))
            }
            Rotation::FixedXyz(slots) => {
                let [a, b, c] = slots.map(value);
                UnitQuaternion::from_euler_angles(a, b, c)
            }
        };
        let [x, y, z] = position.map(value);
        Ok(Some(Isometry3::from_parts(
            Translation3::new(x, y, z),
            rotation,
        )))
    }

    fn finish(mut self) -> Placed<Recording> {
        let n = self.timeline.rows.len();
        if self.layout.entity.is_some() {
            let lengths = self
                .markers
                .iter()
                .map(Vec::len)
                .chain(self.bodies.iter().map(Vec::len));
            self.dense += lengths.map(|length| n - length).sum::<usize>();
            self.not_too_sparse(self.timeline.rows.last().copied().unwrap_or_default())?;
            self.markers
                .iter_mut()
                .for_each(|stream| stream.resize(n, MarkerSample::Lost));
            self.bodies
                .iter_mut()
                .for_each(|stream| stream.resize(n, None));
        }
        let findings = self.findings();
        let timed = self.layout.time.is_some();
        self.timeline.clock = if timed { "t_s" } else { "static poses" }.to_string();
        self.timeline.t = timed.then_some(self.times);
        self.timeline.received = self.layout.received.map(|_| self.received);
        self.timeline.labels = self
            .layout
            .labels
            .iter()
            .cloned()
            .zip(self.labels)
            .collect();
        let long = self.layout.entity.is_some();
        let names = |plans: Vec<String>| if long { self.long_names.clone() } else { plans };
        let marker_names = names(
            self.layout
                .markers
                .iter()
                .map(|plan| plan.name.clone())
                .collect(),
        );
        let body_names = names(
            self.layout
                .bodies
                .iter()
                .map(|plan| plan.name.clone())
                .collect(),
        );
        Ok(Recording {
            meta: Meta {
                conversions: self.layout.conversions,
                findings,
                ..Meta::default()
            },
            timelines: vec![self.timeline],
            joints: self
                .layout
                .joints
                .into_iter()
                .zip(self.joints)
                .map(|((name, unit, _), q)| JointStream {
                    name,
                    timeline: 0,
                    unit,
                    q,
                })
                .collect(),
            torques: self
                .layout
                .torques
                .into_iter()
                .zip(self.torques)
                .map(|((name, _), torque)| TorqueStream {
                    name,
                    timeline: 0,
                    torque,
                })
                .collect(),
            bodies: body_names
                .into_iter()
                .zip(self.bodies)
                .map(|(name, tracker_from_body)| BodyStream {
                    name,
                    timeline: 0,
                    tracker_from_body,
                    quality: Vec::new(),
                    covariance: Vec::new(),
                })
                .collect(),
            markers: marker_names
                .into_iter()
                .zip(self.markers)
                .map(|(name, samples)| MarkerStream {
                    name,
                    body: None,
                    unlabelled: false,
                    timeline: 0,
                    samples,
                })
                .collect(),
        })
    }

    fn findings(&mut self) -> Vec<Finding> {
        let zeros = std::mem::take(&mut self.zeros)
            .into_iter()
            .map(|(name, rows)| {
                Finding::of_kind(catalog::ALL_ZERO_TRIPLET, "lost", Subject::marker(name))
                    .with("samples", Fact::count(rows.len()))
                    .at_rows(rows)
            });
        let nans = std::mem::take(&mut self.nans)
            .into_iter()
            .map(|(column, rows)| {
                Finding::of_kind(catalog::NOT_A_NUMBER, "cells", Subject::column(column))
                    .with("count", Fact::count(rows.len()))
                    .at_rows(rows)
            });
        zeros.chain(nans).collect()
    }
}
