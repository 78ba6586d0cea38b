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
//! `Rigid Body Marker` columns are computed from the body's pose: they are read as filled, and left out where the file
//! also has the `Marker` columns of that body, which are measured and often have the same names. Times are seconds from the start; the start itself is local wall-clock text and is kept as a comment.
//! The file does not say which axis is up (Y unless changed at export).

use super::common::{
    Instants, MarkerTrack, Triplet, body_stream, first_cell, numbers, pose, take_zeros,
    tracker_clock, triplet, unexpected, unique_names,
};
use super::{Input, ReadOptions, Reader};
use crate::error::{At, Placed, Problem};
use crate::growth::push;
use crate::model::{BodyStream, Recording, Timeline};
use crate::rotation::quaternion;
use crate::text::{Lines, Separator, cells};
use crate::units::LengthUnit;
use calib_finding::{About, Finding};
use std::collections::BTreeSet;
use std::io::{BufRead, BufReader};
use std::mem::take;
use std::ops::Range;

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
    let header = Header::read(&mut lines)?;
    let rotation_type = value("Rotation Type").unwrap_or("Quaternion");
    let mut tracks = plan(&header, rotation_type, &mut recording)?;
    take_zeros(&mut tracks.markers, options);
    if tracks.markers.is_empty() && tracks.bodies.is_empty() {
        return unexpected(
            header.line,
            "a header without rigid bodies and markers",
            "columns of type Rigid Body or Marker",
        );
    }
    let width = header.axes.len();
    let instants = read_rows(&mut lines, width, &mut tracks, unit.per_meter())?;
    let rate = value("Export Frame Rate")
        .or(value("Capture Frame Rate"))
        .and_then(|text| text.parse::<f64>().ok());
    recording.timelines.push(Timeline {
        clock: tracker_clock(rate),
        rows: instants.frames,
        t: Some(instants.times),
        ..Timeline::default()
    });
    recording
        .meta
        .conversions
        .push(format!("lengths from {}", unit.name()));
    recording.meta.up_axis = options.up_axis.clone();
    let findings = &mut recording.meta.findings;
    recording.markers = tracks
        .markers
        .into_iter()
        .map(|marker| marker.finish(findings))
        .collect();
    recording.bodies = tracks.bodies.into_iter().map(|body| body.stream).collect();
    Ok(recording)
}

/// The rows that say which columns are whose.
struct Header {
    /// Line of the `Frame` row.
    line: u64,
    kinds: Vec<String>,
    names: Vec<String>,
    quantities: Vec<String>,
    /// The `Frame` row.
    axes: Vec<String>,
}

impl Header {
    fn read<R: BufRead>(lines: &mut Lines<R>) -> Placed<Self> {
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
                let expected = "the rows Type, Name, ID and `Frame,Time,…`; export with the header switched on";
                return unexpected(lines.number(), &row[0], expected);
            }
            if row.iter().any(|cell| !cell.is_empty()) {
                rows.push(row);
            }
        };
        let line = lines.number();
        let [kinds, names, .., quantities] = rows.as_mut_slice() else {
            return unexpected(
                line,
                "a short header",
                "the rows Type, Name, ID and quantity above `Frame`",
            );
        };
        Ok(Header {
            line,
            kinds: take(kinds),
            names: take(names),
            quantities: take(quantities),
            axes,
        })
    }

    /// Runs of columns of one type and name.
    fn groups(&self) -> Vec<Group> {
        let cell = |row: &[String], i: usize| row.get(i).cloned().unwrap_or_default();
        let mut groups: Vec<Group> = Vec::new();
        for i in 2..self.axes.len() {
            let (kind, name) = (cell(&self.kinds, i), cell(&self.names, i));
            match groups.last_mut() {
                Some(last) if last.kind == kind && last.name == name => last.columns.end = i + 1,
                _ => groups.push(Group {
                    kind,
                    name,
                    columns: i..i + 1,
                }),
            }
        }
        groups
    }

    fn quantity(&self, column: usize) -> &str {
        self.quantities.get(column).map_or("", String::as_str)
    }

    /// The columns of one quantity of a group, one per axis; `None` when one is missing.
    fn find<const N: usize>(
        &self,
        group: &Group,
        quantity: &str,
        axes: [&str; N],
    ) -> Option<[usize; N]> {
        let found = axes.map(|axis| {
            (group.columns.clone()).find(|&i| self.quantity(i) == quantity && self.axes[i] == axis)
        });
        if found.iter().any(Option::is_none) {
            return None;
        }
        Some(found.map(Option::unwrap_or_default))
    }
}

/// Columns of one type and name.
struct Group {
    kind: String,
    name: String,
    columns: Range<usize>,
}

/// Markers and bodies while they are read.
#[derive(Default)]
struct Tracks {
    markers: Vec<MarkerTrack>,
    bodies: Vec<Body>,
}

