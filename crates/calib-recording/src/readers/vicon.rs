//! Vicon Nexus and Tracker CSV: sections `Trajectories` (markers), `Objects`, `Segments` and the poses among the
//! `Model Outputs` (bodies).
//!
//! ```text
//! Trajectories                      section name
//! 100                               rate, Hz
//! ,,Hand:A,,,Hand:B,,               names, each above the first of its columns
//! Frame,Sub Frame,X,Y,Z,X,Y,Z
//! ,,mm,mm,mm,mm,mm,mm
//! 1,0,44.1,-276.8,675.6,,,          blank = lost; a blank line ends the section
//! ```
//!
//! The old Workstation form begins with `Title … Notes`, writes `TRAJECTORIES`, `100,Hz`, `Field #` and no units.
//! `RX,RY,RZ` is a rotation vector by default and may be longer than π (the file does not say when Tracker was told
//! to export Euler angles instead: [`RotationForm`](super::RotationForm) overrides).

use super::common::{
    MarkerTrack, Triplet, all_zero, body_stream, first_cell, head_text, numbers, pose, quaternion,
    triplet, unexpected, unique_names,
};
use super::{Input, ReadOptions, Reader, RotationForm};
use crate::error::{At, Placed, Problem};
use crate::growth::push;
use crate::model::{BodyStream, Meta, Recording, Timeline};
use crate::text::{Lines, Separator, cells};
use crate::units::{AngleUnit, LengthUnit};
use calib_finding::{About, Subject};
use nalgebra::{UnitQuaternion, Vector3};
use std::io::{BufRead, BufReader};

pub(super) const READER: Reader = Reader {
    id: "vicon_csv",
    name: "Vicon Nexus or Tracker CSV",
    extensions: &["csv"],
    detect,
    read,
};

const SECTIONS: [&str; 6] = [
    "trajectories",
    "objects",
    "segments",
    "model outputs",
    "joints",
    "devices",
];

fn section_of(cell: &str) -> Option<&'static str> {
    let cell = cell.to_ascii_lowercase();
    SECTIONS.into_iter().find(|section| *section == cell)
}

fn detect(head: &[u8]) -> bool {
    let first = first_cell(head);
    section_of(first).is_some()
        || (first == "Title"
            && head_text(head)
                .lines()
                .take(12)
                .any(|line| line.trim_end_matches([',', ';']) == "TRAJECTORIES"))
}

fn read(input: &mut dyn Input, options: &ReadOptions) -> Placed<Recording> {
    let mut lines = Lines::new(BufReader::with_capacity(1 << 16, input));
    let mut recording = Recording::default();
    let separator = loop {
        let Some(line) = lines.next()? else {
            return Err((At::Line(lines.number()), Problem::NoRows));
        };
        let separator = Separator::guess(line);
        let first = cells(line, separator).next().unwrap_or("");
        if let Some(section) = section_of(first) {
            read_section(&mut lines, section, options, &mut recording)?;
            break separator;
        }
        let mut parts = cells(line, separator);
        let (key, value) = (parts.next().unwrap_or(""), parts.next().unwrap_or(""));
        if !key.is_empty() {
            recording
                .meta
                .comments
                .push(format!("{}: {value}", key.trim_end_matches(':')));
        }
    };
    while let Some(line) = lines.next()? {
        let first = cells(line, separator).next().unwrap_or("");
        if first.is_empty() {
            continue;
        }
        let Some(section) = section_of(first) else {
            let found = first.to_string();
            return unexpected(
                lines.number(),
                &found,
                "the name of a section (Trajectories, Objects, Segments, …)",
            );
        };
        read_section(&mut lines, section, options, &mut recording)?;
    }
    let Recording {
        meta: Meta { findings, .. },
        bodies,
        markers,
        ..
    } = &mut recording;
    let names = unique_names(
        markers.iter().map(|marker| marker.name.clone()).collect(),
        About::Marker,
        findings,
    );
    markers
        .iter_mut()
        .zip(names)
        .for_each(|(marker, name)| marker.name = name);
    let names = unique_names(
        bodies.iter().map(|body| body.name.clone()).collect(),
        About::Body,
        findings,
    );
    bodies
        .iter_mut()
        .zip(names)
        .for_each(|(body, name)| body.name = name);
    if markers.is_empty() && bodies.is_empty() {
        return Err((At::Line(lines.number()), Problem::NoRows));
    }
    Ok(recording)
}

