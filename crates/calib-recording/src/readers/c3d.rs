//! C3D: the points of all six encodings (Intel, DEC or MIPS; integer or float). Analog data are skipped.
//!
//! ```text
//! block 1      header: first parameter block, 0x50, points and analog values per frame, first and last frame, …
//! block P      parameters: processor (84 Intel, 85 DEC, 86 MIPS), then groups and parameters, linked by offsets
//! block D      frames: per point x, y, z, w as i16 × SCALE or f32, then the analog values
//! ```
//!
//! A point with `w < 0` is lost. The low byte of `w` is the residual in units of |SCALE|; 0 means interpolated — unless
//! no point of the file has a residual, then its writer does not know residuals and all points count as measured.

use super::common::unique_names;
use super::{Input, ReadOptions, Reader};
use crate::error::{At, Placed, Problem, excerpt};
use crate::model::{MarkerSample, MarkerStream, Recording, Timeline};
use crate::units::LengthUnit;
use calib_finding::{About, Fact, Finding, Subject, catalog};
use nalgebra::Point3;
use std::collections::BTreeMap;
use std::io::{BufReader, Read, SeekFrom};

pub(super) const READER: Reader = Reader {
    id: "c3d",
    name: "C3D",
    extensions: &["c3d"],
    detect,
    read,
};

const BLOCK: u64 = 512;
/// Parameters have at most 255 blocks (their count is one byte).
const MAX_PARAMETER_BYTES: u64 = 255 * BLOCK;

fn detect(head: &[u8]) -> bool {
    head.len() >= 2 && head[0] >= 1 && head[1] == 0x50
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Processor {
    Intel,
    Dec,
    Mips,
}

impl Processor {
    fn u16(self, bytes: [u8; 2]) -> u16 {
        match self {
            Processor::Mips => u16::from_be_bytes(bytes),
            _ => u16::from_le_bytes(bytes),
        }
    }

    fn f32(self, bytes: [u8; 4]) -> f32 {
        let [a, b, c, d] = bytes;
        match self {
            Processor::Intel => f32::from_le_bytes(bytes),
            Processor::Mips => f32::from_be_bytes(bytes),
            // VAX F: 16-bit words in the other order, exponent biased by two more; exponent 0 is zero.
            Processor::Dec => {
                if b & 0x7f == 0 && a & 0x80 == 0 {
                    0.0
                } else {
                    f32::from_be_bytes([b, a, d, c]) / 4.0
                }
            }
        }
    }

    fn name(self) -> &'static str {
        match self {
            Processor::Intel => "Intel",
            Processor::Dec => "DEC",
            Processor::Mips => "MIPS",
        }
    }
}

/// One parameter: its element size (−1 = text), dimensions, and bytes.
struct Parameter {
    kind: i8,
    dims: Vec<usize>,
    data: Vec<u8>,
}

struct Parameters {
    processor: Processor,
    /// `GROUP:NAME` → parameter.
    all: BTreeMap<String, Parameter>,
}

impl Parameters {
    fn numbers(&self, name: &str) -> Vec<f64> {
        let Some(parameter) = self.all.get(name) else {
            return Vec::new();
        };
        match parameter.kind {
            1 => parameter.data.iter().map(|&b| f64::from(b)).collect(),
            2 => parameter
                .data
                .chunks_exact(2)
                .map(|b| f64::from(self.processor.u16([b[0], b[1]])))
                .collect(),
            4 => parameter
                .data
                .chunks_exact(4)
                .map(|b| f64::from(self.processor.f32([b[0], b[1], b[2], b[3]])))
                .collect(),
            _ => Vec::new(),
        }
    }

    fn number(&self, name: &str) -> Option<f64> {
        self.numbers(name)
            .first()
            .copied()
            .filter(|value| value.is_finite())
    }

