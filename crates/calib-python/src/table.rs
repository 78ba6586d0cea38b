//! Tables of one timeline: from dictionaries of arrays, and as recordings.

use std::collections::BTreeMap;

use calib_geometry::so3;
use calib_recording::{
    BodyStream, JointStream, JointUnit, MarkerSample, MarkerStream, Meta, Poses, Recording,
    TemperatureStream, Timeline, TorqueStream,
};
use nalgebra::{Isometry3, Matrix3, Point3, Translation3, Vector3};
use numpy::PyReadonlyArrayDyn;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::slice;
use crate::error::misused;

/// How far a matrix of a pose may be from a rotation: what `float32` leaves.
const NOT_A_ROTATION: f64 = 1e-5;

/// The table that a dictionary of arrays holds: `joints`, `lengths`, `torques` (n), `markers` (n × 3), `bodies` (n × 4 × 4), and what its
/// rows are called: `rows`, `t`, `labels`. A row of NaN is a lost sample.
pub(crate) fn poses(given: &Bound<'_, PyDict>) -> PyResult<Poses> {
    let py = given.py();
    let mut table = Poses::default();
    let mut rows: Option<(String, usize)> = None;
    let mut same = |name: &str, n: usize| match &rows {
        Some((first, m)) if *m != n => Err(misused(
            py,
            &format!("{name} has {n} rows, {first} has {m}; every array has one row for each pose"),
        )),
        _ => {
            rows = Some((name.to_owned(), n));
            Ok(())
        }
    };
    for (name, numbers) in columns(given, "joints", 1)? {
        same(&name, numbers.len())?;
        table.joint_units.insert(name.clone(), JointUnit::Angle);
        table.joints.insert(name, seen(&numbers));
    }
    for (name, numbers) in columns(given, "lengths", 1)? {
        same(&name, numbers.len())?;
        table.joint_units.insert(name.clone(), JointUnit::Length);
        table.joints.insert(name, seen(&numbers));
    }
    for (name, numbers) in columns(given, "torques", 1)? {
        same(&name, numbers.len())?;
        table.torques.insert(name, seen(&numbers));
    }
    for (name, numbers) in columns(given, "temperatures", 1)? {
        same(&name, numbers.len())?;
        table.temperatures.insert(name, seen(&numbers));
    }
    for (name, numbers) in columns(given, "markers", 3)? {
        same(&name, numbers.len() / 3)?;
        let points = numbers.chunks_exact(3);
        let point = |p: &[f64]| finite(p).then(|| Point3::new(p[0], p[1], p[2]));
        table.markers.insert(name, points.map(point).collect());
    }
    for (name, numbers) in columns(given, "bodies", 16)? {
        same(&name, numbers.len() / 16)?;
        let matrices = numbers.chunks_exact(16).enumerate();
        let read = matrices.map(|(row, m)| pose(py, &name, row, m));
        table
            .bodies
            .insert(name.clone(), read.collect::<PyResult<_>>()?);
    }
    let n = rows.map_or(0, |(_, n)| n);
    table.rows = match of(given, "rows")? {
        Some(rows) => rows.extract()?,
        None => (0..n as u64).collect(),
    };
    table.t = of(given, "t")?.map(|t| t.extract()).transpose()?;
    table.labels = match of(given, "labels")? {
        Some(labels) => labels.extract()?,
        None => BTreeMap::new(),
    };
    let lengths = [Some(table.rows.len()), table.t.as_ref().map(Vec::len)];
    let labels = table.labels.values().map(|l| Some(l.len()));
    if let Some(wrong) = lengths
        .into_iter()
        .chain(labels)
        .flatten()
        .find(|m| *m != n)
    {
        let text = format!("{wrong} times, row numbers or labels for {n} rows");
        return Err(misused(py, &text));
    }
    Ok(table)
}

/// A value that is given and not `None`.
fn of<'py>(given: &Bound<'py, PyDict>, key: &str) -> PyResult<Option<Bound<'py, PyAny>>> {
    Ok(given.get_item(key)?.filter(|value| !value.is_none()))
}

/// Name and numbers of every array below a key, `width` numbers a row.
fn columns(
    given: &Bound<'_, PyDict>,
    key: &str,
    width: usize,
) -> PyResult<Vec<(String, Vec<f64>)>> {
    let py = given.py();
    let Some(arrays) = of(given, key)? else {
        return Ok(Vec::new());
    };
    let arrays: BTreeMap<String, PyReadonlyArrayDyn<'_, f64>> = arrays.extract()?;
    let one = |(name, array): (String, PyReadonlyArrayDyn<'_, f64>)| {
        let numbers = slice(py, &name, &array)?.to_vec();
        if numbers.len() % width != 0 {
            let text = format!("{name}: {} numbers are not rows of {width}", numbers.len());
            return Err(misused(py, &text));
        }
        Ok((name, numbers))
    };
    arrays.into_iter().map(one).collect()
}

fn finite(numbers: &[f64]) -> bool {
    numbers.iter().all(|x| x.is_finite())
}

fn seen(numbers: &[f64]) -> Vec<Option<f64>> {
    let number = |x: &f64| x.is_finite().then_some(*x);
    numbers.iter().map(number).collect()
}

/// A homogeneous matrix by rows; `None` where one of its numbers is NaN.
fn pose(py: Python<'_>, name: &str, row: usize, m: &[f64]) -> PyResult<Option<Isometry3<f64>>> {
    if !finite(m) {
        return Ok(None);
    }
    let r = Matrix3::from_fn(|i, k| m[4 * i + k]);
    let rotation = so3::check_rotation(&r, NOT_A_ROTATION).map_err(|_| {
        let text = format!("{name}, row {row}: the upper left 3 × 3 numbers are not a rotation");
        misused(py, &text)
    })?;
    let t = Translation3::from(Vector3::new(m[3], m[7], m[11]));
    Ok(Some(Isometry3::from_parts(t, rotation)))
}

/// A table as a recording with one timeline.
pub(crate) fn as_recording(table: Poses, source: &str, format: &str) -> Recording {
    let joints = table.joints.into_iter().map(|(name, q)| JointStream {
        unit: table
            .joint_units
            .get(&name)
            .copied()
            .unwrap_or(JointUnit::Angle),
        name,
        timeline: 0,
        q,
    });
    let sample = |p: Option<Point3<f64>>| p.map_or(MarkerSample::Lost, MarkerSample::Measured);
    Recording {
        meta: Meta {
            source: source.to_owned(),
            format: format.to_owned(),
            ..Meta::default()
        },
        joints: joints.collect(),
        torques: (table.torques.into_iter())
            .map(|(name, torque)| TorqueStream {
                name,
                timeline: 0,
                torque,
            })
            .collect(),
        temperatures: (table.temperatures.into_iter())
            .map(|(name, celsius)| TemperatureStream {
                name,
                timeline: 0,
                celsius,
            })
            .collect(),
        bodies: (table.bodies.into_iter())
            .map(|(name, tracker_from_body)| BodyStream {
                name,
                timeline: 0,
                tracker_from_body,
                quality: Vec::new(),
                covariance: Vec::new(),
            })
            .collect(),
        markers: (table.markers.into_iter())
            .map(|(name, track)| MarkerStream {
                name,
                body: None,
                unlabeled: false,
                timeline: 0,
                samples: track.into_iter().map(sample).collect(),
            })
            .collect(),
        timelines: vec![Timeline {
            clock: format.to_owned(),
            rows: table.rows,
            t: table.t,
            received: table.received,
            labels: table.labels,
        }],
    }
}