struct Body {
    stream: BodyStream,
    position: [usize; 3],
    rotation: Vec<usize>,
    units_per_metre: f64,
    units_per_radian: f64,
    zeros: Vec<u64>,
}

fn read_section<R: BufRead>(
    lines: &mut Lines<R>,
    section: &str,
    options: &ReadOptions,
    out: &mut Recording,
) -> Placed<()> {
    let Some(rate_line) = lines.next()? else {
        return Err((At::Line(lines.number()), Problem::NoRows));
    };
    let separator = Separator::guess(rate_line);
    let rate_text = cells(rate_line, separator).next().unwrap_or("").to_string();
    let rate = match rate_text.parse::<f64>() {
        Ok(rate) if rate.is_finite() && rate > 0.0 => rate,
        _ => return unexpected(lines.number(), &rate_text, "the section's rate in Hz"),
    };
    let Some(names) = lines.next()? else {
        return Err((At::Line(lines.number()), Problem::NoRows));
    };
    let separator = Separator::guess(names);
    let names: Vec<String> = cells(names, separator).map(str::to_string).collect();
    let Some(header) = lines.next()? else {
        return Err((At::Line(lines.number()), Problem::NoRows));
    };
    let header: Vec<String> = cells(header, separator).map(str::to_string).collect();
    if !matches!(header[0].as_str(), "Frame" | "Field #") {
        return unexpected(lines.number(), &header[0], "`Frame,Sub Frame,…`");
    }
    let wanted = matches!(
        section,
        "trajectories" | "objects" | "segments" | "model outputs"
    );
    if !wanted {
        out.meta.conversions.push(format!(
            "section `{section}` skipped: it holds no measured poses or markers"
        ));
    }
    let mut groups = if wanted {
        groups(&names, &header)
    } else {
        Vec::new()
    };
    if section == "model outputs" {
        // Angles, forces and virtual points have X, Y, Z too: only what has a full pose is a body.
        groups.retain(|(_, columns)| columns.clone().any(|i| header[i] == "TX"));
        out.meta
            .conversions
            .push("section `model outputs`: only poses are read".to_string());
    }
    let wanted = wanted && !groups.is_empty();
    let (mut markers, mut bodies) = (Vec::new(), Vec::new());
    let mut units: Option<Vec<String>> = None;
    let mut started = false;
    let (mut rows, mut times) = (Vec::new(), Vec::new());
    let mut values = Vec::new();
    let mut length = LengthUnit::Mm.per_metre();
    loop {
        let number = lines.number() + 1;
        let Some(line) = lines.next()? else { break };
        if line
            .bytes()
            .all(|b| matches!(b, b',' | b';' | b'\t' | b' '))
        {
            break;
        }
        if !wanted {
            continue;
        }
        if !started {
            if cells(line, separator).next() == Some("") {
                units = Some(cells(line, separator).map(str::to_string).collect());
                continue;
            }
            started = true;
            length = length_unit(number, units.as_deref(), &groups)?.per_metre();
            (markers, bodies) = plan(
                number,
                &groups,
                &header,
                units.as_deref(),
                options,
                length,
                out,
            )?;
        }
        numbers(number, line, separator, header.len(), &mut values)?;
        let frame = values[0];
        if !(0.0..1e15).contains(&frame) {
            return unexpected(number, "", "a frame number");
        }
        if let Some(&previous) = rows.last()
            && frame <= previous as f64
        {
            return Err((
                At::Line(number),
                Problem::FrameBackwards {
                    previous: previous as i64,
                    found: frame as i64,
                },
            ));
        }
        let row = frame as u64;
        push(&mut rows, row);
        push(&mut times, (frame - 1.0) / rate);
        for marker in &mut markers {
            MarkerTrack::read(marker, number, row, &values, length)?;
        }
        for body in &mut bodies {
            read_body(body, number, row, &values)?;
        }
    }
    if !wanted {
        return Ok(());
    }
    if rows.is_empty() {
        return Err((At::Line(lines.number()), Problem::NoRows));
    }
    let clock = format!("tracker frames at {rate} Hz");
    let timeline = timeline(
        out,
        Timeline {
            clock,
            rows,
            t: Some(times),
            ..Timeline::default()
        },
    );
    for marker in markers {
        let mut stream = marker.finish(&mut out.meta.findings);
        stream.timeline = timeline;
        out.markers.push(stream);
    }
    for Body {
        mut stream, zeros, ..
    } in bodies
    {
        out.meta
            .findings
            .extend(all_zero(Subject::body(&stream.name), zeros));
        stream.timeline = timeline;
        out.bodies.push(stream);
    }
    Ok(())
}