/// Which columns are whose.
fn plan(header: &Header, rotation_type: &str, recording: &mut Recording) -> Placed<Tracks> {
    let (mut tracks, mut skipped) = (Tracks::default(), Vec::new());
    for group in header.groups() {
        let position = header.find(&group, "Position", ["X", "Y", "Z"]);
        match (group.kind.as_str(), position) {
            ("Rigid Body", Some(position)) => {
                let body = plan_body(header, &group, position, rotation_type)?;
                tracks.bodies.push(body);
            }
            ("Marker" | "Rigid Body Marker", Some(position)) => {
                tracks.markers.push(plan_marker(&group, position));
            }
            ("Rigid Body" | "Marker" | "Rigid Body Marker", None) => {
                return unexpected(
                    header.line,
                    &group.name,
                    "columns Position X, Y, Z below every name",
                );
            }
            _ => skipped.push(format!("{} {}", group.kind, group.name)),
        }
    }
    if !skipped.is_empty() {
        recording
            .meta
            .conversions
            .push(format!("skipped columns: {}", skipped.join(", ")));
    }
    tracks.leave_out_computed(&mut recording.meta.conversions);
    if tracks.markers.iter().any(|marker| marker.filled) {
        recording
            .meta
            .conversions
            .push("rigid body markers are computed by Motive: read as filled".to_string());
    }
    tracks.make_names_unique(&mut recording.meta.findings);
    Ok(tracks)
}

/// A rigid body; its rotation has to be a quaternion.
fn plan_body(
    header: &Header,
    group: &Group,
    position: [usize; 3],
    rotation_type: &str,
) -> Placed<Body> {
    let name = &group.name;
    let rotation = header.find(group, "Rotation", ["X", "Y", "Z", "W"]);
    let Some(rotation) = rotation.filter(|_| rotation_type == "Quaternion") else {
        let what = format!("rotation type `{rotation_type}` of rigid body `{name}`");
        let remedy = "export with Rotation Type Quaternion".to_string();
        return Err((At::Line(header.line), Problem::Unsupported { what, remedy }));
    };
    let error = (group.columns.clone()).find(|&i| header.quantity(i).contains("Error"));
    Ok(Body {
        stream: body_stream(name),
        rotation,
        position,
        error,
    })
}

/// A marker, with the body that its name tells.
fn plan_marker(group: &Group, position: [usize; 3]) -> MarkerTrack {
    let (kind, name) = (group.kind.as_str(), group.name.as_str());
    let mut marker = MarkerTrack::new(name, position, kind != "Marker");
    marker.stream.unlabeled = name.starts_with("Unlabeled");
    let body = if kind == "Rigid Body Marker" {
        name.rsplit_once(['_', ':'])
    } else {
        name.split_once(':')
            .filter(|(body, _)| *body != "Unlabeled")
    };
    marker.stream.body = body.map(|(body, _)| body.to_string());
    marker
}

impl Tracks {
    /// Leaves out computed markers of bodies whose markers the file has as measured.
    fn leave_out_computed(&mut self, conversions: &mut Vec<String>) {
        let labeled = |marker: &&MarkerTrack| !marker.filled && !marker.stream.unlabeled;
        let of_body = |marker: &MarkerTrack| marker.stream.body.clone();
        let measured: BTreeSet<String> = (self.markers.iter().filter(labeled))
            .filter_map(of_body)
            .collect();
        let is_twice = |marker: &MarkerTrack| {
            let body = marker.stream.body.as_ref();
            marker.filled && body.is_some_and(|body| measured.contains(body))
        };
        let before = self.markers.len();
        self.markers.retain(|marker| !is_twice(marker));
        if self.markers.len() < before {
            conversions.push(
                "rigid body markers are left out: the file has the measured markers".to_string(),
            );
        }
    }

    fn make_names_unique(&mut self, findings: &mut Vec<Finding>) {
        let names = self.markers.iter().map(|m| m.stream.name.clone()).collect();
        let unique = unique_names(names, About::Marker, findings);
        for (marker, name) in self.markers.iter_mut().zip(unique) {
            marker.stream.name = name;
        }
        let names = self.bodies.iter().map(|b| b.stream.name.clone()).collect();
        let unique = unique_names(names, About::Body, findings);
        for (body, name) in self.bodies.iter_mut().zip(unique) {
            body.stream.name = name;
        }
    }
}

/// Reads the rows of numbers into markers and bodies.
fn read_rows<R: BufRead>(
    lines: &mut Lines<R>,
    width: usize,
    tracks: &mut Tracks,
    per_meter: f64,
) -> Placed<Instants> {
    let (mut instants, mut values) = (Instants::default(), Vec::new());
    loop {
        let number = lines.number() + 1;
        let Some(line) = lines.next()? else { break };
        if line.bytes().all(|b| b == b',' || b == b' ') {
            continue;
        }
        numbers(number, line, COMMA, width, &mut values)?;
        let frame = instants.take(number, values[0], values[1])?;
        for marker in &mut tracks.markers {
            marker.read(number, frame, &values, per_meter)?;
        }
        for body in &mut tracks.bodies {
            read_body(body, number, &values, per_meter)?;
        }
    }
    if instants.frames.is_empty() {
        return Err((At::Line(lines.number()), Problem::NoRows));
    }
    Ok(instants)
}

fn read_body(body: &mut Body, line: u64, values: &[f64], per_meter: f64) -> Placed<()> {
    let q = body.rotation.map(|i| values[i]);
    let given = q.iter().filter(|value| !value.is_nan()).count();
    let point = match triplet(
        line,
        &body.stream.name,
        body.position.map(|i| values[i]),
        per_meter,
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
