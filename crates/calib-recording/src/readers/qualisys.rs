//! Qualisys TSV, 3D (markers) and 6D (bodies).
//!
//! `KEY<TAB>value` lines, then an optional row of column names, then data. Per body `X Y Z Roll Pitch Yaw Residual
//! Rot[0] … Rot[8]`: the angles' convention can be changed in QTM and is not in the file, so only the matrix is read;
//! it is written by columns. `TRAJECTORY_TYPES` `Mixed` and `Gap-filled` contain interpolated samples without saying
//! which: such markers are read as filled.

use super::common::{
    Instants, MarkerTrack, Triplet, all_zero, body_stream, frame_count_differs, head_text,
    is_frame_number, numbers, pose, take_zeros, tracker_clock, triplet, unexpected, unique_names,
};
use super::{Input, ReadOptions, Reader};
use crate::error::{At, Placed, Problem};
use crate::growth::push;
use crate::model::{BodyStream, Recording, Timeline};
use crate::rotation::from_matrix;
use crate::text::{Lines, Number, Separator, cells, number};
use crate::units::LengthUnit;
use calib_finding::{About, Finding, Subject};
use nalgebra::Matrix3;
use std::io::{BufRead, BufReader};

pub(super) const READER: Reader = Reader {
    id: "qualisys_tsv",
    name: "Qualisys TSV",
    extensions: &["tsv"],
    detect,
    read,
};

const TAB: Separator = Separator::Byte(b'\t');
const KEYS: [&str; 16] = [
    "FILE_VERSION",
    "NO_OF_FRAMES",
    "NO_OF_CAMERAS",
    "NO_OF_MARKERS",
    "NO_OF_BODIES",
    "FREQUENCY",
    "NO_OF_ANALOG",
    "ANALOG_FREQUENCY",
    "DESCRIPTION",
    "TIME_STAMP",
    "DATA_INCLUDED",
    "EVENT",
    "MARKER_NAMES",
    "BODY_NAMES",
    "TRAJECTORY_TYPES",
    "NO_OF_SKELETONS",
];
/// Columns of one body.
const BODY_COLUMNS: usize = 16;

fn detect(head: &[u8]) -> bool {
    head_text(head)
        .lines()
        .take(3)
        .any(|line| line.starts_with("NO_OF_FRAMES\t"))
}

#[derive(Default)]
struct Header {
    six_d: bool,
    names: Vec<String>,
    types: Vec<String>,
    rate: Option<f64>,
    frames: Option<u64>,
    comments: Vec<String>,
    /// The row of column names, where the file has one.
    columns: Option<Vec<String>>,
}

struct Body {
    stream: BodyStream,
    first: usize,
    zeros: Vec<u64>,
}

fn read(input: &mut dyn Input, options: &ReadOptions) -> Placed<Recording> {
    let mut lines = Lines::new(BufReader::with_capacity(1 << 16, input));
    let mut header = Header::default();
    let first_row = header.read(&mut lines)?;
    if header.names.is_empty() {
        let expected = if header.six_d {
            "BODY_NAMES in the header"
        } else {
            "MARKER_NAMES in the header"
        };
        return unexpected(lines.number(), "no names", expected);
    }
    let lead = header.lead(&first_row);
    let mut recording = Recording::default();
    let mut tracks = Tracks::plan(&header, lead, &mut recording.meta.findings);
    take_zeros(&mut tracks.markers, options);
    if lead != 2 && header.rate.is_none() {
        recording
            .meta
            .conversions
            .push("no time column and no frequency: rows without time".to_string());
    }
    let mut rows = Rows {
        lead,
        width: lead + header.columns_per_entity() * header.names.len(),
        rate: header.rate,
        instants: Instants::default(),
        values: Vec::new(),
    };
    rows.take(lines.number(), &first_row, &mut tracks)?;
    loop {
        let number = lines.number() + 1;
        let Some(line) = lines.next()? else { break };
        rows.take(number, line, &mut tracks)?;
    }
    let Instants { frames, times } = rows.instants;
    let t = (times.len() == frames.len()).then_some(times);
    recording.timelines.push(Timeline {
        clock: tracker_clock(header.rate),
        rows: frames,
        t,
        ..Timeline::default()
    });
    finish(recording, header, tracks, options)
}