    fn texts(&self, name: &str) -> Vec<String> {
        let Some(parameter) = self.all.get(name).filter(|parameter| parameter.kind == -1) else {
            return Vec::new();
        };
        let width = parameter.dims.first().copied().unwrap_or(0);
        if width == 0 {
            return Vec::new();
        }
        let text = |bytes: &[u8]| {
            // Latin-1: every byte is a character.
            let text: String = bytes.iter().map(|&b| char::from(b)).collect();
            text.trim_matches(|c: char| c.is_whitespace() || c == '\0')
                .to_string()
        };
        parameter.data.chunks(width).map(text).collect()
    }
}

/// What the frames look like.
struct Shape {
    processor: Processor,
    points: usize,
    /// Analog values per frame.
    analog: usize,
    first_frame: u64,
    frames: u64,
    /// `None`: float points.
    integer_scale: Option<f64>,
    /// |SCALE|, units of the residual.
    scale: f64,
    data_start: u64,
    rate: f64,
    units_per_metre: f64,
}

fn read(input: &mut dyn Input, _options: &ReadOptions) -> Placed<Recording> {
    let io = |source| (At::File, Problem::Io(source));
    let length = input.seek(SeekFrom::End(0)).map_err(io)?;
    input.seek(SeekFrom::Start(0)).map_err(io)?;
    let mut header = [0u8; BLOCK as usize];
    if length < BLOCK {
        return Err((
            At::Byte(length),
            truncated("the header block", BLOCK - length),
        ));
    }
    input.read_exact(&mut header).map_err(io)?;
    if header[1] != 0x50 {
        let problem = Problem::Unexpected {
            found: format!("{:#04x}", header[1]),
            expected: "0x50, the mark of a C3D file".into(),
        };
        return Err((At::Byte(1), problem));
    }
    let parameters = read_parameters(input, u64::from(header[0]), length)?;
    let mut recording = Recording::default();
    let shape = shape(&header, &parameters, length, &mut recording)?;
    read_points(input, &shape, &parameters, &mut recording)?;
    Ok(recording)
}

fn truncated(what: &str, needed: u64) -> Problem {
    Problem::Truncated {
        what: what.to_string(),
        needed,
    }
}

