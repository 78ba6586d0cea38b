//! The canonical table, always the same bytes for the same poses.

use super::header::{JOINT, Known, Layout, reads_as_joint};
use crate::column_map::ColumnMap;
use crate::model::{self, JointUnit, MarkerSample, Recording, Timeline, WHOLE_ROBOT};
use crate::poses::{NotOneTable, Poses};
use calib_finding::printable_line;
use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;

/// How the table is written.
#[derive(Clone, Debug, PartialEq)]
pub struct WriteOptions {
    /// Lines above the header, without `#`.
    pub comments: Vec<String>,
    /// Decimals of everything but quaternions; `None` = the shortest text that reads back as the same number.
    pub decimals: Option<usize>,
    /// Decimals of quaternions. Nine keep the direction to 1e-9 rad; `None` = shortest exact text.
    pub quaternion_decimals: Option<usize>,
    /// Angles in degrees instead of radians.
    pub degrees: bool,
    /// First column `pose`, counting rows from 0 (only for tables without time).
    pub count: bool,
}

impl Default for WriteOptions {
    /// Exact texts, radians, with a counter.
    fn default() -> Self {
        WriteOptions {
            comments: Vec::new(),
            decimals: None,
            quaternion_decimals: None,
            degrees: false,
            count: true,
        }
    }
}

impl WriteOptions {
    /// Micrometers, microradians, and 1e-9 in quaternions: far below any tracker, a third of the bytes.
    pub fn micro() -> Self {
        WriteOptions {
            decimals: Some(6),
            quaternion_decimals: Some(9),
            ..WriteOptions::default()
        }
    }
}

/// Why a table cannot be written so that it reads back.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum NotWritten {
    /// A name or text would break the table.
    #[error("`{text}` contains a comma or line break and cannot stand in a table")]
    Text {
        /// The text.
        text: String,
    },
    /// A name that our own rules would read as something else, such as joints `a_x`, `a_y`, `a_z` (a marker).
    #[error("`{name}` would be read back as something else; rename it")]
    Misread {
        /// The name.
        name: String,
    },
    /// A column map that cannot read a table of one row for every posture.
    #[error("the profile's `columns` do not read such a table: {why}")]
    Mapped {
        /// Why.
        why: String,
    },
    /// Two streams of one name.
    #[error(transparent)]
    NotOneTable(#[from] NotOneTable),
    /// A NaN or infinity.
    #[error("`{column}`, row {row}: {value} is not finite")]
    NotFinite {
        /// Column without unit.
        column: String,
        /// Row from 0.
        row: usize,
        /// The number.
        value: f64,
    },
    /// A vector that is not as long as the table.
    #[error("`{column}` has {found} samples, the table has {expected} rows")]
    Length {
        /// Column without unit.
        column: String,
        /// Its length.
        found: usize,
        /// Rows.
        expected: usize,
    },
}

/// Rows of a marker that are interpolated.
type Filled = BTreeMap<String, Vec<bool>>;

/// One output column.
pub(super) struct OutColumn<'a> {
    pub name: String,
    decimals: Option<usize>,
    value: Box<dyn Fn(usize) -> Option<f64> + 'a>,
}

/// The table as text: counter, labels, `t_s`, `host_s`, joints, torques, temperatures, bodies, markers, each in alphabetical order. A label
/// column of another name than the usual ones (`trial`, `group`, …) must be named when the table is read, in
/// [`ColumnMap::labels`].
///
/// # Errors
/// [`NotWritten`] when the text would not read back as the same table.
pub fn write_poses(poses: &Poses, options: &WriteOptions) -> Result<String, NotWritten> {
    write(poses, &BTreeMap::new(), options)
}

/// One table per timeline: its clock and its text. Interpolated samples are marked in a column `<marker>.state`;
/// qualities and covariances are not written.
///
/// # Errors
/// [`NotWritten`] as [`write_poses`], and for two streams of one name.
pub fn write_recording(
    recording: &Recording,
    options: &WriteOptions,
) -> Result<Vec<(String, String)>, NotWritten> {
    let table = |(index, timeline): (usize, &Timeline)| {
        let poses = recording.poses_of(index, model::Filled::Include)?;
        let is_filled = |sample: &MarkerSample| matches!(sample, MarkerSample::Filled(_));
        let filled: Filled = recording
            .markers
            .iter()
            .filter(|marker| marker.timeline == index && marker.samples.iter().any(is_filled))
            .map(|marker| {
                (
                    marker.name.clone(),
                    marker.samples.iter().map(is_filled).collect(),
                )
            })
            .collect();
        Ok((timeline.clock.clone(), write(&poses, &filled, options)?))
    };
    recording.timelines.iter().enumerate().map(table).collect()
}

