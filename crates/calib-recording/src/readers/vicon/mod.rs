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

mod body;

use super::common::{
    MarkerTrack, all_zero, body_stream, first_cell, head_text, is_frame_number, numbers,
    take_zeros, tracker_clock, unexpected, unique_names,
};
use super::{Input, ReadOptions, Reader, RotationForm};
use crate::error::{At, Placed, Problem};
use crate::growth::push;
use crate::model::{Meta, Recording, Timeline};
use crate::text::{Lines, Separator, cells};
use crate::units::{AngleUnit, LengthUnit};
use body::{Body, read_body};
use calib_finding::{About, Subject};
use std::io::{BufRead, BufReader};
use std::ops::Range;

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

/// Reads one section, from the line after its name to its end.
fn read_section<R: BufRead>(
    lines: &mut Lines<R>,
    name: &str,
    options: &ReadOptions,
    out: &mut Recording,
) -> Placed<()> {
    let section = Section::read(lines, name, out)?;
    let tracks = section.read_rows(lines, options, out)?;
    if section.groups.is_empty() {
        return Ok(());
    }
    if tracks.rows.is_empty() {
        return Err((At::Line(lines.number()), Problem::NoRows));
    }
    tracks.finish(section.rate, out);
    Ok(())
}

/// Name and columns of a marker or body.
type Group = (String, Range<usize>);

/// The lines of a section above its units.
struct Section {
    separator: Separator,
    /// Hz.
    rate: f64,
    header: Vec<String>,
    /// What is read; nothing of a section that is skipped.
    groups: Vec<Group>,
}

/// What the rows of a section are read into.
#[derive(Default)]
struct Tracks {
    markers: Vec<MarkerTrack>,
    bodies: Vec<Body>,
    rows: Vec<u64>,
    times: Vec<f64>,
}

impl Section {
    fn read<R: BufRead>(lines: &mut Lines<R>, name: &str, out: &mut Recording) -> Placed<Self> {
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
            name,
            "trajectories" | "objects" | "segments" | "model outputs"
        );
        let mut groups = if wanted {
            groups(&names, &header)
        } else {
            out.meta.conversions.push(format!(
                "section `{name}` skipped: it holds no measured poses or markers"
            ));
            Vec::new()
        };
        if name == "model outputs" {
            // Angles, forces and virtual points have X, Y, Z too: only what has a full pose is a body.
            groups.retain(|(_, columns)| columns.clone().any(|i| header[i] == "TX"));
            out.meta
                .conversions
                .push("section `model outputs`: only poses are read".to_string());
        }
        Ok(Section {
            separator,
            rate,
            header,
            groups,
        })
    }

    /// Reads the row of units and the rows of numbers, up to a blank line or the end of the file.
    fn read_rows<R: BufRead>(
        &self,
        lines: &mut Lines<R>,
        options: &ReadOptions,
        out: &mut Recording,
    ) -> Placed<Tracks> {
        let mut units: Option<Vec<String>> = None;
        let mut tracks: Option<Tracks> = None;
        let mut values = Vec::new();
        let mut length = LengthUnit::Mm.per_meter();
        loop {
            let number = lines.number() + 1;
            let Some(line) = lines.next()? else { break };
            if line
                .bytes()
                .all(|b| matches!(b, b',' | b';' | b'\t' | b' '))
            {
                break;
            }
            if self.groups.is_empty() {
                continue;
            }
            let tracks = match &mut tracks {
                Some(tracks) => tracks,
                None => {
                    if cells(line, self.separator).next() == Some("") {
                        units = Some(cells(line, self.separator).map(str::to_string).collect());
                        continue;
                    }
                    let columns = Columns {
                        line: number,
                        section: self,
                        units: units.as_deref(),
                    };
                    length = columns.length_unit()?.per_meter();
                    tracks.insert(columns.plan(options, length, out)?)
                }
            };
            numbers(number, line, self.separator, self.header.len(), &mut values)?;
            tracks.read(number, &values, self.rate, length)?;
        }
        Ok(tracks.unwrap_or_default())
    }
}

impl Tracks {
    /// Takes one row.
    fn read(&mut self, line: u64, values: &[f64], rate: f64, length: f64) -> Placed<()> {
        let frame = values[0];
        if !is_frame_number(frame) {
            return unexpected(line, "", "a frame number");
        }
        if let Some(&previous) = self.rows.last()
            && frame <= previous as f64
        {
            return Err((
                At::Line(line),
                Problem::FrameBackwards {
                    previous: previous as i64,
                    found: frame as i64,
                },
            ));
        }
        let row = frame as u64;
        push(&mut self.rows, row);
        push(&mut self.times, (frame - 1.0) / rate);
        for marker in &mut self.markers {
            marker.read(line, row, values, length)?;
        }
        for body in &mut self.bodies {
            read_body(body, line, row, values)?;
        }
        Ok(())
    }

