//! What the frames of a C3D file look like: by its header and its parameters, which have to agree.

use super::parameters::Parameters;
use super::{BLOCK, Processor};
use crate::error::{At, Placed, Problem, excerpt};
use crate::model::{Meta, Recording};
use crate::units::LengthUnit;
use calib_finding::{Finding, Subject, catalog};

/// What the frames look like.
pub(super) struct Shape {
    pub processor: Processor,
    pub points: usize,
    /// Analog values per frame.
    pub analog: usize,
    pub first_frame: u64,
    pub frames: u64,
    /// `None`: float points.
    pub integer_scale: Option<f64>,
    /// |SCALE|, units of the residual.
    pub scale: f64,
    pub data_start: u64,
    pub rate: f64,
    pub units_per_meter: f64,
}

/// The header block with the parameters that complete it.
struct Header<'a> {
    bytes: &'a [u8; BLOCK as usize],
    parameters: &'a Parameters,
}

/// Reads header and parameters; notes units, encoding and axes in `out`. `length`: of the file.
pub(super) fn shape(
    bytes: &[u8; BLOCK as usize],
    parameters: &Parameters,
    length: u64,
    out: &mut Recording,
) -> Placed<Shape> {
    let header = Header { bytes, parameters };
    let points = header.points()?;
    let scale = header.scale()?;
    let rate = header.rate()?;
    let (first, last) = header.frames()?;
    let data_block = u64::from(header.word(9));
    let analog = usize::from(header.word(3));
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
    let unit = length_unit(parameters, &mut out.meta.findings)?;
    let kind = if scale < 0.0 { "float" } else { "integer" };
    describe(parameters, unit, kind, &mut out.meta);
    Ok(Shape {
        processor: parameters.processor,
        points,
        analog,
        first_frame: first,
        frames,
        integer_scale: (scale > 0.0).then_some(scale),
        scale: scale.abs(),
        data_start,
        rate,
        units_per_meter: unit.per_meter(),
    })
}

impl Header<'_> {
    /// The word at this position, counted from 1 as in the format's description.
    fn word(&self, index: usize) -> u16 {
        let at = 2 * index - 2;
        let processor = self.parameters.processor;
        processor.u16([self.bytes[at], self.bytes[at + 1]])
    }

    /// The float that begins at this word.
    fn float(&self, index: usize) -> f64 {
        let at = 2 * index - 2;
        let [a, b, c, d] = [0, 1, 2, 3].map(|i| self.bytes[at + i]);
        f64::from(self.parameters.processor.f32([a, b, c, d]))
    }

    /// Points per frame, at least one.
    fn points(&self) -> Placed<usize> {
        let points = usize::from(self.word(2));
        if let Some(used) = (self.parameters)
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
        Ok(points)
    }

    /// Units of an integer, below 0 for float points.
    fn scale(&self) -> Placed<f64> {
        let stated = self.parameters.number("POINT:SCALE");
        let scale = stated.unwrap_or_else(|| self.float(7));
        if !(scale.is_finite() && scale != 0.0) {
            let problem = Problem::Unexpected {
                found: scale.to_string(),
                expected: "a POINT:SCALE that is not zero".into(),
            };
            return Err((At::Byte(12), problem));
        }
        Ok(scale)
    }

    /// Frames per second.
    fn rate(&self) -> Placed<f64> {
        let rate = Some(self.float(11))
            .filter(|rate| *rate > 0.0 && rate.is_finite())
            .or_else(|| self.parameters.number("POINT:RATE"));
        rate.filter(|rate| *rate > 0.0).ok_or_else(|| {
            let problem = Problem::Unexpected {
                found: self.float(11).to_string(),
                expected: "a frame rate above 0".into(),
            };
            (At::Byte(20), problem)
        })
    }

    /// First and last frame. The header's frame numbers have 16 bits; TRIAL holds two words of a longer one.
    fn frames(&self) -> Placed<(u64, u64)> {
        let long = |name: &str| match self.parameters.numbers(name).as_slice() {
            [low, high, ..] => Some(*low as u64 + 65_536 * *high as u64),
            _ => None,
        };
        let (first, last) = match (
            long("TRIAL:ACTUAL_START_FIELD"),
            long("TRIAL:ACTUAL_END_FIELD"),
        ) {
            (Some(first), Some(last)) if last >= first => (first, last),
            _ => (u64::from(self.word(4)), u64::from(self.word(5))),
        };
        if last < first {
            let problem = Problem::Unexpected {
                found: format!("frames {first} to {last}"),
                expected: "the last frame not before the first".into(),
            };
            return Err((At::Byte(6), problem));
        }
        Ok((first, last))
    }
}

/// The unit of the points; millimeters with a finding where the file states none.
fn length_unit(parameters: &Parameters, findings: &mut Vec<Finding>) -> Placed<LengthUnit> {
    let text = parameters
        .texts("POINT:UNITS")
        .into_iter()
        .next()
        .unwrap_or_default();
    match LengthUnit::from_text(&text) {
        Some(unit) => Ok(unit),
        None if text.is_empty() => {
            let unit = Subject::column("POINT:UNITS");
            findings.push(Finding::new(catalog::UNIT_MISSING, unit));
            Ok(LengthUnit::Mm)
        }
        None => {
            let problem = Problem::Unexpected {
                found: excerpt(&text, 20),
                expected: "POINT:UNITS mm, cm or m".into(),
            };
            Err((At::Byte(0), problem))
        }
    }
}

/// Notes the unit, the encoding (`kind`: float or integer) and the axes of the screen.
fn describe(parameters: &Parameters, unit: LengthUnit, kind: &str, meta: &mut Meta) {
    meta.conversions
        .push(format!("lengths from {}", unit.name()));
    let processor = parameters.processor.name();
    meta.comments.push(format!("encoding: {processor} {kind}"));
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
}