/// Markers and bodies while they are read.
#[derive(Default)]
struct Tracks {
    markers: Vec<MarkerTrack>,
    bodies: Vec<Body>,
}

impl Tracks {
    /// Which columns are whose, behind `lead` columns of frame and time.
    fn plan(header: &Header, lead: usize, findings: &mut Vec<Finding>) -> Self {
        let about = if header.six_d {
            About::Body
        } else {
            About::Marker
        };
        let names = unique_names(header.names.clone(), about, findings);
        let mut tracks = Tracks::default();
        for (k, name) in names.iter().enumerate() {
            let first = lead + header.columns_per_entity() * k;
            if header.six_d {
                tracks.bodies.push(Body {
                    stream: body_stream(name),
                    first,
                    zeros: Vec::new(),
                });
            } else {
                let filled = header
                    .types
                    .get(k)
                    .is_some_and(|kind| kind != "Measured" && !kind.is_empty());
                let columns = [first, first + 1, first + 2];
                tracks.markers.push(MarkerTrack::new(name, columns, filled));
            }
        }
        tracks
    }
}

/// The rows of numbers.
struct Rows {
    /// Columns of frame and time: none, the frame, or both.
    lead: usize,
    width: usize,
    /// Hz, as the header states it.
    rate: Option<f64>,
    instants: Instants,
    values: Vec<f64>,
}

impl Rows {
    /// Reads one row into markers and bodies.
    fn take(&mut self, number: u64, line: &str, tracks: &mut Tracks) -> Placed<()> {
        if line.trim().is_empty() {
            return Ok(());
        }
        numbers(number, line, TAB, self.width, &mut self.values)?;
        let values = &self.values;
        let frame = if self.lead > 0 {
            values[0]
        } else {
            self.instants.frames.len() as f64 + 1.0
        };
        if !is_frame_number(frame) {
            return unexpected(number, "", "a frame number");
        }
        let time = match (self.lead, self.rate) {
            (2, _) => Some(values[1]),
            (_, Some(rate)) => Some((frame - 1.0) / rate),
            (_, None) => None,
        };
        if let Some(time) = time {
            if time.is_nan() {
                return unexpected(number, "", "a time");
            }
            self.instants.not_backwards(number, time)?;
            push(&mut self.instants.times, time);
        }
        push(&mut self.instants.frames, frame as u64);
        let per_meter = LengthUnit::Mm.per_meter();
        for marker in &mut tracks.markers {
            marker.read(number, frame as u64, values, per_meter)?;
        }
        for body in &mut tracks.bodies {
            read_body(body, number, frame as u64, values, per_meter)?;
        }
        Ok(())
    }
}

fn finish(
    mut recording: Recording,
    header: Header,
    tracks: Tracks,
    options: &ReadOptions,
) -> Placed<Recording> {
    let Tracks { markers, bodies } = tracks;
    let meta = &mut recording.meta;
    meta.comments = header.comments;
    meta.up_axis = options.up_axis.clone();
    meta.conversions.push("lengths from mm".to_string());
    if header.six_d {
        meta.conversions.push(
            "rotations from the matrix, written by columns; roll, pitch and yaw ignored"
                .to_string(),
        );
    }
    let filled: Vec<&str> = markers
        .iter()
        .filter(|marker| marker.filled)
        .map(|marker| marker.stream.name.as_str())
        .collect();
    if !filled.is_empty() {
        meta.conversions.push(format!(
            "trajectories with interpolated samples, read as filled: {}",
            filled.join(", ")
        ));
    }
    if let Some(promised) = header
        .frames
        .filter(|&frames| frames != recording.timelines[0].rows.len() as u64)
    {
        let found = recording.timelines[0].rows.len();
        meta.findings
            .push(frame_count_differs("NO_OF_FRAMES", promised, found));
    }
    recording.markers = markers
        .into_iter()
        .map(|marker| marker.finish(&mut meta.findings))
        .collect();
    for body in bodies {
        meta.findings
            .extend(all_zero(Subject::body(&body.stream.name), body.zeros));
        recording.bodies.push(body.stream);
    }
    Ok(recording)
}