fn write(poses: &Poses, filled: &Filled, options: &WriteOptions) -> Result<String, NotWritten> {
    check_lengths(poses)?;
    let mut columns = columns(poses, options);
    if misread(poses, &header(poses, filled, options, &columns).0).is_some() {
        state_joints(poses, &mut columns);
    }
    let mut out = String::new();
    for comment in &options.comments {
        let one_line = printable_line(comment);
        let _ = writeln!(out, "# {one_line}");
    }
    let (header, count) = header(poses, filled, options, &columns);
    for text in header
        .iter()
        .map(String::as_str)
        .chain(poses.labels.values().flatten().map(String::as_str))
    {
        if text.contains([',', ';', '\t', '\n', '\r'])
            || text.starts_with('#')
            || text.trim() != text
        {
            return Err(NotWritten::Text {
                text: text.to_string(),
            });
        }
    }
    if let Some(name) = misread(poses, &header) {
        return Err(NotWritten::Misread { name });
    }
    let header: Vec<Cow<'_, str>> = header.iter().map(|name| cell(name)).collect();
    let _ = writeln!(out, "{}", header.join(","));
    for row in 0..poses.len() {
        let mut first = true;
        let mut separate = |out: &mut String| {
            if !std::mem::take(&mut first) {
                out.push(',');
            }
        };
        if count {
            separate(&mut out);
            let _ = write!(out, "{row}");
        }
        for texts in poses.labels.values() {
            separate(&mut out);
            out.push_str(&cell(&texts[row]));
        }
        for column in &columns {
            separate(&mut out);
            if let Some(value) = (column.value)(row) {
                if !value.is_finite() {
                    return Err(NotWritten::NotFinite {
                        column: column.name.clone(),
                        row,
                        value,
                    });
                }
                push_number(&mut out, value, column.decimals);
            }
        }
        for rows in filled.values() {
            separate(&mut out);
            out.push_str(if rows[row] { "filled" } else { "" });
        }
        out.push('\n');
    }
    Ok(out)
}

/// The names of all columns, and whether the first one counts the rows.
fn header(
    poses: &Poses,
    filled: &Filled,
    options: &WriteOptions,
    columns: &[OutColumn<'_>],
) -> (Vec<String>, bool) {
    // A table of one column needs the counter: a row in which it is lost would be a blank line.
    let one_column = columns.len() + poses.labels.len() < 2;
    let count = (options.count || one_column) && poses.t.is_none();
    let mut header: Vec<String> = Vec::new();
    if count {
        header.push("pose".to_owned());
    }
    header.extend(poses.labels.keys().cloned());
    header.extend(columns.iter().map(|column| column.name.clone()));
    header.extend(filled.keys().map(|marker| format!("{marker}.state")));
    (header, count)
}

/// The column of a joint with the unit at the end of its name, so that it reads as the joint's.
#[must_use]
pub fn joint_column(joint: &str, unit: &str) -> String {
    let name = format!("{joint}_{unit}");
    match reads_as_joint(&name, joint) {
        true => name,
        false => format!("{JOINT}{name}"),
    }
}

/// States which columns are joints, where their names alone say something else.
pub(super) fn state_joints(poses: &Poses, columns: &mut [OutColumn<'_>]) {
    for column in columns {
        let name = column.name.rsplit_once('_').map(|(joint, _)| joint);
        let torque = column.name.strip_suffix("_nm");
        if torque.is_some_and(|joint| poses.torques.contains_key(joint)) {
            continue;
        }
        let of_joint = name.filter(|joint| poses.joints.contains_key(*joint));
        if of_joint.is_some_and(|joint| !reads_as_joint(&column.name, joint)) {
            column.name.insert_str(0, JOINT);
        }
    }
}

pub(super) fn columns<'a>(poses: &'a Poses, options: &WriteOptions) -> Vec<OutColumn<'a>> {
    let decimals = options.decimals;
    let mut columns: Vec<OutColumn<'a>> = Vec::new();
    if let Some(t) = &poses.t {
        columns.push(OutColumn {
            name: "t_s".to_string(),
            decimals,
            value: Box::new(|row| Some(t[row])),
        });
    }
    if let Some(received) = &poses.received {
        columns.push(OutColumn {
            name: "host_s".to_string(),
            decimals,
            value: Box::new(|row| Some(received[row])),
        });
    }
    for (name, q) in &poses.joints {
        let angle = poses.joint_units.get(name) != Some(&JointUnit::Length);
        let (unit, factor) = match (angle, options.degrees) {
            (true, true) => ("deg", 180.0 / std::f64::consts::PI),
            (true, false) => ("rad", 1.0),
            (false, _) => ("m", 1.0),
        };
        let value = move |row: usize| q[row].map(|q| q * factor);
        columns.push(OutColumn {
            name: format!("{name}_{unit}"),
            decimals,
            value: Box::new(value),
        });
    }
    for (name, torque) in &poses.torques {
        columns.push(OutColumn {
            name: format!("{name}_nm"),
            decimals,
            value: Box::new(|row| torque[row]),
        });
    }
    for (name, celsius) in &poses.temperatures {
        columns.push(OutColumn {
            name: match name.as_str() {
                WHOLE_ROBOT => "temperature_c".to_owned(),
                joint => format!("{joint}_temperature_c"),
            },
            decimals,
            value: Box::new(|row| celsius[row]),
        });
    }
    for (name, track) in &poses.bodies {
        for (i, axis) in ["x_m", "y_m", "z_m"].into_iter().enumerate() {
            let value = move |row: usize| track[row].map(|pose| pose.translation.vector[i]);
            columns.push(OutColumn {
                name: format!("{name}.{axis}"),
                decimals,
                value: Box::new(value),
            });
        }
        for (i, part) in ["qx", "qy", "qz", "qw"].into_iter().enumerate() {
            // coords is (x, y, z, w); q and −q are the same rotation: the scalar part is written ≥ 0.
            let value = move |row: usize| {
                track[row].map(|pose| {
                    let q = pose.rotation.coords;
                    let leading = [3, 0, 1, 2]
                        .map(|k| q[k])
                        .into_iter()
                        .find(|&c| c != 0.0)
                        .unwrap_or(1.0);
                    if leading < 0.0 { -q[i] } else { q[i] }
                })
            };
            columns.push(OutColumn {
                name: format!("{name}.{part}"),
                decimals: options.quaternion_decimals,
                value: Box::new(value),
            });
        }
    }
    for (name, points) in &poses.markers {
        for (i, axis) in ["x_m", "y_m", "z_m"].into_iter().enumerate() {
            let value = move |row: usize| points[row].map(|point| point[i]);
            columns.push(OutColumn {
                name: format!("{name}.{axis}"),
                decimals,
                value: Box::new(value),
            });
        }
    }
    columns
}

