//! ART DTrack logs: the ASCII datagrams one after the other, separated by NUL (as `nc -lu 5000 > file` writes them).
//!
//! ```text
//! fr 1000                                                    a frame begins
//! ts 86399.000000                                            seconds since 00:00 UTC (wraps), or
//! ts2 1700000000 123456 950                                  Unix seconds, µs, latency µs
//! 6d 1 [0 1.000][x y z η θ φ][b0 … b8]                       mm; R = [b0 b3 b6; b1 b4 b7; b2 b5 b8]
//! 6df2 1 1 [0 -1.000 8 3][…][…][…]                           quality −1: lost
//! 3d 1 [7 1.000][x y z]                                      a marker of no body
//! ```
//!
//! A marker of no body has a number that another may have later. The only one of a frame is the marker `marker`, unless several are in view
//! more often than by a reflection now and then: then all have their numbers.
//!
//! In `6d` lines a lost body is absent; so is everything in a frame without the line. Angles are ignored, the matrix
//! has six decimals and is made orthonormal. Unknown lines are skipped, as the protocol asks.

mod fields;

use fields::Fields;

use super::common::{body_stream, head_text, pose, unexpected};
use super::{Input, ReadOptions, Reader};
use crate::error::{At, Placed, Problem};
use crate::growth::push;
use crate::model::{BodyStream, MarkerSample, MarkerStream, Recording, Timeline};
use crate::rotation::from_matrix;
use crate::text::Lines;
use crate::units::LengthUnit;
use calib_finding::{Fact, Finding, Subject, catalog};
use nalgebra::{Isometry3, Matrix3, Point3};
use std::collections::BTreeMap;
use std::io::BufReader;

pub(super) const READER: Reader = Reader {
    id: "dtrack",
    name: "ART DTrack datagram log",
    extensions: &["dtrack", "log", "txt"],
    detect,
    read,
};

/// Name of the only marker of no body in a frame.
const ALONE: &str = "marker";

/// Frames with several markers of no body, of those with any, up to which one marker and a reflection are meant.
const REFLECTIONS: f64 = 0.1;

/// Half a day: `ts` counts from midnight, so going back by more than this is the next day.
const HALF_DAY: f64 = 43_200.0;
const DAY: f64 = 86_400.0;

/// A log may be this many times larger as a table of bodies × frames than its samples; more is no log.
const MAX_SPARSITY: usize = 1000;
const ALWAYS_ALLOWED: usize = 1 << 20;

fn detect(head: &[u8]) -> bool {
    let text = head_text(head).trim_start_matches(['\0', '\r', '\n']);
    text.strip_prefix("fr ")
        .is_some_and(|rest| rest.bytes().next().is_some_and(|b| b.is_ascii_digit()))
}

#[derive(Default)]
struct Log {
    frames: Vec<u64>,
    times: Vec<Option<f64>>,
    days: f64,
    bodies: BTreeMap<String, BodyStream>,
    markers: BTreeMap<u64, MarkerStream>,
    /// The only single marker of a frame, where there is one.
    alone: Vec<MarkerSample>,
    /// Frames with several.
    several: usize,
    samples: usize,
    dense: usize,
    backwards: Vec<u64>,
    skipped: BTreeMap<String, usize>,
}

fn read(input: &mut dyn Input, _options: &ReadOptions) -> Placed<Recording> {
    let mut lines = Lines::new(BufReader::with_capacity(1 << 16, input));
    let mut log = Log::default();
    loop {
        let number = lines.number() + 1;
        let Some(line) = lines.next()? else { break };
        for line in line
            .split('\0')
            .map(str::trim)
            .filter(|line| !line.is_empty())
        {
            log.line(number, line)?;
        }
    }
    if log.frames.is_empty() {
        return Err((At::Line(lines.number()), Problem::NoRows));
    }
    log.finish(lines.number())
}

impl Log {
    fn line(&mut self, line: u64, text: &str) -> Placed<()> {
        let mut fields = Fields { line, rest: text };
        let key = fields.word().unwrap_or("");
        if key == "fr" {
            let frame = fields.count("a frame number")?;
            if self.frames.last().is_some_and(|&last| frame <= last) {
                self.backwards.push(frame);
            }
            push(&mut self.frames, frame);
            push(&mut self.times, None);
            return Ok(());
        }
        if self.frames.is_empty() {
            return unexpected(line, key, "`fr` and a frame number first");
        }
        match key {
            "ts" => {
                let mut time = fields.value("seconds since midnight")? + self.days;
                if let Some(previous) = self.last_time()
                    && time < previous - HALF_DAY
                {
                    self.days += DAY;
                    time += DAY;
                }
                self.set_time(line, time)
            }
            "ts2" => {
                let seconds = fields.value("Unix seconds")?;
                let micro = fields.value("microseconds")?;
                self.set_time(line, seconds + micro * 1e-6)
            }
            "6d" => {
                let count = fields.count("the number of bodies")?;
                self.bodies(&mut fields, count, "body", 6)
            }
            "6df" | "6dmt" => {
                let count = fields.count("the number of bodies")?;
                self.bodies(
                    &mut fields,
                    count,
                    if key == "6df" { "flystick" } else { "tool" },
                    6,
                )
            }
            "6df2" | "6dmt2" | "6dmtr" => {
                fields.count("the number of calibrated bodies")?;
                let count = fields.count("the number of bodies")?;
                let kind = match key {
                    "6df2" => "flystick",
                    "6dmt2" => "tool",
                    _ => "tool_ref",
                };
                self.bodies(&mut fields, count, kind, 3)
            }
            "3d" => {
                let count = fields.count("the number of markers")?;
                let sample = self.frames.len().saturating_sub(1);
                self.several += usize::from(count > 1);
                for _ in 0..count {
                    let id = fields.block("id qu")?;
                    let xyz = fields.block("x y z")?;
                    let point = self.marker(line, &id, &xyz)?;
                    if count == 1 {
                        self.alone.resize(sample, MarkerSample::Lost);
                        push(&mut self.alone, point);
                    }
                }
                Ok(())
            }
            "6dcal" => Ok(()),
            other => {
                *self
                    .skipped
                    .entry(other.chars().take(16).collect())
                    .or_insert(0) += 1;
                Ok(())
            }
        }
    }