    /// Hands the streams to the recording.
    fn finish(self, rate: f64, out: &mut Recording) {
        let timeline = timeline(
            out,
            Timeline {
                clock: tracker_clock(Some(rate)),
                rows: self.rows,
                t: Some(self.times),
                ..Timeline::default()
            },
        );
        for marker in self.markers {
            let mut stream = marker.finish(&mut out.meta.findings);
            stream.timeline = timeline;
            out.markers.push(stream);
        }
        for Body {
            mut stream, zeros, ..
        } in self.bodies
        {
            out.meta
                .findings
                .extend(all_zero(Subject::body(&stream.name), zeros));
            stream.timeline = timeline;
            out.bodies.push(stream);
        }
    }
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
fn groups(names: &[String], header: &[String]) -> Vec<Group> {
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

/// What the columns of a section mean, known once its units are.
struct Columns<'a> {
    /// First row of numbers.
    line: u64,
    section: &'a Section,
    /// Unit of each column, where the section states them.
    units: Option<&'a [String]>,
}

impl Columns<'_> {
    /// The one unit of all lengths of the section.
    fn length_unit(&self) -> Placed<LengthUnit> {
        let texts = (self.section.groups.iter())
            .flat_map(|(_, columns)| columns.clone())
            .filter_map(|i| self.units?.get(i));
        let mut lengths = texts.filter(|text| !matches!(text.as_str(), "" | "rad" | "deg"));
        let Some(first) = lengths.next() else {
            return Ok(LengthUnit::Mm);
        };
        let Some(unit) = LengthUnit::from_text(first) else {
            return unexpected(self.line, first, "mm, cm or m");
        };
        match lengths.find(|text| *text != first) {
            Some(other) => unexpected(
                self.line,
                other,
                &format!("`{first}` in all columns of the section"),
            ),
            None => Ok(unit),
        }
    }

    /// Which columns are whose.
    fn plan(
        &self,
        options: &ReadOptions,
        units_per_meter: f64,
        out: &mut Recording,
    ) -> Placed<Tracks> {
        let mut tracks = Tracks::default();
        let conversions = &mut out.meta.conversions;
        for (name, columns) in &self.section.groups {
            let find = |axis: &str| columns.clone().find(|&i| self.section.header[i] == axis);
            if let (Some(x), Some(y), Some(z)) = (find("X"), find("Y"), find("Z")) {
                let mut marker = MarkerTrack::new(name, [x, y, z], false);
                let subject = name.split_once(':').map(|(subject, _)| subject.to_string());
                marker.stream.body = subject;
                tracks.markers.push(marker);
            } else if let (Some(x), Some(y), Some(z)) = (find("TX"), find("TY"), find("TZ")) {
                let (Some(a), Some(b), Some(c)) = (find("RX"), find("RY"), find("RZ")) else {
                    conversions.push(format!("`{name}` skipped: it has no rotation"));
                    continue;
                };
                let mut rotation = vec![a, b, c];
                rotation.extend(find("RW"));
                tracks.bodies.push(Body {
                    stream: body_stream(name),
                    position: [x, y, z],
                    rotation,
                    units_per_meter,
                    units_per_radian: self.angle_unit(a).per_radian(),
                    zeros: Vec::new(),
                });
            } else {
                return unexpected(
                    self.line,
                    name,
                    "columns X,Y,Z or RX,RY,RZ,TX,TY,TZ below every name",
                );
            }
        }
        self.choose_rotation_form(options, &mut tracks.bodies, conversions)?;
        let unit = if units_per_meter == 1e3 {
            "mm"
        } else if units_per_meter == 1e2 {
            "cm"
        } else {
            "m"
        };
        conversions.push(format!("lengths from {unit}"));
        take_zeros(&mut tracks.markers, options);
        Ok(tracks)
    }

    fn angle_unit(&self, column: usize) -> AngleUnit {
        match self.units.and_then(|units| units.get(column)) {
            Some(unit) if unit == "deg" => AngleUnit::Deg,
            _ => AngleUnit::Rad,
        }
    }

    /// How the rotation columns read: by their number, else by the options.
    fn choose_rotation_form(
        &self,
        options: &ReadOptions,
        bodies: &mut [Body],
        conversions: &mut Vec<String>,
    ) -> Placed<()> {
        let Some(body) = bodies.first() else {
            return Ok(());
        };
        let form = if body.rotation.len() == 4 {
            RotationForm::Quaternion
        } else {
            options.rotation.unwrap_or(RotationForm::RotationVector)
        };
        if (form == RotationForm::Quaternion) != (body.rotation.len() == 4) {
            return unexpected(
                self.line,
                "three rotation columns",
                "RX,RY,RZ,RW for quaternions",
            );
        }
        conversions.push(format!("rotation columns read as {form}"));
        if form == RotationForm::EulerXyz {
            for body in bodies {
                // Marks Euler angles for `read_body`: a fifth column is never read.
                body.rotation.extend([usize::MAX, usize::MAX]);
            }
        }
        Ok(())
    }
}