fn read_parameters(input: &mut dyn Input, block: u64, length: u64) -> Placed<Parameters> {
    let io = |source| (At::File, Problem::Io(source));
    let start = block.saturating_sub(1) * BLOCK;
    if start + 4 > length || block == 0 {
        return Err((
            At::Byte(0),
            truncated("the parameter block", (start + 4).saturating_sub(length)),
        ));
    }
    input.seek(SeekFrom::Start(start)).map_err(io)?;
    let mut bytes = Vec::new();
    input
        .take(MAX_PARAMETER_BYTES)
        .read_to_end(&mut bytes)
        .map_err(io)?;
    // Some writers leave a dangling link behind the last parameter: the count of blocks ends the chain.
    if bytes[2] > 0 {
        bytes.truncate(usize::from(bytes[2]) * BLOCK as usize);
    }
    let processor = match bytes[3] {
        84 => Processor::Intel,
        85 => Processor::Dec,
        86 => Processor::Mips,
        other => {
            let problem = Problem::Unexpected {
                found: other.to_string(),
                expected: "processor 84 (Intel), 85 (DEC) or 86 (MIPS)".into(),
            };
            return Err((At::Byte(start + 3), problem));
        }
    };
    let mut groups: BTreeMap<u8, String> = BTreeMap::new();
    let mut raw: Vec<(u8, String, Parameter)> = Vec::new();
    let mut at = 4usize;
    loop {
        let short = |what: &str| (At::Byte(start + at as u64), truncated(what, 1));
        let Some([name_length, id]) = bytes.get(at..at + 2).map(|b| [b[0] as i8, b[1] as i8])
        else {
            break;
        };
        let name_length = usize::from(name_length.unsigned_abs());
        if name_length == 0 || id == 0 {
            break;
        }
        let name_bytes = bytes
            .get(at + 2..at + 2 + name_length)
            .ok_or_else(|| short("a parameter's name"))?;
        let name: String = name_bytes
            .iter()
            .map(|&b| char::from(b))
            .collect::<String>()
            .to_ascii_uppercase();
        let link = at + 2 + name_length;
        let offset = bytes
            .get(link..link + 2)
            .map(|b| usize::from(processor.u16([b[0], b[1]])));
        let offset = offset.ok_or_else(|| short("a parameter's link"))?;
        if id < 0 {
            groups.insert(id.unsigned_abs(), name);
        } else {
            let (kind, dims) = match bytes.get(link + 2..link + 4) {
                Some(&[kind, count]) => (kind as i8, usize::from(count)),
                _ => return Err(short("a parameter's type")),
            };
            let dims = bytes
                .get(link + 4..link + 4 + dims)
                .ok_or_else(|| short("a parameter's dimensions"))?;
            let dims: Vec<usize> = dims.iter().map(|&b| usize::from(b)).collect();
            let first = link + 4 + dims.len();
            let size = dims
                .iter()
                .try_fold(usize::from(kind.unsigned_abs()), |size, &dim| {
                    size.checked_mul(dim)
                });
            let data = size
                .and_then(|size| bytes.get(first..first.checked_add(size)?))
                .ok_or_else(|| short("a parameter's values"))?;
            raw.push((
                id as u8,
                name,
                Parameter {
                    kind,
                    dims,
                    data: data.to_vec(),
                },
            ));
        }
        if offset == 0 {
            break;
        }
        if offset < 2 {
            let problem = Problem::Unexpected {
                found: offset.to_string(),
                expected: "a link to the next parameter".into(),
            };
            return Err((At::Byte(start + link as u64), problem));
        }
        at = link + offset;
    }
    let named = raw.into_iter().filter_map(|(id, name, parameter)| {
        Some((format!("{}:{name}", groups.get(&id)?), parameter))
    });
    Ok(Parameters {
        processor,
        all: named.collect(),
    })
}

