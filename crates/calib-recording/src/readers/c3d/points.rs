//! The points of a C3D file, frame by frame.

use super::parameters::Parameters;
use super::shape::Shape;
use crate::error::{At, Placed, Problem};
use crate::model::{MarkerSample, MarkerStream, Recording, Timeline};
use crate::readers::Input;
use crate::readers::common::unique_names;
use calib_finding::{About, Fact, Finding, catalog};
use nalgebra::Point3;
use std::io::{BufReader, Read, SeekFrom};

/// Names of the points, `point_N` where the file has none.
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

/// Samples of all points, and what the file knows about them.
struct Points {
    /// One stream per point.
    samples: Vec<Vec<MarkerSample>>,
    any_residual: bool,
    /// How many samples were lost because a coordinate is not finite.
    not_finite: usize,
}

/// Reads all frames into `out`.
pub(super) fn read(
    input: &mut dyn Input,
    shape: &Shape,
    parameters: &Parameters,
    out: &mut Recording,
) -> Placed<()> {
    let mut points = read_frames(input, shape)?;
    let meta = &mut out.meta;
    if points.any_residual {
        meta.conversions.push(format!(
            "points with residual 0 read as filled; residual unit {}",
            shape.scale
        ));
    } else {
        meta.conversions
            .push("the file has no residuals: all points read as measured".to_string());
        for sample in points.samples.iter_mut().flatten() {
            if let MarkerSample::Filled(point) = *sample {
                *sample = MarkerSample::Measured(point);
            }
        }
    }
    if points.not_finite > 0 {
        meta.findings.push(
            Finding::of_kind(catalog::NOT_A_NUMBER, "points", About::Lengths)
                .with("count", Fact::count(points.not_finite)),
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
        .zip(points.samples)
        .map(|(name, samples)| MarkerStream {
            unlabeled: name.starts_with('*'),
            name,
            body: None,
            timeline: 0,
            samples,
        })
        .collect();
    Ok(())
}

fn read_frames(input: &mut dyn Input, shape: &Shape) -> Placed<Points> {
    let io = |source| (At::File, Problem::Io(source));
    input.seek(SeekFrom::Start(shape.data_start)).map_err(io)?;
    let value_bytes = if shape.integer_scale.is_some() { 2 } else { 4 };
    let frame_bytes = (4 * shape.points + shape.analog) * value_bytes;
    let count = usize::try_from(shape.frames).unwrap_or(usize::MAX);
    let mut points = Points {
        // The file is at least this long (checked), so this is no more than three times its size.
        samples: (0..shape.points)
            .map(|_| Vec::with_capacity(count))
            .collect(),
        any_residual: false,
        not_finite: 0,
    };
    let mut frame = vec![0u8; frame_bytes];
    let mut reader = BufReader::with_capacity(1 << 18, input);
    for _ in 0..count {
        reader.read_exact(&mut frame).map_err(io)?;
        for (i, stream) in points.samples.iter_mut().enumerate() {
            let bytes = &frame[4 * i * value_bytes..4 * (i + 1) * value_bytes];
            let (xyz, w) = shape.point(bytes);
            stream.push(if w < 0 {
                MarkerSample::Lost
            } else if !xyz.iter().all(|value| value.is_finite()) {
                points.not_finite += 1;
                MarkerSample::Lost
            } else {
                let point = Point3::from(xyz.map(|value| value / shape.units_per_meter));
                points.any_residual |= w & 0xff != 0;
                if w & 0xff == 0 {
                    MarkerSample::Filled(point)
                } else {
                    MarkerSample::Measured(point)
                }
            });
        }
    }
    Ok(points)
}

impl Shape {
    /// Coordinates in the file's unit, and the word with the residual.
    #[inline]
    fn point(&self, bytes: &[u8]) -> ([f64; 3], i32) {
        let processor = self.processor;
        match self.integer_scale {
            Some(scale) => {
                let value = |k: usize| processor.u16([bytes[2 * k], bytes[2 * k + 1]]) as i16;
                let xyz = [0, 1, 2].map(|k| f64::from(value(k)) * scale);
                (xyz, i32::from(value(3)))
            }
            None => {
                let value = |k: usize| {
                    processor.f32([
                        bytes[4 * k],
                        bytes[4 * k + 1],
                        bytes[4 * k + 2],
                        bytes[4 * k + 3],
                    ])
                };
                ([0, 1, 2].map(|k| f64::from(value(k))), value(3) as i32)
            }
        }
    }
}
