//! OptiTrack Motive CSV, versions 1.1 to 1.25.
//!
//! ```text
//! Format Version,1.23,Take Name,…,Rotation Type,Quaternion,Length Units,Millimeters,…      key,value pairs
//!
//! ,Type,Rigid Body,…,Marker,…            from 1.22 on the row's name stands in column 2
//! ,Name,Hand,…,Hand:Marker1,…
//! ,ID,…
//! ,,Rotation,…,Position,…,Mean Marker Error,…
//! Frame,Time (Seconds),X,Y,Z,W,X,Y,Z,,…
//! ```
//!
//! `Rigid Body Marker` columns are computed from the body's pose: they are read as filled. `Marker` columns are
//! measured. Times are seconds from the start; the start itself is local wall-clock text and is kept as a comment.
//! The file does not say which axis is up (Y unless changed at export).

use super::common::{
    MarkerTrack, Triplet, body_stream, first_cell, numbers, pose, quaternion, triplet, unexpected,
    unique_names,
};
use super::{Input, ReadOptions, Reader};
use crate::error::{At, Placed, Problem};
use crate::growth::push;
use crate::model::{BodyStream, Recording, Timeline};
use crate::text::{Lines, Separator, cells};
use crate::units::LengthUnit;
use calib_finding::About;
use std::io::BufReader;

pub(super) const READER: Reader = Reader {
    id: "motive_csv",
    name: "OptiTrack Motive CSV",
    extensions: &["csv"],
    detect,
    read,
};

const COMMA: Separator = Separator::Byte(b',');

/// Rows between the first line and the `Frame` row, at most: there are six.
const MAX_HEADER_ROWS: usize = 16;

fn detect(head: &[u8]) -> bool {
    first_cell(head) == "Format Version"
}

struct Body {
    stream: BodyStream,
    rotation: [usize; 4],
    position: [usize; 3],
    error: Option<usize>,
}

