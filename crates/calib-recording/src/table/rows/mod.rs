//! The rows of a table: numbers into samples, one row after the other.

mod cell;
mod finish;
mod of_pose;
mod sample;

use self::of_pose::PoseRows;
use super::header::{Column, Layout, SlotKind};
use crate::column_map::ColumnMap;
use crate::error::{At, Placed, Problem, excerpt};
use crate::growth::push;
use crate::model::{MarkerSample, Timeline};
use crate::placeholder::Placeholders;
use crate::text::{Number, Separator, cells, number, ragged, unquoted};
use nalgebra::Isometry3;
use std::collections::BTreeMap;

/// A long table may be this many times larger when written wide; more means that the names are no names.
const MAX_SPARSITY: usize = 100;

/// Cells that any long table may have when written wide.
const ALWAYS_ALLOWED: usize = 1 << 20;

/// Everything that grows while rows are read.
pub(super) struct Rows<'a> {
    layout: Layout,
    separator: Separator,
    map: Option<&'a ColumnMap>,
    /// Numbers have decimal commas.
    commas: bool,
    /// Numbers of the current row; NaN = empty. Never leaves this module.
    values: Vec<f64>,
    states: Vec<State>,
    entity: String,
    /// Long tables of static poses: what is known of each pose.
    poses: PoseRows,
    /// Index of the row's sample.
    sample: usize,
    labels: Vec<Vec<String>>,
    texts: Vec<String>,
    timeline: Timeline,
    times: Vec<f64>,
    received: Vec<f64>,
    joints: Vec<Vec<Option<f64>>>,
    torques: Vec<Vec<Option<f64>>>,
    temperatures: Vec<Vec<Option<f64>>>,
    markers: Vec<Vec<MarkerSample>>,
    bodies: Vec<Vec<Option<Isometry3<f64>>>>,
    /// Long tables: name → stream, names in order, current frame, samples given.
    long: BTreeMap<String, usize>,
    long_names: Vec<String>,
    frame: Option<f64>,
    samples: usize,
    dense: usize,
    zeros: BTreeMap<String, Vec<u64>>,
    placeholders: Placeholders,
    /// Rows of bodies with a position and no orientation, or the other way round.
    halves: BTreeMap<String, Vec<u64>>,
    nans: BTreeMap<String, Vec<u64>>,
    /// Columns whose times are dates, and whether these state their offset from UTC.
    dates: BTreeMap<usize, bool>,
}

#[derive(Clone, Copy, PartialEq)]
enum State {
    Measured,
    Filled,
    Lost,
}

impl<'a> Rows<'a> {
    pub(super) fn new(layout: Layout, separator: Separator, map: Option<&'a ColumnMap>) -> Self {
        let long = layout.entity.is_some();
        let streams = |count: usize| if long { 0 } else { count };
        Rows {
            values: vec![f64::NAN; layout.slots.len()],
            states: vec![State::Measured; layout.markers.len()],
            entity: String::new(),
            poses: PoseRows::default(),
            sample: 0,
            labels: vec![Vec::new(); layout.labels.len()],
            texts: vec![String::new(); layout.labels.len()],
            timeline: Timeline::default(),
            times: Vec::new(),
            received: Vec::new(),
            joints: vec![Vec::new(); layout.joints.len()],
            torques: vec![Vec::new(); layout.torques.len()],
            temperatures: vec![Vec::new(); layout.temperatures.len()],
            markers: vec![Vec::new(); streams(layout.markers.len())],
            bodies: vec![Vec::new(); streams(layout.bodies.len())],
            long: BTreeMap::new(),
            long_names: Vec::new(),
            frame: None,
            samples: 0,
            dense: 0,
            zeros: BTreeMap::new(),
            placeholders: Placeholders::default(),
            halves: BTreeMap::new(),
            nans: BTreeMap::new(),
            dates: BTreeMap::new(),
            layout,
            separator,
            map,
            commas: map.is_some_and(|map| map.decimal_comma),
        }
    }

    /// Whether there is no row yet.
    pub(super) fn is_empty(&self) -> bool {
        self.timeline.rows.is_empty()
    }