/// Index of this timeline; sections of the same frames share one.
fn timeline(out: &mut Recording, timeline: Timeline) -> usize {
    match out.timelines.iter().position(|known| *known == timeline) {
        Some(index) => index,
        None => {
            out.timelines.push(timeline);
            out.timelines.len() - 1
        }
    }
}

/// Name and columns of each group.
fn groups(names: &[String], header: &[String]) -> Vec<(String, std::ops::Range<usize>)> {
    let starts: Vec<usize> = (1..names.len().min(header.len()))
        .filter(|&i| !names[i].is_empty())
        .collect();
    starts
        .iter()
        .enumerate()
        .map(|(k, &start)| {
            (
                clean_name(&names[start]),
                start..starts.get(k + 1).copied().unwrap_or(header.len()),
            )
        })
        .collect()
}

/// `Global Angle Hand:Hand` is the body `Hand`.
fn clean_name(name: &str) -> String {
    let name = name.strip_prefix("Global Angle ").unwrap_or(name);
    let name = name.strip_prefix("(Quaternion) ").unwrap_or(name).trim();
    match name.split_once(':') {
        Some((subject, object)) if subject == object => subject.to_string(),
        _ => name.to_string(),
    }
}

fn length_unit(
    line: u64,
    units: Option<&[String]>,
    groups: &[(String, std::ops::Range<usize>)],
) -> Placed<LengthUnit> {
    let texts = groups
        .iter()
        .flat_map(|(_, columns)| columns.clone())
        .filter_map(|i| units?.get(i));
    let mut lengths = texts.filter(|text| !matches!(text.as_str(), "" | "rad" | "deg"));
    let Some(first) = lengths.next() else {
        return Ok(LengthUnit::Mm);
    };
    let Some(unit) = LengthUnit::from_text(first) else {
        return unexpected(line, first, "mm, cm or m");
    };
    match lengths.find(|text| *text != first) {
        Some(other) => unexpected(
            line,
            other,
            &format!("`{first}` in all columns of the section"),
        ),
        None => Ok(unit),
    }
}