fn read(input: &mut dyn Input, options: &ReadOptions) -> Placed<Recording> {
    let mut lines = Lines::new(BufReader::with_capacity(1 << 16, input));
    let mut recording = Recording::default();
    let first: Vec<String> = match lines.next()? {
        Some(line) => cells(line, COMMA).map(str::to_string).collect(),
        None => return Err((At::File, Problem::Empty)),
    };
    let value = |key: &str| {
        first
            .chunks(2)
            .find(|pair| pair[0] == key)
            .and_then(|pair| pair.get(1))
            .map(String::as_str)
    };
    recording.meta.comments = first
        .chunks(2)
        .filter(|pair| !pair[0].is_empty())
        .map(|pair| pair.join(": "))
        .collect();
    let unit_text = value("Length Units").unwrap_or("");
    let Some(unit) = LengthUnit::from_text(unit_text) else {
        return unexpected(
            1,
            unit_text,
            "`Length Units` Meters, Centimeters or Millimeters in the first line",
        );
    };
    let rotation_type = value("Rotation Type").unwrap_or("Quaternion").to_string();
    let mut rows: Vec<Vec<String>> = Vec::new();
    let axes = loop {
        let Some(line) = lines.next()? else {
            return Err((At::Line(lines.number()), Problem::NoRows));
        };
        let row: Vec<String> = cells(line, COMMA).map(str::to_string).collect();
        if row[0] == "Frame" {
            break row;
        }
        if !row[0].is_empty() || rows.len() > MAX_HEADER_ROWS {
            let expected =
                "the rows Type, Name, ID and `Frame,Time,…`; export with the header switched on";
            return unexpected(lines.number(), &row[0], expected);
        }
        if row.iter().any(|cell| !cell.is_empty()) {
            rows.push(row);
        }
    };
    let header_line = lines.number();
    let [kinds, names, .., quantities] = rows.as_slice() else {
        return unexpected(
            header_line,
            "a short header",
            "the rows Type, Name, ID and quantity above `Frame`",
        );
    };
    let plan = plan(
        header_line,
        kinds,
        names,
        quantities,
        &axes,
        &rotation_type,
        &mut recording,
    )?;
    let (mut markers, mut bodies) = plan;
    if markers.is_empty() && bodies.is_empty() {
        return unexpected(
            header_line,
            "a header without rigid bodies and markers",
            "columns of type Rigid Body or Marker",
        );
    }

    let (mut frames, mut times) = (Vec::new(), Vec::new());
    let (mut values, per_metre) = (Vec::new(), unit.per_metre());
    loop {
        let number = lines.number() + 1;
        let Some(line) = lines.next()? else { break };
        if line.bytes().all(|b| b == b',' || b == b' ') {
            continue;
        }
        numbers(number, line, COMMA, axes.len(), &mut values)?;
        let (frame, time) = (values[0], values[1]);
        if !(0.0..1e15).contains(&frame) || time.is_nan() {
            return unexpected(number, "", "a frame number and a time");
        }
        if let Some(&previous) = times.last()
            && time < previous
        {
            return Err((
                At::Line(number),
                Problem::TimeBackwards {
                    previous,
                    found: time,
                },
            ));
        }
        push(&mut frames, frame as u64);
        push(&mut times, time);
        for marker in &mut markers {
            marker.read(number, frame as u64, &values, per_metre)?;
        }
        for body in &mut bodies {
            read_body(body, number, &values, per_metre)?;
        }
    }
    if frames.is_empty() {
        return Err((At::Line(lines.number()), Problem::NoRows));
    }
    let rate = value("Export Frame Rate")
        .or(value("Capture Frame Rate"))
        .and_then(|text| text.parse::<f64>().ok());
    let clock = rate.map_or("tracker time".to_string(), |rate| {
        format!("tracker frames at {rate} Hz")
    });
    recording.timelines.push(Timeline {
        clock,
        rows: frames,
        t: Some(times),
        ..Timeline::default()
    });
    recording
        .meta
        .conversions
        .push(format!("lengths from {}", unit.name()));
    recording.meta.up_axis = options.up_axis.clone();
    let findings = &mut recording.meta.findings;
    recording.markers = markers
        .into_iter()
        .map(|marker| marker.finish(findings))
        .collect();
    recording.bodies = bodies.into_iter().map(|body| body.stream).collect();
    Ok(recording)
}