    /// Whether a row without anything in it is a sample: the rows have no time and no number, and belong by their place to those of another file.
    pub(super) fn blank_is_a_sample(&self) -> bool {
        let layout = &self.layout;
        let of = |kind: SlotKind| layout.slots.iter().any(|slot| slot.kind == kind);
        let placed = of(SlotKind::Time) || of(SlotKind::Counter) || layout.entity.is_some();
        !(placed || of(SlotKind::Robot) && of(SlotKind::Tracker))
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

    /// Reads one row.
    pub(in crate::table) fn read(&mut self, line: u64, text: &str) -> Placed<()> {
        let header = self.layout.columns.len();
        let mut found = 0;
        let mut row = cells(text, self.separator);
        loop {
            let i = found;
            if let Some(&Column::Number { slot, scale }) = self.layout.columns.get(i)
                && !self.commas
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
                        Number::Value(_) if self.has_thousands(slot, cell) => {
                            self.unusual(line, i, slot, cell, Number::Text)? / scale
                        }
                        Number::Value(value) => value / scale,
                        Number::Empty => f64::NAN,
                        kind => self.unusual(line, i, slot, cell, kind)? / scale,
                    };
                }
                Column::Label(label) => self.texts[label] = unquoted(cell),
                Column::Entity => cell.clone_into(&mut self.entity),
                Column::Pose => cell.clone_into(&mut self.poses.name),
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
            return Err((At::Line(line), ragged(text, self.separator, header)));
        }
        self.instant(line)?;
        if self.layout.entity.is_some() {
            self.long_row(line)
        } else {
            self.wide_row(line)
        }
    }

    /// Time, counter and labels of the row; rows of one frame of a long table are one sample.
    fn instant(&mut self, line: u64) -> Placed<()> {
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
        if let Some(column) = self.layout.pose {
            if self.named_pose(line, column)? {
                return Ok(());
            }
        } else if self.layout.entity.is_some() {
            let frame = self.layout.counter.map(|slot| self.values[slot]).or(time);
            let Some(frame) = frame.filter(|frame| !frame.is_nan()) else {
                let problem = Problem::Unexpected {
                    found: String::new(),
                    expected: "a frame number in every row".to_string(),
                };
                return Err((At::Line(line), problem));
            };
            match self.frame {
                Some(previous) if frame == previous => return Ok(()),
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
        self.sample = self.timeline.rows.len();
        push(&mut self.timeline.rows, line);
        time.into_iter().for_each(|t| push(&mut self.times, t));
        let received = received.into_iter();
        received.for_each(|t| push(&mut self.received, t));
        for (texts, text) in self.labels.iter_mut().zip(&self.texts) {
            push(texts, text.clone());
        }
        Ok(())
    }

    /// Joint positions, torques and temperatures of a new sample.
    fn robot(&mut self) {
        let given = |value: f64| if value.is_nan() { None } else { Some(value) };
        for ((_, _, slot), stream) in self.layout.joints.iter().zip(&mut self.joints) {
            push(stream, given(self.values[*slot]));
        }
        let torques = self.layout.torques.iter().zip(&mut self.torques);
        let warm = self.layout.temperatures.iter().zip(&mut self.temperatures);
        for ((_, slot), stream) in torques.chain(warm) {
            push(stream, given(self.values[*slot]));
        }
    }

    fn wide_row(&mut self, line: u64) -> Placed<()> {
        self.robot();
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

    fn long_row(&mut self, line: u64) -> Placed<()> {
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
        let sample = self.sample;
        let of_robot = || {
            let scalars = self.joints.iter().chain(&self.torques);
            scalars.chain(&self.temperatures)
        };
        if of_robot().any(|values| values.len() == sample) {
            self.robot();
        } else {
            self.same_robot(line)?;
        }
        let length = if is_body {
            self.bodies[stream].len()
        } else {
            self.markers[stream].len()
        };
        if self.layout.pose.is_some() {
            self.once_per_pose(line, stream)?;
        } else if length > sample {
            let problem = Problem::RepeatedSample {
                entity: if is_body { "body" } else { "marker" },
                name: self.entity.clone(),
                frame: self.frame.unwrap_or_default() as i64,
            };
            return Err((At::Line(line), problem));
        }
        self.samples += 1;
        self.dense += (sample + 1).saturating_sub(length);
        self.not_too_sparse(line)?;
        if is_body {
            let pose = self.body(line, 0)?;
            let length = length.max(sample + 1);
            self.bodies[stream].resize(length, None);
            self.bodies[stream][sample] = pose;
        } else {
            let point = self.marker(line, 0)?;
            let length = length.max(sample + 1);
            self.markers[stream].resize(length, MarkerSample::Lost);
            self.markers[stream][sample] = point;
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
}