fn shape(
    header: &[u8; BLOCK as usize],
    parameters: &Parameters,
    length: u64,
    out: &mut Recording,
) -> Placed<Shape> {
    let processor = parameters.processor;
    let word = |index: usize| processor.u16([header[2 * index - 2], header[2 * index - 1]]);
    let float = |index: usize| {
        let at = 2 * index - 2;
        f64::from(processor.f32([header[at], header[at + 1], header[at + 2], header[at + 3]]))
    };
    let points = usize::from(word(2));
    if let Some(used) = parameters
        .number("POINT:USED")
        .filter(|&used| used != points as f64)
    {
        let problem = Problem::Misfit {
            found: format!("POINT:USED says {used} points, the header {points}"),
            expected: "the same number in both".to_string(),
        };
        return Err((At::Byte(2), problem));
    }
    if points == 0 {
        return Err((At::Byte(2), Problem::NoRows));
    }
    let scale = parameters.number("POINT:SCALE").unwrap_or_else(|| float(7));
    if !(scale.is_finite() && scale != 0.0) {
        let problem = Problem::Unexpected {
            found: scale.to_string(),
            expected: "a POINT:SCALE that is not zero".into(),
        };
        return Err((At::Byte(12), problem));
    }
    let rate = Some(float(11))
        .filter(|rate| *rate > 0.0 && rate.is_finite())
        .or_else(|| parameters.number("POINT:RATE"));
    let Some(rate) = rate.filter(|rate| *rate > 0.0) else {
        let problem = Problem::Unexpected {
            found: float(11).to_string(),
            expected: "a frame rate above 0".into(),
        };
        return Err((At::Byte(20), problem));
    };
    // The header's frame numbers have 16 bits; TRIAL holds two words of a longer one.
    let long = |name: &str| match parameters.numbers(name).as_slice() {
        [low, high, ..] => Some(*low as u64 + 65_536 * *high as u64),
        _ => None,
    };
    let (first, last) = match (
        long("TRIAL:ACTUAL_START_FIELD"),
        long("TRIAL:ACTUAL_END_FIELD"),
    ) {
        (Some(first), Some(last)) if last >= first => (first, last),
        _ => (u64::from(word(4)), u64::from(word(5))),
    };
    if last < first {
        let problem = Problem::Unexpected {
            found: format!("frames {first} to {last}"),
            expected: "the last frame not before the first".into(),
        };
        return Err((At::Byte(6), problem));
    }
    let data_block = u64::from(word(9));
    let analog = usize::from(word(3));
    let value_bytes = if scale < 0.0 { 4 } else { 2 };
    let frame_bytes = ((4 * points + analog) * value_bytes) as u64;
    let data_start = data_block.saturating_sub(1) * BLOCK;
    let mut frames = last - first + 1;
    if let Some(long) = parameters
        .number("POINT:LONG_FRAMES")
        .filter(|&long| last == 65_535 && long > frames as f64)
    {
        frames = long as u64;
    }
    let available = length.saturating_sub(data_start);
    if data_block == 0
        || frame_bytes
            .checked_mul(frames)
            .is_none_or(|needed| needed > available)
    {
        let what = format!("{frames} frames of {points} points and {analog} analog values");
        let needed = frame_bytes.saturating_mul(frames).saturating_sub(available);
        return Err((At::Byte(length), Problem::Truncated { what, needed }));
    }
    let unit_text = parameters
        .texts("POINT:UNITS")
        .into_iter()
        .next()
        .unwrap_or_default();
    let unit = match LengthUnit::from_text(&unit_text) {
        Some(unit) => unit,
        None if unit_text.is_empty() => {
            let unit = Subject::column("POINT:UNITS");
            let finding = Finding::new(catalog::UNIT_MISSING, unit);
            out.meta.findings.push(finding);
            LengthUnit::Mm
        }
        None => {
            let problem = Problem::Unexpected {
                found: excerpt(&unit_text, 20),
                expected: "POINT:UNITS mm, cm or m".into(),
            };
            return Err((At::Byte(0), problem));
        }
    };
    let meta = &mut out.meta;
    meta.conversions
        .push(format!("lengths from {}", unit.name()));
    let kind = if scale < 0.0 { "float" } else { "integer" };
    meta.comments
        .push(format!("encoding: {} {kind}", processor.name()));
    for name in ["POINT:X_SCREEN", "POINT:Y_SCREEN"] {
        if let Some(axis) = parameters
            .texts(name)
            .into_iter()
            .next()
            .filter(|axis| !axis.is_empty())
        {
            meta.comments.push(format!("{name}: {axis}"));
            if name == "POINT:Y_SCREEN" {
                meta.up_axis = Some(axis);
            }
        }
    }
    Ok(Shape {
        processor,
        points,
        analog,
        first_frame: first,
        frames,
        integer_scale: (scale > 0.0).then_some(scale),
        scale: scale.abs(),
        data_start,
        rate,
        units_per_metre: unit.per_metre(),
    })
}

fn labels(parameters: &Parameters, points: usize, findings: &mut Vec<Finding>) -> Vec<String> {
    let mut labels: Vec<String> = Vec::new();
    for group in 1.. {
        let name = if group == 1 {
            "POINT:LABELS".to_string()
        } else {
            format!("POINT:LABELS{group}")
        };
        let more = parameters.texts(&name);
        if more.is_empty() || labels.len() >= points {
            break;
        }
        labels.extend(more);
    }
    labels.truncate(points);
    for (i, label) in labels
        .iter_mut()
        .enumerate()
        .filter(|(_, label)| label.is_empty())
    {
        *label = format!("point_{}", i + 1);
    }
    labels.extend((labels.len()..points).map(|i| format!("point_{}", i + 1)));
    unique_names(labels, About::Marker, findings)
}

