//! Qualisys TSV, 3D (markers) and 6D (bodies).
//!
//! `KEY<TAB>value` lines, then an optional row of column names, then data. Per body `X Y Z Roll Pitch Yaw Residual
//! Rot[0] … Rot[8]`: the angles' convention can be changed in QTM and is not in the file, so only the matrix is read;
//! it is written by columns. `TRAJECTORY_TYPES` `Mixed` and `Gap-filled` contain interpolated samples without saying
//! which: such markers are read as filled.

use super::common::{
    MarkerTrack, Triplet, all_zero, body_stream, frame_count_differs, head_text, numbers, pose,
    rotation, triplet, unexpected, unique_names,
};
use super::{Input, ReadOptions, Reader};
use crate::error::{At, Placed, Problem};
use crate::growth::push;
use crate::model::{BodyStream, Recording, Timeline};
use crate::text::{Lines, Number, Separator, cells, number};
use crate::units::LengthUnit;
use calib_finding::{About, Subject};
use nalgebra::Matrix3;
use std::io::BufReader;

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
}

struct Body {
    stream: BodyStream,
    first: usize,
    zeros: Vec<u64>,
}

fn read(input: &mut dyn Input, options: &ReadOptions) -> Placed<Recording> {
    let mut lines = Lines::new(BufReader::with_capacity(1 << 16, input));
    let mut header = Header::default();
    let mut columns: Option<Vec<String>> = None;
    // The first line that is neither a key nor a row of names is data.
    let mut pending = loop {
        let Some(line) = lines.next()? else {
            return Err((At::Line(lines.number()), Problem::NoRows));
        };
        let mut parts = cells(line, TAB);
        let key = parts.next().unwrap_or("");
        if KEYS.contains(&key) {
            let values: Vec<String> = parts.map(str::to_string).collect();
            header.take(key, values);
        } else if matches!(number(key), Number::Value(_)) || (key.is_empty() && columns.is_some()) {
            break Some(line.to_string());
        } else if columns.is_none() && !key.is_empty() {
            columns = Some(cells(line, TAB).map(str::to_string).collect());
        } else if !line.trim().is_empty() {
            let found = key.to_string();
            return unexpected(lines.number(), &found, "a header key or a row of numbers");
        }
    };
    if header.names.is_empty() {
        let expected = if header.six_d {
            "BODY_NAMES in the header"
        } else {
            "MARKER_NAMES in the header"
        };
        return unexpected(lines.number(), "no names", expected);
    }
    let per_entity = if header.six_d { BODY_COLUMNS } else { 3 };
    let width = pending
        .as_deref()
        .map_or(0, |line| cells(line.trim_end_matches('\t'), TAB).count());
    let lead = match &columns {
        Some(columns) => columns
            .iter()
            .take(2)
            .take_while(|name| matches!(name.as_str(), "Frame" | "Time"))
            .count(),
        None => width.saturating_sub(per_entity * header.names.len()).min(2),
    };
    let total = lead + per_entity * header.names.len();
    let mut recording = Recording::default();
    let names = unique_names(
        header.names.clone(),
        if header.six_d {
            About::Body
        } else {
            About::Marker
        },
        &mut recording.meta.findings,
    );
    let (mut markers, mut bodies) = (Vec::new(), Vec::new());
    for (k, name) in names.iter().enumerate() {
        let first = lead + per_entity * k;
        if header.six_d {
            bodies.push(Body {
                stream: body_stream(name),
                first,
                zeros: Vec::new(),
            });
        } else {
            let filled = header
                .types
                .get(k)
                .is_some_and(|kind| kind != "Measured" && !kind.is_empty());
            markers.push(MarkerTrack::new(
                name,
                [first, first + 1, first + 2],
                filled,
            ));
        }
    }
    let time_column = (lead == 2).then_some(1);
    if time_column.is_none() && header.rate.is_none() {
        recording
            .meta
            .conversions
            .push("no time column and no frequency: rows without time".to_string());
    }
    let (mut frames, mut times, mut values): (Vec<u64>, Vec<f64>, Vec<f64>) =
        (Vec::new(), Vec::new(), Vec::new());
    let per_metre = LengthUnit::Mm.per_metre();
    loop {
        let line_number = lines.number() + u64::from(pending.is_none());
        let line = match pending.take() {
            Some(line) => Some(line),
            None => lines.next()?.map(str::to_string),
        };
        let Some(line) = line else { break };
        if line.trim().is_empty() {
            continue;
        }
        numbers(line_number, &line, TAB, total, &mut values)?;
        let frame = if lead > 0 {
            values[0]
        } else {
            frames.len() as f64 + 1.0
        };
        if !(0.0..1e15).contains(&frame) {
            return unexpected(line_number, "", "a frame number");
        }
        let time = match (time_column, header.rate) {
            (Some(column), _) => Some(values[column]),
            (None, Some(rate)) => Some((frame - 1.0) / rate),
            (None, None) => None,
        };
        if let Some(time) = time {
            if time.is_nan() {
                return unexpected(line_number, "", "a time");
            }
            if let Some(&previous) = times.last()
                && time < previous
            {
                return Err((
                    At::Line(line_number),
                    Problem::TimeBackwards {
                        previous,
                        found: time,
                    },
                ));
            }
            push(&mut times, time);
        }
        push(&mut frames, frame as u64);
        for marker in &mut markers {
            marker.read(line_number, frame as u64, &values, per_metre)?;
        }
        for body in &mut bodies {
            read_body(body, line_number, frame as u64, &values, per_metre)?;
        }
    }
    let clock = header.rate.map_or("tracker time".to_string(), |rate| {
        format!("tracker frames at {rate} Hz")
    });
    let t = (times.len() == frames.len()).then_some(times);
    recording.timelines.push(Timeline {
        clock,
        rows: frames,
        t,
        ..Timeline::default()
    });
    finish(recording, header, markers, bodies, options)
}

fn finish(
    mut recording: Recording,
    header: Header,
    markers: Vec<MarkerTrack>,
    bodies: Vec<Body>,
    options: &ReadOptions,
) -> Placed<Recording> {
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

fn read_body(body: &mut Body, line: u64, row: u64, values: &[f64], per_metre: f64) -> Placed<()> {
    let part = &values[body.first..body.first + BODY_COLUMNS];
    let matrix: Vec<f64> = part[7..16].to_vec();
    let given = matrix.iter().filter(|value| !value.is_nan()).count();
    let all_zeros = matrix.iter().all(|&value| value == 0.0);
    let point = match triplet(
        line,
        &body.stream.name,
        [part[0], part[1], part[2]],
        per_metre,
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
            rotation(
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