/// Which columns are whose.
fn plan(
    line: u64,
    kinds: &[String],
    names: &[String],
    quantities: &[String],
    axes: &[String],
    rotation_type: &str,
    recording: &mut Recording,
) -> Placed<(Vec<MarkerTrack>, Vec<Body>)> {
    let cell = |row: &[String], i: usize| row.get(i).cloned().unwrap_or_default();
    // Type and name of each run of columns.
    let mut groups: Vec<(String, String, std::ops::Range<usize>)> = Vec::new();
    for i in 2..axes.len() {
        let (kind, name) = (cell(kinds, i), cell(names, i));
        match groups.last_mut() {
            Some((last_kind, last_name, columns)) if *last_kind == kind && *last_name == name => {
                columns.end = i + 1
            }
            _ => groups.push((kind, name, i..i + 1)),
        }
    }
    let (mut markers, mut bodies, mut skipped) = (Vec::new(), Vec::new(), Vec::new());
    for (kind, name, columns) in groups {
        let find = |quantity: &str, axis: &str| {
            columns
                .clone()
                .find(|&i| cell(quantities, i) == quantity && cell(axes, i) == axis)
        };
        let position: Option<Vec<usize>> = ["X", "Y", "Z"]
            .iter()
            .map(|axis| find("Position", axis))
            .collect();
        let position = position.map(|p| [p[0], p[1], p[2]]);
        match (kind.as_str(), position) {
            ("Rigid Body", Some(position)) => {
                let rotation: Option<Vec<usize>> = ["X", "Y", "Z", "W"]
                    .iter()
                    .map(|axis| find("Rotation", axis))
                    .collect();
                let Some(rotation) = rotation.filter(|_| rotation_type == "Quaternion") else {
                    let what = format!("rotation type `{rotation_type}` of rigid body `{name}`");
                    let remedy = "export with Rotation Type Quaternion".to_string();
                    return Err((At::Line(line), Problem::Unsupported { what, remedy }));
                };
                let error = columns
                    .clone()
                    .find(|&i| cell(quantities, i).contains("Error"));
                let rotation = [rotation[0], rotation[1], rotation[2], rotation[3]];
                bodies.push(Body {
                    stream: body_stream(&name),
                    rotation,
                    position,
                    error,
                });
            }
            ("Marker" | "Rigid Body Marker", Some(position)) => {
                let mut marker = MarkerTrack::new(&name, position, kind != "Marker");
                marker.stream.unlabelled = name.starts_with("Unlabeled");
                if kind == "Rigid Body Marker" {
                    let body = name
                        .rsplit_once(['_', ':'])
                        .map(|(body, _)| body.to_string());
                    marker.stream.body = body;
                } else if let Some((body, _)) = name
                    .split_once(':')
                    .filter(|(body, _)| *body != "Unlabeled")
                {
                    marker.stream.body = Some(body.to_string());
                }
                markers.push(marker);
            }
            ("Rigid Body" | "Marker" | "Rigid Body Marker", None) => {
                return unexpected(line, &name, "columns Position X, Y, Z below every name");
            }
            _ => skipped.push(format!("{kind} {name}")),
        }
    }
    if !skipped.is_empty() {
        recording
            .meta
            .conversions
            .push(format!("skipped columns: {}", skipped.join(", ")));
    }
    if markers.iter().any(|marker| marker.filled) {
        recording
            .meta
            .conversions
            .push("rigid body markers are computed by Motive: read as filled".to_string());
    }
    let findings = &mut recording.meta.findings;
    let unique = unique_names(
        markers
            .iter()
            .map(|marker| marker.stream.name.clone())
            .collect(),
        About::Marker,
        findings,
    );
    markers
        .iter_mut()
        .zip(unique)
        .for_each(|(marker, name)| marker.stream.name = name);
    let unique = unique_names(
        bodies
            .iter()
            .map(|body: &Body| body.stream.name.clone())
            .collect(),
        About::Body,
        findings,
    );
    bodies
        .iter_mut()
        .zip(unique)
        .for_each(|(body, name)| body.stream.name = name);
    Ok((markers, bodies))
}

fn read_body(body: &mut Body, line: u64, values: &[f64], per_metre: f64) -> Placed<()> {
    let q = body.rotation.map(|i| values[i]);
    let given = q.iter().filter(|value| !value.is_nan()).count();
    let point = match triplet(
        line,
        &body.stream.name,
        body.position.map(|i| values[i]),
        per_metre,
    )? {
        Triplet::Point(point) if given == 4 => Some(point),
        Triplet::Zero if given == 4 && q != [0.0; 4] => Some(nalgebra::Point3::origin()),
        Triplet::Zero | Triplet::Lost if given == 0 || q == [0.0; 4] => None,
        _ => {
            let name = body.stream.name.clone();
            return Err((
                At::Line(line),
                Problem::PartlyLost {
                    entity: "body",
                    name,
                    given: 3 * usize::from(given != 4) + given.min(4),
                    needed: 7,
                },
            ));
        }
    };
    let track = match point {
        Some(point) => Some(pose(
            point,
            quaternion(At::Line(line), &body.stream.name, q)?,
        )),
        None => None,
    };
    push(&mut body.stream.tracker_from_body, track);
    if let Some(column) = body.error {
        let error = values[column];
        push(&mut body.stream.quality, (!error.is_nan()).then_some(error));
    }
    Ok(())
}