impl Header {
    /// Reads the header; returns the first line that is neither a key nor a row of names, which is data.
    fn read<R: BufRead>(&mut self, lines: &mut Lines<R>) -> Placed<String> {
        loop {
            let Some(line) = lines.next()? else {
                return Err((At::Line(lines.number()), Problem::NoRows));
            };
            let mut parts = cells(line, TAB);
            let key = parts.next().unwrap_or("");
            let named = self.columns.is_some();
            if KEYS.contains(&key) {
                let values: Vec<String> = parts.map(str::to_string).collect();
                self.take(key, values);
            } else if matches!(number(key), Number::Value(_)) || (key.is_empty() && named) {
                return Ok(line.to_string());
            } else if !named && !key.is_empty() {
                self.columns = Some(cells(line, TAB).map(str::to_string).collect());
            } else if !line.trim().is_empty() {
                let found = key.to_string();
                return unexpected(lines.number(), &found, "a header key or a row of numbers");
            }
        }
    }

    fn columns_per_entity(&self) -> usize {
        if self.six_d { BODY_COLUMNS } else { 3 }
    }

    /// How many columns of frame and time stand before the first marker or body.
    fn lead(&self, first_row: &str) -> usize {
        match &self.columns {
            Some(columns) => columns
                .iter()
                .take(2)
                .take_while(|name| matches!(name.as_str(), "Frame" | "Time"))
                .count(),
            None => {
                let width = cells(first_row.trim_end_matches('\t'), TAB).count();
                width
                    .saturating_sub(self.columns_per_entity() * self.names.len())
                    .min(2)
            }
        }
    }

    fn take(&mut self, key: &str, mut values: Vec<String>) {
        while values.last().is_some_and(String::is_empty) {
            values.pop();
        }
        match key {
            "MARKER_NAMES" | "BODY_NAMES" => {
                self.six_d = key == "BODY_NAMES";
                self.names = values;
                return;
            }
            "TRAJECTORY_TYPES" => self.types = values.clone(),
            "FREQUENCY" => {
                let rate = values.first().and_then(|text| text.parse::<f64>().ok());
                self.rate = rate.filter(|rate| rate.is_finite() && *rate > 0.0);
            }
            "NO_OF_FRAMES" => self.frames = values.first().and_then(|text| text.parse().ok()),
            _ => {}
        }
        self.comments.push(format!("{key}: {}", values.join(" ")));
    }
}

fn read_body(body: &mut Body, line: u64, row: u64, values: &[f64], per_meter: f64) -> Placed<()> {
    let part = &values[body.first..body.first + BODY_COLUMNS];
    let matrix: Vec<f64> = part[7..16].to_vec();
    let given = matrix.iter().filter(|value| !value.is_nan()).count();
    let all_zeros = matrix.iter().all(|&value| value == 0.0);
    let point = match triplet(
        line,
        &body.stream.name,
        [part[0], part[1], part[2]],
        per_meter,
    )? {
        Triplet::Point(point) if given == 9 => Some(point),
        Triplet::Zero if given == 9 && !all_zeros => Some(nalgebra::Point3::origin()),
        Triplet::Zero => {
            body.zeros.push(row);
            None
        }
        Triplet::Lost if given == 0 => None,
        found => {
            let given = given + if matches!(found, Triplet::Lost) { 0 } else { 3 };
            let name = body.stream.name.clone();
            return Err((
                At::Line(line),
                Problem::PartlyLost {
                    entity: "body",
                    name,
                    given,
                    needed: 12,
                },
            ));
        }
    };
    push(
        &mut body.stream.quality,
        (!part[6].is_nan()).then_some(part[6]),
    );
    let track = match point {
        // Written by columns, as nalgebra stores it.
        Some(point) => Some(pose(
            point,
            from_matrix(
                At::Line(line),
                &body.stream.name,
                &Matrix3::from_column_slice(&matrix),
            )?,
        )),
        None => None,
    };
    push(&mut body.stream.tracker_from_body, track);
    Ok(())
}
