//! TRC (Motion Analysis, OpenSim): tabs, or commas in some exports.
//!
//! ```text
//! PathFileType  4  (X/Y/Z)  name.trc
//! DataRate  CameraRate  NumFrames  NumMarkers  Units  OrigDataRate  OrigDataStartFrame  OrigNumFrames
//! 100       100         652        51          mm     …
//! Frame#  Time  M1  .  .  M2 …
//!               X1  Y1  Z1  X2 …
//! ```
//!
//! The numbers of frames and markers in the header are often wrong; the columns count.

use super::common::{
    Instants, MarkerTrack, first_cell, frame_count_differs, numbers, take_zeros, tracker_clock,
    unexpected, unique_names,
};
use super::{Input, ReadOptions, Reader};
use crate::error::{At, Placed, Problem};
use crate::model::{Recording, Timeline};
use crate::text::{Lines, Separator, cells};
use crate::units::LengthUnit;
use calib_finding::{About, Finding};
use std::io::{BufRead, BufReader};

pub(super) const READER: Reader = Reader {
    id: "trc",
    name: "TRC",
    extensions: &["trc"],
    detect,
    read,
};

fn detect(head: &[u8]) -> bool {
    first_cell(head).starts_with("PathFileType")
}

fn read(input: &mut dyn Input, options: &ReadOptions) -> Placed<Recording> {
    let mut lines = Lines::new(BufReader::with_capacity(1 << 16, input));
    let header = Header::read(&mut lines)?;
    let unit_text = header.field("Units").unwrap_or("");
    let Some(unit) = LengthUnit::from_text(unit_text) else {
        return unexpected(3, unit_text, "Units mm, cm or m");
    };
    let mut findings = Vec::new();
    let mut markers = header.markers(&mut findings)?;
    take_zeros(&mut markers, options);
    let instants = read_rows(&mut lines, header.separator, &mut markers, unit)?;
    let promised = header
        .field("NumFrames")
        .and_then(|text| text.parse::<usize>().ok());
    let found = instants.frames.len();
    if let Some(promised) = promised.filter(|&promised| promised != found) {
        findings.push(frame_count_differs("NumFrames", promised as u64, found));
    }
    let rate = header
        .field("DataRate")
        .and_then(|text| text.parse::<f64>().ok());
    let mut recording = Recording::default();
    recording.meta.comments = header.comments();
    recording
        .meta
        .conversions
        .push(format!("lengths from {}", unit.name()));
    recording.meta.up_axis = options.up_axis.clone();
    recording.markers = markers
        .into_iter()
        .map(|marker| marker.finish(&mut findings))
        .collect();
    recording.meta.findings = findings;
    recording.timelines.push(Timeline {
        clock: tracker_clock(rate),
        rows: instants.frames,
        t: Some(instants.times),
        ..Timeline::default()
    });
    Ok(recording)
}

/// The five lines above the numbers.
struct Header {
    separator: Separator,
    lines: Vec<Vec<String>>,
}

impl Header {
    fn read<R: BufRead>(lines: &mut Lines<R>) -> Placed<Self> {
        let mut separator = Separator::Byte(b'\t');
        let mut header: Vec<Vec<String>> = Vec::new();
        for i in 0..5 {
            let Some(line) = lines.next()? else {
                return Err((At::Line(lines.number()), Problem::NoRows));
            };
            if i == 0 {
                separator = Separator::Byte(if line.contains('\t') { b'\t' } else { b',' });
            }
            header.push(cells(line, separator).map(str::to_string).collect());
        }
        Ok(Header {
            separator,
            lines: header,
        })
    }

    /// The value below a key.
    fn field(&self, key: &str) -> Option<&str> {
        let column = self.lines[1].iter().position(|name| name == key)?;
        self.lines[2].get(column).map(String::as_str)
    }

    fn comments(&self) -> Vec<String> {
        self.lines[1]
            .iter()
            .zip(&self.lines[2])
            .filter(|(key, _)| !key.is_empty())
            .map(|(key, value)| format!("{key}: {value}"))
            .collect()
    }

    /// The markers with their columns.
    fn markers(&self, findings: &mut Vec<Finding>) -> Placed<Vec<MarkerTrack>> {
        let row = &self.lines[3];
        let names: Vec<(usize, String)> = row
            .iter()
            .cloned()
            .enumerate()
            .skip(2)
            .filter(|(_, name)| !name.is_empty())
            .collect();
        if !row.first().is_some_and(|cell| cell.starts_with("Frame")) || names.is_empty() {
            return unexpected(
                4,
                row.first().map_or("", String::as_str),
                "`Frame#`, `Time` and the markers' names",
            );
        }
        // Names stand above their columns, or (a habit of some writers) directly one after the other.
        let packed = names.len() > 1
            && names
                .iter()
                .zip(2..)
                .all(|((column, _), expected)| *column == expected);
        let unique = unique_names(
            names.iter().map(|(_, name)| name.clone()).collect(),
            About::Marker,
            findings,
        );
        Ok((unique.iter().zip(&names).enumerate())
            .map(|(k, (name, (column, _)))| {
                let x = if packed { 2 + 3 * k } else { *column };
                MarkerTrack::new(name, [x, x + 1, x + 2], false)
            })
            .collect())
    }
}

/// Reads the rows of numbers into the markers.
fn read_rows<R: BufRead>(
    lines: &mut Lines<R>,
    separator: Separator,
    markers: &mut [MarkerTrack],
    unit: LengthUnit,
) -> Placed<Instants> {
    let columns = markers.last().map_or(2, |marker| marker.columns[2] + 1);
    let per_meter = unit.per_meter();
    let (mut instants, mut values) = (Instants::default(), Vec::new());
    loop {
        let number = lines.number() + 1;
        let Some(line) = lines.next()? else { break };
        if line.bytes().all(|b| matches!(b, b',' | b'\t' | b' ')) {
            continue;
        }
        numbers(number, line, separator, columns, &mut values)?;
        let frame = instants.take(number, values[0], values[1])?;
        for marker in &mut *markers {
            marker.read(number, frame, &values, per_meter)?;
        }
    }
    if instants.frames.is_empty() {
        return Err((At::Line(lines.number()), Problem::NoRows));
    }
    Ok(instants)
}
