//! Recordings as dictionaries of read-only arrays.

use std::path::PathBuf;

use calib_recording::{JointUnit, MarkerSample, ReadOptions, Recording};
use calib_report::Finding;
use nalgebra::Isometry3;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use crate::arrays::view;
use crate::error::raised;

/// Reads a file with the reader that is named, or with the one that recognizes it.
#[pyfunction]
#[pyo3(signature = (path, format))]
pub(crate) fn read<'py>(
    py: Python<'py>,
    path: PathBuf,
    format: Option<String>,
) -> PyResult<Bound<'py, PyDict>> {
    let options = ReadOptions {
        format,
        ..ReadOptions::default()
    };
    let read = py.detach(|| calib_recording::read_path(&path, &options));
    plain(py, &read.map_err(|e| raised(py, e))?)
}

/// Everything that a recording holds; a lost sample is NaN.
pub(crate) fn plain<'py>(py: Python<'py>, recording: &Recording) -> PyResult<Bound<'py, PyDict>> {
    let plain = PyDict::new(py);
    let meta = &recording.meta;
    plain.set_item("source", &meta.source)?;
    plain.set_item("format", &meta.format)?;
    plain.set_item("comments", &meta.comments)?;
    plain.set_item("conversions", &meta.conversions)?;
    plain.set_item("up_axis", &meta.up_axis)?;
    let findings: Vec<String> = meta.findings.iter().map(Finding::text).collect();
    plain.set_item("findings", findings)?;
    plain.set_item("timelines", timelines(py, recording)?)?;
    let numbers = |values: &[Option<f64>]| -> Vec<f64> {
        values.iter().map(|x| x.unwrap_or(f64::NAN)).collect()
    };
    let streams = PyList::empty(py);
    for s in &recording.joints {
        let unit = match s.unit {
            JointUnit::Angle => "rad",
            JointUnit::Length => "m",
        };
        let values = view(py, numbers(&s.q), [s.q.len()])?;
        streams.append(("joint", &s.name, s.timeline, unit, values, py.None()))?;
    }
    for s in &recording.torques {
        let values = view(py, numbers(&s.torque), [s.torque.len()])?;
        streams.append(("torque", &s.name, s.timeline, "N m", values, py.None()))?;
    }
    for s in &recording.temperatures {
        let values = view(py, numbers(&s.celsius), [s.celsius.len()])?;
        streams.append((
            "temperature",
            &s.name,
            s.timeline,
            "degC",
            values,
            py.None(),
        ))?;
    }
    for s in &recording.bodies {
        let n = s.tracker_from_body.len();
        let matrices: Vec<f64> = s.tracker_from_body.iter().flat_map(matrix).collect();
        let values = view(py, matrices, [n, 4, 4])?;
        streams.append(("body", &s.name, s.timeline, "m", values, py.None()))?;
    }
    for s in &recording.markers {
        let n = s.samples.len();
        let points: Vec<f64> = s.samples.iter().flat_map(point).collect();
        let filled = s
            .samples
            .iter()
            .map(|s| matches!(s, MarkerSample::Filled(_)));
        let filled = view(py, filled.collect(), [n])?;
        let values = view(py, points, [n, 3])?;
        streams.append(("marker", &s.name, s.timeline, "m", values, filled))?;
    }
    plain.set_item("streams", streams)?;
    Ok(plain)
}

/// Clock, row numbers, times and labels of each timeline.
fn timelines<'py>(py: Python<'py>, recording: &Recording) -> PyResult<Bound<'py, PyList>> {
    let all = PyList::empty(py);
    for timeline in &recording.timelines {
        let times = |t: &Option<Vec<f64>>| -> PyResult<Option<Bound<'py, PyAny>>> {
            let t = t.as_ref().map(|t| view(py, t.clone(), [t.len()]));
            t.transpose()
        };
        let one = PyDict::new(py);
        one.set_item("clock", &timeline.clock)?;
        let rows = timeline.rows.clone();
        one.set_item("rows", view(py, rows, [timeline.len()])?)?;
        one.set_item("t", times(&timeline.t)?)?;
        one.set_item("received", times(&timeline.received)?)?;
        one.set_item("labels", &timeline.labels)?;
        all.append(one)?;
    }
    Ok(all)
}

fn point(sample: &MarkerSample) -> [f64; 3] {
    match sample {
        MarkerSample::Lost => [f64::NAN; 3],
        MarkerSample::Measured(p) | MarkerSample::Filled(p) => [p.x, p.y, p.z],
    }
}

/// A homogeneous matrix by rows.
fn matrix(pose: &Option<Isometry3<f64>>) -> [f64; 16] {
    let Some(pose) = pose else {
        return [f64::NAN; 16];
    };
    let m = pose.to_homogeneous();
    std::array::from_fn(|k| m[(k / 4, k % 4)])
}