/// The first name that the header does not give back.
fn misread(poses: &Poses, header: &[String]) -> Option<String> {
    let names = header.to_vec();
    // A label of any name is read where the profile or a column map names it.
    let map = ColumnMap {
        labels: poses.labels.keys().cloned().collect(),
        ..ColumnMap::default()
    };
    let layout = match Layout::new(1, names, (None, &[]), (Some(&map), Known::default())) {
        Ok(layout) => layout,
        Err((_, problem)) => return Some(problem.to_string()),
    };
    let all = [
        (
            poses.joints.keys().collect::<Vec<_>>(),
            layout
                .joints
                .iter()
                .map(|joint| &joint.0)
                .collect::<BTreeSet<_>>(),
        ),
        (
            poses.torques.keys().collect(),
            layout.torques.iter().map(|torque| &torque.0).collect(),
        ),
        (
            poses.temperatures.keys().collect(),
            layout.temperatures.iter().map(|t| &t.0).collect(),
        ),
        (
            poses.bodies.keys().collect(),
            layout.bodies.iter().map(|body| &body.name).collect(),
        ),
        (
            poses.markers.keys().collect(),
            layout.markers.iter().map(|marker| &marker.name).collect(),
        ),
        (
            poses.labels.keys().collect(),
            layout.labels.iter().collect(),
        ),
    ];
    let lost = all
        .iter()
        .find_map(|(wanted, read)| wanted.iter().find(|name| !read.contains(**name)));
    lost.map(|name| String::clone(name))
}

/// A name as a cell: no formula, and in quotes where it has one itself.
fn cell(name: &str) -> Cow<'_, str> {
    let cell = calib_finding::cell(name);
    match cell.contains('"') {
        true => Cow::Owned(format!("\"{}\"", cell.replace('"', "\"\""))),
        false => cell,
    }
}

/// Shortest exact text, or fixed decimals without trailing zeros; never `-0`.
pub(super) fn push_number(out: &mut String, value: f64, decimals: Option<usize>) {
    let value = if value == 0.0 { 0.0 } else { value };
    let Some(decimals) = decimals else {
        let _ = write!(out, "{value}");
        return;
    };
    let start = out.len();
    let _ = write!(out, "{value:.decimals$}");
    if decimals > 0 {
        while out.ends_with('0') {
            out.pop();
        }
        if out.ends_with('.') {
            out.pop();
        }
    }
    if &out[start..] == "-0" {
        out.truncate(start);
        out.push('0');
    }
}

fn check_lengths(poses: &Poses) -> Result<(), NotWritten> {
    let n = poses.len();
    let lengths = poses
        .joints
        .iter()
        .map(|(name, v)| (name, v.len()))
        .chain(poses.torques.iter().map(|(name, v)| (name, v.len())))
        .chain(poses.temperatures.iter().map(|(name, v)| (name, v.len())))
        .chain(poses.bodies.iter().map(|(name, v)| (name, v.len())))
        .chain(poses.markers.iter().map(|(name, v)| (name, v.len())))
        .chain(poses.labels.iter().map(|(name, v)| (name, v.len())));
    for (column, found) in lengths {
        if found != n {
            return Err(NotWritten::Length {
                column: column.clone(),
                found,
                expected: n,
            });
        }
    }
    for (column, clock) in [("t_s", &poses.t), ("host_s", &poses.received)] {
        if let Some(found) = clock.as_ref().map(Vec::len).filter(|&found| found != n) {
            return Err(NotWritten::Length {
                column: column.to_string(),
                found,
                expected: n,
            });
        }
    }
    Ok(())
}
