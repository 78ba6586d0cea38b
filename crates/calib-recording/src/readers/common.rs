//! What the readers of tracker files share: rows of numbers, three coordinates to a sample, unique names.

use super::ReadOptions;
use crate::error::{At, Placed, Problem};
use crate::growth::push;
use crate::model::{BodyStream, MarkerSample, MarkerStream};
use crate::placeholder::{Placeholders, is_placeholder_point};
use crate::text::{Number, Separator, cells, not_a_number, number, ragged};
use calib_finding::{About, Fact, Finding, Subject, catalog};
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion};
use std::collections::BTreeMap;

/// The numbers of a row; NaN = empty or a word for it. The row may be shorter than `columns` (trackers drop what is
/// lost at the end), not longer except by empty cells. `values` keeps its length.
pub(super) fn numbers(
    line: u64,
    text: &str,
    separator: Separator,
    columns: usize,
    values: &mut Vec<f64>,
) -> Placed<()> {
    values.clear();
    let mut row = cells(text, separator);
    // Plain numbers, one after the other; the first cell that is none, or one too many, goes the long way.
    loop {
        while values.len() < columns
            && let Some(value) = row.decimal()
        {
            values.push(value);
        }
        let i = values.len();
        if i >= columns {
            break;
        }
        let Some(cell) = row.next() else { break };
        values.push(cell_value(line, i, cell)?);
    }
    for (i, cell) in row.enumerate() {
        if !cell_value(line, columns + i, cell)?.is_nan() {
            return Err((At::Line(line), ragged(text, separator, columns)));
        }
    }
    values.resize(columns, f64::NAN);
    Ok(())
}

/// The number of a cell, NaN when there is none; `i` is its position from 0.
fn cell_value(line: u64, i: usize, cell: &str) -> Placed<f64> {
    match number(cell) {
        Number::Value(value) => Ok(value),
        Number::Empty | Number::Nan => Ok(f64::NAN),
        kind => {
            let at = At::Cell {
                line,
                column: format!("#{}", i + 1),
            };
            let problem =
                not_a_number(cell, kind, "a number, or nothing where the sample was lost");
            Err((at, problem))
        }
    }
}

/// A group of coordinates: all, none (lost), or a mistake.
pub(super) enum Triplet {
    Lost,
    Zero,
    Point(Point3<f64>),
}

pub(super) fn triplet(
    line: u64,
    name: &str,
    [x, y, z]: [f64; 3],
    units_per_meter: f64,
) -> Placed<Triplet> {
    let given = [x, y, z].iter().filter(|value| !value.is_nan()).count();
    match given {
        0 => Ok(Triplet::Lost),
        3 if x == 0.0 && y == 0.0 && z == 0.0 => Ok(Triplet::Zero),
        3 => Ok(Triplet::Point(Point3::new(
            x / units_per_meter,
            y / units_per_meter,
            z / units_per_meter,
        ))),
        given => Err((
            At::Line(line),
            Problem::PartlyLost {
                entity: "marker",
                name: name.to_string(),
                given,
                needed: 3,
            },
        )),
    }
}

/// A marker that is being read.
pub(super) struct MarkerTrack {
    pub stream: MarkerStream,
    /// Columns of x, y, z.
    pub columns: [usize; 3],
    /// The device computes these points instead of measuring them.
    pub filled: bool,
    /// A sample at (0, 0, 0) is a measured point.
    zero_is_a_point: bool,
    zeros: Vec<u64>,
    placeholders: Placeholders,
}

impl MarkerTrack {
    pub(super) fn new(name: &str, columns: [usize; 3], filled: bool) -> Self {
        let stream = MarkerStream {
            name: name.to_string(),
            body: None,
            unlabeled: false,
            timeline: 0,
            samples: Vec::new(),
        };
        MarkerTrack {
            stream,
            columns,
            filled,
            zero_is_a_point: false,
            zeros: Vec::new(),
            placeholders: Placeholders::default(),
        }
    }

    /// Takes this row's sample; `row` is its number in findings.
    pub(super) fn read(
        &mut self,
        line: u64,
        row: u64,
        values: &[f64],
        units_per_meter: f64,
    ) -> Placed<()> {
        let coordinates = self
            .columns
            .map(|column| values.get(column).copied().unwrap_or(f64::NAN));
        push(
            &mut self.stream.samples,
            match triplet(line, &self.stream.name, coordinates, units_per_meter)? {
                Triplet::Point(point) if is_placeholder_point(&point) => {
                    self.placeholders
                        .take(&self.stream.name, point.coords.into(), row);
                    MarkerSample::Lost
                }
                Triplet::Point(point) if self.filled => MarkerSample::Filled(point),
                Triplet::Point(point) => MarkerSample::Measured(point),
                Triplet::Lost => MarkerSample::Lost,
                Triplet::Zero if self.zero_is_a_point && self.filled => {
                    MarkerSample::Filled(Point3::origin())
                }
                Triplet::Zero if self.zero_is_a_point => MarkerSample::Measured(Point3::origin()),
                Triplet::Zero => {
                    self.zeros.push(row);
                    MarkerSample::Lost
                }
            },
        );
        Ok(())
    }