fn plan(
    line: u64,
    groups: &[(String, std::ops::Range<usize>)],
    header: &[String],
    units: Option<&[String]>,
    options: &ReadOptions,
    units_per_metre: f64,
    out: &mut Recording,
) -> Placed<(Vec<MarkerTrack>, Vec<Body>)> {
    let (mut markers, mut bodies) = (Vec::new(), Vec::new());
    for (name, columns) in groups {
        let find = |axis: &str| columns.clone().find(|&i| header[i] == axis);
        if let (Some(x), Some(y), Some(z)) = (find("X"), find("Y"), find("Z")) {
            markers.push(MarkerTrack::new(name, [x, y, z], false));
        } else if let (Some(x), Some(y), Some(z)) = (find("TX"), find("TY"), find("TZ")) {
            let rotation: Option<Vec<usize>> =
                ["RX", "RY", "RZ"].iter().map(|axis| find(axis)).collect();
            let Some(mut rotation) = rotation else {
                out.meta
                    .conversions
                    .push(format!("`{name}` skipped: it has no rotation"));
                continue;
            };
            rotation.extend(find("RW"));
            let degrees = units
                .and_then(|units| units.get(rotation[0]))
                .is_some_and(|unit| unit == "deg");
            let angle = if degrees {
                AngleUnit::Deg
            } else {
                AngleUnit::Rad
            };
            bodies.push(Body {
                stream: body_stream(name),
                position: [x, y, z],
                rotation,
                units_per_metre,
                units_per_radian: angle.per_radian(),
                zeros: Vec::new(),
            });
        } else {
            return unexpected(
                line,
                name,
                "columns X,Y,Z or RX,RY,RZ,TX,TY,TZ below every name",
            );
        }
    }
    if let Some(body) = bodies.first_mut() {
        let form = if body.rotation.len() == 4 {
            RotationForm::Quaternion
        } else {
            options.rotation.unwrap_or(RotationForm::RotationVector)
        };
        if (form == RotationForm::Quaternion) != (body.rotation.len() == 4) {
            return unexpected(
                line,
                "three rotation columns",
                "RX,RY,RZ,RW for quaternions",
            );
        }
        out.meta
            .conversions
            .push(format!("rotation columns read as {form}"));
        if form == RotationForm::EulerXyz {
            for body in &mut bodies {
                // Marks Euler angles for `read_body`: a fifth column is never read.
                body.rotation.extend([usize::MAX, usize::MAX]);
            }
        }
    }
    let unit = if units_per_metre == 1e3 {
        "mm"
    } else if units_per_metre == 1e2 {
        "cm"
    } else {
        "m"
    };
    out.meta.conversions.push(format!("lengths from {unit}"));
    Ok((markers, bodies))
}

fn read_body(body: &mut Body, line: u64, row: u64, values: &[f64]) -> Placed<()> {
    let name = body.stream.name.clone();
    let position = triplet(
        line,
        &name,
        body.position.map(|i| values[i]),
        body.units_per_metre,
    )?;
    let parts: Vec<f64> = body
        .rotation
        .iter()
        .filter_map(|&i| values.get(i).copied())
        .collect();
    let given = parts.iter().filter(|value| !value.is_nan()).count();
    let point = match position {
        Triplet::Lost if given == 0 => {
            push(&mut body.stream.tracker_from_body, None);
            return Ok(());
        }
        Triplet::Zero if given == 0 || parts.iter().all(|&value| value == 0.0) => {
            body.zeros.push(row);
            push(&mut body.stream.tracker_from_body, None);
            return Ok(());
        }
        Triplet::Zero => nalgebra::Point3::origin(),
        Triplet::Point(point) if given == parts.len() => point,
        Triplet::Lost | Triplet::Point(_) => {
            let (given, needed) = (
                given
                    + if matches!(position, Triplet::Lost) {
                        0
                    } else {
                        3
                    },
                parts.len() + 3,
            );
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
    };
    let scaled: Vec<f64> = parts
        .iter()
        .map(|value| value / body.units_per_radian)
        .collect();
    let rotation = match (scaled.as_slice(), body.rotation.len()) {
        ([_, _, _, _], _) => quaternion(
            At::Line(line),
            &name,
            [parts[0], parts[1], parts[2], parts[3]],
        )?,
        // R = Rx(a)·Ry(b)·Rz(c): turns about the moving axes x, y, z.
        ([a, b, c], 5) => {
            let turn = |axis: Vector3<f64>| UnitQuaternion::from_scaled_axis(axis);
            turn(Vector3::x() * *a) * turn(Vector3::y() * *b) * turn(Vector3::z() * *c)
        }
        ([a, b, c], _) => UnitQuaternion::from_scaled_axis(Vector3::new(*a, *b, *c)),
        _ => return unexpected(line, "", "three or four rotation columns"),
    };
    push(
        &mut body.stream.tracker_from_body,
        Some(pose(point, rotation)),
    );
    Ok(())
}