fn read_points(
    input: &mut dyn Input,
    shape: &Shape,
    parameters: &Parameters,
    out: &mut Recording,
) -> Placed<()> {
    let io = |source| (At::File, Problem::Io(source));
    input.seek(SeekFrom::Start(shape.data_start)).map_err(io)?;
    let value_bytes = if shape.integer_scale.is_some() { 2 } else { 4 };
    let frame_bytes = (4 * shape.points + shape.analog) * value_bytes;
    let count = usize::try_from(shape.frames).unwrap_or(usize::MAX);
    // The file is at least this long (checked), so this is no more than three times its size.
    let mut samples: Vec<Vec<MarkerSample>> = (0..shape.points)
        .map(|_| Vec::with_capacity(count))
        .collect();
    let mut frame = vec![0u8; frame_bytes];
    let mut reader = BufReader::with_capacity(1 << 18, input);
    let (mut any_residual, mut not_finite) = (false, 0usize);
    let p = shape.processor;
    for _ in 0..count {
        reader.read_exact(&mut frame).map_err(io)?;
        for (i, stream) in samples.iter_mut().enumerate() {
            let bytes = &frame[4 * i * value_bytes..4 * (i + 1) * value_bytes];
            let (xyz, w) = match shape.integer_scale {
                Some(scale) => {
                    let value = |k: usize| p.u16([bytes[2 * k], bytes[2 * k + 1]]) as i16;
                    let xyz = [0, 1, 2].map(|k| f64::from(value(k)) * scale);
                    (xyz, i32::from(value(3)))
                }
                None => {
                    let value = |k: usize| {
                        p.f32([
                            bytes[4 * k],
                            bytes[4 * k + 1],
                            bytes[4 * k + 2],
                            bytes[4 * k + 3],
                        ])
                    };
                    ([0, 1, 2].map(|k| f64::from(value(k))), value(3) as i32)
                }
            };
            stream.push(if w < 0 {
                MarkerSample::Lost
            } else if !xyz.iter().all(|value| value.is_finite()) {
                not_finite += 1;
                MarkerSample::Lost
            } else {
                let point = Point3::from(xyz.map(|value| value / shape.units_per_metre));
                any_residual |= w & 0xff != 0;
                if w & 0xff == 0 {
                    MarkerSample::Filled(point)
                } else {
                    MarkerSample::Measured(point)
                }
            });
        }
    }
    let meta = &mut out.meta;
    if any_residual {
        meta.conversions.push(format!(
            "points with residual 0 read as filled; residual unit {}",
            shape.scale
        ));
    } else {
        meta.conversions
            .push("the file has no residuals: all points read as measured".to_string());
        for sample in samples.iter_mut().flatten() {
            if let MarkerSample::Filled(point) = *sample {
                *sample = MarkerSample::Measured(point);
            }
        }
    }
    if not_finite > 0 {
        meta.findings.push(
            Finding::of_kind(catalog::NOT_A_NUMBER, "points", About::Lengths)
                .with("count", Fact::count(not_finite)),
        );
    }
    let names = labels(parameters, shape.points, &mut meta.findings);
    let rows: Vec<u64> = (0..shape.frames).map(|i| shape.first_frame + i).collect();
    let t = rows
        .iter()
        .map(|&row| (row as f64 - 1.0) / shape.rate)
        .collect();
    out.timelines.push(Timeline {
        clock: format!("tracker frames at {} Hz", shape.rate),
        rows,
        t: Some(t),
        ..Timeline::default()
    });
    out.markers = names
        .into_iter()
        .zip(samples)
        .map(|(name, samples)| MarkerStream {
            unlabelled: name.starts_with('*'),
            name,
            body: None,
            timeline: 0,
            samples,
        })
        .collect();
    Ok(())
}