    pub(super) fn finish(mut self, findings: &mut Vec<Finding>) -> MarkerStream {
        findings.extend(self.placeholders.findings());
        findings.extend(all_zero(Subject::marker(&self.stream.name), self.zeros));
        self.stream
    }
}

/// Takes samples at (0, 0, 0) as the caller wants them taken.
pub(super) fn take_zeros(markers: &mut [MarkerTrack], options: &ReadOptions) {
    let map = options.columns.as_ref();
    let zero_is_a_point = map.is_some_and(|map| map.zero_is_a_point);
    for marker in markers {
        marker.zero_is_a_point = zero_is_a_point;
    }
}

/// The finding about samples at exactly zero; `None` without such.
pub(super) fn all_zero(subject: Subject, rows: Vec<u64>) -> Option<Finding> {
    (!rows.is_empty()).then(|| {
        Finding::of_kind(catalog::ALL_ZERO_TRIPLET, "lost", subject)
            .with("samples", Fact::count(rows.len()))
            .at_rows(rows)
    })
}

/// The finding about a header field that announces another number of frames than the file has.
pub(super) fn frame_count_differs(field: &str, promised: u64, found: usize) -> Finding {
    Finding::new(catalog::FRAME_COUNT_DIFFERS, Subject::column(field))
        .with("promised", Fact::Count(promised))
        .with("found", Fact::count(found))
}

/// An empty stream of a body.
pub(super) fn body_stream(name: &str) -> BodyStream {
    BodyStream {
        name: name.to_string(),
        timeline: 0,
        tracker_from_body: Vec::new(),
        quality: Vec::new(),
        covariance: Vec::new(),
    }
}

pub(super) fn pose(position: Point3<f64>, rotation: UnitQuaternion<f64>) -> Isometry3<f64> {
    Isometry3::from_parts(Translation3::from(position.coords), rotation)
}

/// Makes names unique by `#2`, `#3` … with a finding for each; `about` says what they
/// name.
pub(super) fn unique_names(
    names: Vec<String>,
    about: fn(String) -> About,
    findings: &mut Vec<Finding>,
) -> Vec<String> {
    let mut counts: BTreeMap<String, usize> = BTreeMap::new();
    let taken: std::collections::BTreeSet<String> = names.iter().cloned().collect();
    names
        .into_iter()
        .map(|name| {
            let count = counts.entry(name.clone()).or_insert(0);
            *count += 1;
            if *count == 1 {
                return name;
            }
            let mut unique = format!("{name}#{count}");
            while taken.contains(&unique) {
                unique.push('\'');
            }
            findings.push(
                Finding::new(
                    catalog::DUPLICATE_NAME,
                    Subject::from(about(unique.clone())),
                )
                .with("name", Fact::name(name))
                .with("count", Fact::count(*count))
                .with("unique", Fact::name(&unique)),
            );
            unique
        })
        .collect()
}

/// Frame numbers and times of the rows of a tracker file.
#[derive(Default)]
pub(super) struct Instants {
    pub frames: Vec<u64>,
    pub times: Vec<f64>,
}

impl Instants {
    /// Takes a row's frame number and its time, s, which may not run backwards; returns the frame number.
    pub(super) fn take(&mut self, line: u64, frame: f64, time: f64) -> Placed<u64> {
        if !is_frame_number(frame) || time.is_nan() {
            return unexpected(line, "", "a frame number and a time");
        }
        self.not_backwards(line, time)?;
        push(&mut self.frames, frame as u64);
        push(&mut self.times, time);
        Ok(frame as u64)
    }

    /// That this time is not before the last one.
    pub(super) fn not_backwards(&self, line: u64, time: f64) -> Placed<()> {
        match self.times.last() {
            Some(&previous) if time < previous => Err((
                At::Line(line),
                Problem::TimeBackwards {
                    previous,
                    found: time,
                },
            )),
            _ => Ok(()),
        }
    }
}

/// Whether a number can be that of a frame.
pub(super) fn is_frame_number(frame: f64) -> bool {
    (0.0..1e15).contains(&frame)
}

/// Name of a tracker's clock, by its rate in Hz where the file states one.
pub(super) fn tracker_clock(rate: Option<f64>) -> String {
    rate.map_or("tracker time".to_string(), |rate| {
        format!("tracker frames at {rate} Hz")
    })
}

/// Text of the file's head, as far as it is UTF-8.
pub(super) fn head_text(head: &[u8]) -> &str {
    let head = head.strip_prefix(b"\xef\xbb\xbf").unwrap_or(head);
    match std::str::from_utf8(head) {
        Ok(text) => text,
        Err(error) => std::str::from_utf8(&head[..error.valid_up_to()]).unwrap_or(""),
    }
}

/// First cell of the file's first line.
pub(super) fn first_cell(head: &[u8]) -> &str {
    let line = head_text(head).lines().next().unwrap_or("");
    line.split([',', ';', '\t']).next().unwrap_or("").trim()
}

/// A problem of the form *found, expected* at a line.
pub(super) fn unexpected<T>(line: u64, found: &str, expected: &str) -> Placed<T> {
    let found = crate::error::excerpt(found, 60);
    Err((
        At::Line(line),
        Problem::Unexpected {
            found,
            expected: expected.to_string(),
        },
    ))
}