    fn last_time(&self) -> Option<f64> {
        self.times.iter().rev().flatten().next().copied()
    }

    fn set_time(&mut self, line: u64, time: f64) -> Placed<()> {
        if let Some(previous) = self.last_time()
            && time < previous
        {
            return Err((
                At::Line(line),
                Problem::TimeBackwards {
                    previous,
                    found: time,
                },
            ));
        }
        if let Some(slot) = self.times.last_mut() {
            *slot = Some(time);
        }
        Ok(())
    }

    /// `count` times `[id qu …][x y z …][b0 … b8]`, with trailing blocks of some kinds.
    fn bodies(
        &mut self,
        fields: &mut Fields,
        count: u64,
        kind: &str,
        position: usize,
    ) -> Placed<()> {
        for _ in 0..count {
            let head = fields.block("id qu")?;
            let place = fields.block("x y z")?;
            let matrix = fields.block("b0 … b8")?;
            if kind == "flystick" || kind == "tool" {
                // Buttons, then for tools the covariance of the position.
                let blocks = if kind == "tool" && position == 3 {
                    2
                } else {
                    1
                };
                for _ in 0..blocks {
                    if fields.rest.trim_start().starts_with('[') {
                        fields.block("buttons")?;
                    }
                }
            }
            let (Some(&id), Some(&quality), true, 9) = (
                head.first(),
                head.get(1),
                place.len() == position,
                matrix.len(),
            ) else {
                let found = format!(
                    "{} + {} + {} numbers",
                    head.len(),
                    place.len(),
                    matrix.len()
                );
                return unexpected(
                    fields.line,
                    &found,
                    &format!("[id qu …][{position} numbers][9 numbers]"),
                );
            };
            if !(0.0..1e6).contains(&id) {
                return unexpected(fields.line, &id.to_string(), "a body's number");
            }
            let name = format!("{kind}_{}", id as u64);
            let track = if quality < 0.0 {
                None
            } else {
                let per_meter = LengthUnit::Mm.per_meter();
                let point = Point3::new(
                    place[0] / per_meter,
                    place[1] / per_meter,
                    place[2] / per_meter,
                );
                // R = [b0 b3 b6; b1 b4 b7; b2 b5 b8]: by columns, as nalgebra stores it.
                let matrix = Matrix3::from_column_slice(&matrix);
                Some(pose(
                    point,
                    from_matrix(At::Line(fields.line), &name, &matrix)?,
                ))
            };
            self.body(fields.line, &name, track, quality)?;
        }
        Ok(())
    }

    fn body(
        &mut self,
        line: u64,
        name: &str,
        track: Option<Isometry3<f64>>,
        quality: f64,
    ) -> Placed<()> {
        let sample = self.frames.len() - 1;
        let stream = self
            .bodies
            .entry(name.to_string())
            .or_insert_with(|| body_stream(name));
        let length = stream.tracker_from_body.len();
        if length > sample {
            let frame = self.frames[sample] as i64;
            return Err((
                At::Line(line),
                Problem::RepeatedSample {
                    entity: "body",
                    name: name.to_string(),
                    frame,
                },
            ));
        }
        self.samples += 1;
        self.dense += sample + 1 - length;
        sparse(
            line,
            self.dense,
            self.samples,
            self.bodies.len() + self.markers.len(),
            self.frames.len(),
        )?;
        let Some(stream) = self.bodies.get_mut(name) else {
            return Ok(());
        };
        stream.tracker_from_body.resize(sample, None);
        push(&mut stream.tracker_from_body, track);
        stream.quality.resize(sample, None);
        push(&mut stream.quality, Some(quality));
        Ok(())
    }

