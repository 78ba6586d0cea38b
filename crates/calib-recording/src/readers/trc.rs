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
    MarkerTrack, first_cell, frame_count_differs, numbers, unexpected, unique_names,
};
use super::{Input, ReadOptions, Reader};
use crate::error::{At, Placed, Problem};
use crate::growth::push;
use crate::model::{Recording, Timeline};
use crate::text::{Lines, Separator, cells};
use crate::units::LengthUnit;
use calib_finding::About;
use std::io::BufReader;

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
    let field = |key: &str| {
        let column = header[1].iter().position(|name| name == key)?;
        header[2].get(column).map(String::as_str)
    };
    let unit_text = field("Units").unwrap_or("");
    let Some(unit) = LengthUnit::from_text(unit_text) else {
        return unexpected(3, unit_text, "Units mm, cm or m");
    };
    let names: Vec<(usize, String)> = header[3]
        .iter()
        .cloned()
        .enumerate()
        .skip(2)
        .filter(|(_, name)| !name.is_empty())
        .collect();
    if !header[3]
        .first()
        .is_some_and(|cell| cell.starts_with("Frame"))
        || names.is_empty()
    {
        return unexpected(
            4,
            header[3].first().map_or("", String::as_str),
            "`Frame#`, `Time` and the markers' names",
        );
    }
    // Names stand above their columns, or (a habit of some writers) directly one after the other.
    let packed = names.len() > 1
        && names
            .iter()
            .zip(2..)
            .all(|((column, _), expected)| *column == expected);
    let mut findings = Vec::new();
    let unique = unique_names(
        names.iter().map(|(_, name)| name.clone()).collect(),
        About::Marker,
        &mut findings,
    );
    let mut markers: Vec<MarkerTrack> = (unique.iter().zip(&names).enumerate())
        .map(|(k, (name, (column, _)))| {
            let x = if packed { 2 + 3 * k } else { *column };
            MarkerTrack::new(name, [x, x + 1, x + 2], false)
        })
        .collect();
    let columns = markers.last().map_or(2, |marker| marker.columns[2] + 1);

    let (mut frames, mut times, mut values) = (Vec::new(), Vec::new(), Vec::new());
    loop {
        let number = lines.number() + 1;
        let Some(line) = lines.next()? else { break };
        if line.bytes().all(|b| matches!(b, b',' | b'\t' | b' ')) {
            continue;
        }
        numbers(number, line, separator, columns, &mut values)?;
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
            marker.read(number, frame as u64, &values, unit.per_metre())?;
        }
    }
    if frames.is_empty() {
        return Err((At::Line(lines.number()), Problem::NoRows));
    }
    let promised = field("NumFrames").and_then(|text| text.parse::<usize>().ok());
    if let Some(promised) = promised.filter(|&promised| promised != frames.len()) {
        findings.push(frame_count_differs(
            "NumFrames",
            promised as u64,
            frames.len(),
        ));
    }
    let rate = field("DataRate").and_then(|text| text.parse::<f64>().ok());
    let mut recording = Recording::default();
    recording.meta.comments = header[1]
        .iter()
        .zip(&header[2])
        .filter(|(key, _)| !key.is_empty())
        .map(|(key, value)| format!("{key}: {value}"))
        .collect();
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
    let clock = rate.map_or("tracker time".to_string(), |rate| {
        format!("tracker frames at {rate} Hz")
    });
    recording.timelines.push(Timeline {
        clock,
        rows: frames,
        t: Some(times),
        ..Timeline::default()
    });
    Ok(recording)
}