    fn marker(&mut self, line: u64, id: &[f64], xyz: &[f64]) -> Placed<MarkerSample> {
        let ([id, ..], [x, y, z]) = (id, xyz) else {
            return unexpected(
                line,
                &format!("{} + {} numbers", id.len(), xyz.len()),
                "[id qu][x y z]",
            );
        };
        if !(0.0..1e9).contains(id) {
            return unexpected(line, &id.to_string(), "a marker's number");
        }
        let (id, sample) = (*id as u64, self.frames.len() - 1);
        let stream = self.markers.entry(id).or_insert_with(|| MarkerStream {
            name: format!("marker_{id}"),
            body: None,
            unlabeled: true,
            timeline: 0,
            samples: Vec::new(),
        });
        let length = stream.samples.len();
        if length > sample {
            let (name, frame) = (stream.name.clone(), self.frames[sample] as i64);
            return Err((
                At::Line(line),
                Problem::RepeatedSample {
                    entity: "marker",
                    name,
                    frame,
                },
            ));
        }
        stream.samples.resize(sample, MarkerSample::Lost);
        let per_meter = LengthUnit::Mm.per_meter();
        let point = Point3::new(x / per_meter, y / per_meter, z / per_meter);
        let point = MarkerSample::Measured(point);
        push(&mut stream.samples, point);
        self.samples += 1;
        self.dense += sample + 1 - length;
        sparse(
            line,
            self.dense,
            self.samples,
            self.bodies.len() + self.markers.len(),
            self.frames.len(),
        )?;
        Ok(point)
    }

    fn finish(mut self, line: u64) -> Placed<Recording> {
        let n = self.frames.len();
        let missing: usize = self
            .bodies
            .values()
            .map(|body| n - body.tracker_from_body.len())
            .sum::<usize>()
            + self
                .markers
                .values()
                .map(|marker| n - marker.samples.len())
                .sum::<usize>();
        sparse(
            line,
            self.dense + missing,
            self.samples,
            self.bodies.len() + self.markers.len(),
            n,
        )?;
        for body in self.bodies.values_mut() {
            body.tracker_from_body.resize(n, None);
            body.quality.resize(n, None);
        }
        for marker in self.markers.values_mut() {
            marker.samples.resize(n, MarkerSample::Lost);
        }
        let mut recording = Recording::default();
        let meta = &mut recording.meta;
        meta.conversions
            .push("lengths from mm; rotations from the matrices, angles ignored".to_string());
        if self.days > 0.0 {
            let days = (self.days / DAY) as usize;
            let times = if days == 1 { "once" } else { "several times" };
            meta.conversions
                .push(format!("time continues past midnight ({times})"));
        }
        if !self.skipped.is_empty() {
            let kinds: Vec<String> = self
                .skipped
                .iter()
                .map(|(kind, count)| format!("{kind} ({count})"))
                .collect();
            meta.conversions
                .push(format!("lines not read: {}", kinds.join(", ")));
        }
        if !self.backwards.is_empty() {
            meta.findings.push(
                Finding::of_kind(catalog::ROWS_OUT_OF_ORDER, "frames", Subject::column("fr"))
                    .with("count", Fact::count(self.backwards.len()))
                    .at_rows(self.backwards),
            );
        }
        let without = self.times.iter().filter(|time| time.is_none()).count();
        let t: Option<Vec<f64>> = self.times.into_iter().collect();
        if t.is_none() && without < n {
            meta.findings.push(
                Finding::new(catalog::NO_TIME, Subject::column("ts"))
                    .with("without", Fact::count(without))
                    .with("frames", Fact::count(n)),
            );
        }
        let clock = if t.is_some() {
            "DTrack controller"
        } else {
            "DTrack frames"
        };
        recording.timelines.push(Timeline {
            clock: clock.to_string(),
            rows: self.frames,
            t,
            ..Timeline::default()
        });
        recording.bodies = self.bodies.into_values().collect();
        let is_seen = |sample: &MarkerSample| matches!(sample, MarkerSample::Measured(_));
        let single = self.alone.iter().filter(|sample| is_seen(sample)).count();
        let is_one = self.several as f64 <= REFLECTIONS * (single + self.several) as f64;
        if single > 0 && is_one {
            self.alone.resize(n, MarkerSample::Lost);
            // No point twice.
            for marker in self.markers.values_mut() {
                let samples = marker.samples.iter_mut().zip(&self.alone);
                samples
                    .filter(|(_, alone)| is_seen(alone))
                    .for_each(|(sample, _)| *sample = MarkerSample::Lost);
            }
            self.markers
                .retain(|_, marker| marker.samples.iter().any(is_seen));
        }
        recording.markers = self.markers.into_values().collect();
        if single > 0 && is_one {
            recording.markers.push(MarkerStream {
                name: ALONE.to_string(),
                body: None,
                unlabeled: false,
                timeline: 0,
                samples: self.alone,
            });
        }
        Ok(recording)
    }
}

fn sparse(line: u64, dense: usize, samples: usize, entities: usize, frames: usize) -> Placed<()> {
    if dense > ALWAYS_ALLOWED + MAX_SPARSITY * samples {
        return Err((
            At::Line(line),
            Problem::TooSparse {
                entities,
                frames,
                samples,
            },
        ));
    }
    Ok(())
}
