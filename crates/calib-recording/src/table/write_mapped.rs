//! A table with the columns of a map, which the map reads back as the same poses.
//!
//! The layout is the one that reading has: every slot of it says from which column and by which factor a number comes, so that what is
//! written is `value · factor`. What is written is read again, and refused where something else comes back.

use calib_finding::printable_line;
use std::collections::BTreeMap;
use std::fmt::Write;

use nalgebra::{Isometry3, Point3};

use super::header::{Column, Known, Layout, Rotation};
use super::write::{NotWritten, WriteOptions, columns, push_number, state_joints};
use crate::column_map::{ColumnMap, Delimiter, RotationColumns};
use crate::model::Filled;
use crate::poses::Poses;
use crate::readers::{ReadOptions, read_bytes};

/// The table as text, with the names, units and separators of a map; streams that the map does not mention have their canonical names.
/// Poses without times get one second each where the map names a column of time.
///
/// # Errors
/// [`NotWritten::Mapped`] where the map cannot read such a table, and those of [`write_poses`](super::write_poses).
pub fn write_mapped(
    poses: &Poses,
    map: &ColumnMap,
    options: &WriteOptions,
) -> Result<String, NotWritten> {
    let refused = |why: String| NotWritten::Mapped { why };
    let map = map
        .resolved()
        .ok_or_else(|| refused("its `preset` does not exist".to_owned()))?;
    if map.long.is_some() {
        let why = "with `long` it reads one row for every body or marker, and a table with one row for every posture is written";
        return Err(refused(why.to_owned()));
    }
    let names = match map.names.is_empty() {
        true => header(poses, &map, options),
        false => map.names.clone(),
    };
    let layout = Layout::new(
        1,
        names.clone(),
        (None, &[]),
        (Some(&map), Known::default()),
    );
    let layout = layout.map_err(|(_, problem)| refused(problem.to_string()))?;
    let separator = separator(&map).ok_or_else(|| {
        let why = "with `decimal_comma` a comma cannot separate the cells: give it `delimiter: semicolon`";
        refused(why.to_owned())
    })?;
    let clashes = |text: &str| {
        let special = text.contains([separator, '\n', '\r', '"']);
        special || text.trim() != text || (separator == ' ' && text.is_empty())
    };
    let texts = names.iter().chain(poses.labels.values().flatten());
    if let Some(text) = texts.into_iter().find(|text| clashes(text)) {
        return Err(NotWritten::Text { text: text.clone() });
    }
    let mut out = String::new();
    above(&mut out, &map, options);
    let separated = |cells: &[String]| cells.join(&separator.to_string());
    if map.names.is_empty() {
        let _ = writeln!(out, "{}", separated(&names));
    }
    let values = values(poses, &layout);
    for row in 0..poses.len() {
        let mut cells = Vec::new();
        for (i, column) in layout.columns.iter().enumerate() {
            cells.push(match column {
                Column::Label(k) => {
                    let texts = poses.labels.get(&layout.labels[*k]);
                    texts.map_or_else(String::new, |texts| texts[row].clone())
                }
                Column::Number { scale, .. } => {
                    let value = values.get(&i).and_then(|value| value(row));
                    number(value.map(|v| v * scale), &map, separator, options)
                }
                Column::Pose => row.to_string(),
                _ => number(None, &map, separator, options),
            });
        }
        let _ = writeln!(out, "{}", separated(&cells));
    }
    reads_back(poses, &map, &out)?;
    Ok(out)
}

/// What separates the cells; `None`: commas do, and decimals have them too.
fn separator(map: &ColumnMap) -> Option<char> {
    match (map.delimiter, map.decimal_comma) {
        (Some(Delimiter::Semicolon), _) => Some(';'),
        (Some(Delimiter::Tab), _) => Some('\t'),
        (Some(Delimiter::Space), _) => Some(' '),
        (Some(Delimiter::Comma) | None, false) => Some(','),
        // Without a header the reader takes commas.
        (None, true) if map.names.is_empty() => Some(';'),
        (Some(Delimiter::Comma) | None, true) => None,
    }
}

/// The names of the map's columns, and canonical ones of what it does not mention.
fn header(poses: &Poses, map: &ColumnMap, options: &WriteOptions) -> Vec<String> {
    let mut names: Vec<String> = map.time.iter().map(|time| time.column.clone()).collect();
    let of_joints = map.joints.values().chain(&map.joint_columns);
    let of_joints = of_joints.chain(map.prismatic.values());
    let of_robot = of_joints.chain(map.torques.values());
    names.extend(of_robot.chain(map.temperatures.values()).cloned());
    for body in map.bodies.values() {
        names.extend(body.position.iter().cloned());
        let turns = body.rotations().flat_map(RotationColumns::columns);
        names.extend(turns.cloned());
    }
    names.extend(map.markers.values().flatten().cloned());
    names.extend(map.labels.iter().cloned());
    let mut rest = poses.clone();
    if map.time.is_some() {
        rest.t = None;
    }
    let joint = |name: &String| {
        map.joints.contains_key(name)
            || map.prismatic.contains_key(name)
            || map.joint_columns.contains(name)
    };
    rest.joints.retain(|name, _| !joint(name));
    rest.torques
        .retain(|name, _| !map.torques.contains_key(name));
    let warm = |name: &String| map.temperatures.contains_key(name);
    rest.temperatures.retain(|name, _| !warm(name));
    rest.bodies.retain(|name, _| !map.bodies.contains_key(name));
    rest.markers
        .retain(|name, _| !map.markers.contains_key(name));
    let mut canonical = columns(&rest, options);
    state_joints(&rest, &mut canonical);
    let labels = rest.labels.keys().filter(|name| !map.labels.contains(name));
    names.extend(labels.cloned());
    names.extend(canonical.into_iter().map(|column| column.name));
    // A column may stand for several things.
    let mut seen = std::collections::BTreeSet::new();
    names.retain(|name| seen.insert(name.clone()));
    names
}

/// Lines above the table: as many as the map skips, else all comments where the reader knows them as such.
fn above(out: &mut String, map: &ColumnMap, options: &WriteOptions) {
    let comment = |k: usize| {
        let text = options.comments.get(k).map_or("", String::as_str);
        format!("# {}", printable_line(text))
    };
    let hash = map.time.iter().any(|time| time.column.starts_with('#'));
    let hash = hash || map.joint_columns.iter().any(|name| name.starts_with('#'));
    let count = match map.skip_lines {
        0 if hash => 0,
        0 => options.comments.len(),
        lines => usize::try_from(lines).unwrap_or(usize::MAX),
    };
    for k in 0..count {
        let _ = writeln!(out, "{}", comment(k).trim_end());
    }
}

/// SI values by the place of their column.
fn values<'a>(
    poses: &'a Poses,
    layout: &Layout,
) -> BTreeMap<usize, Box<dyn Fn(usize) -> Option<f64> + 'a>> {
    let mut all: BTreeMap<usize, Box<dyn Fn(usize) -> Option<f64> + 'a>> = BTreeMap::new();
    let mut put = |slot: usize, value: Box<dyn Fn(usize) -> Option<f64> + 'a>| {
        all.insert(layout.slots[slot].column, value);
    };
    let scalars = [
        (&poses.torques, &layout.torques),
        (&poses.temperatures, &layout.temperatures),
    ];
    for (name, _, slot) in &layout.joints {
        if let Some(q) = poses.joints.get(name) {
            put(*slot, Box::new(|row| q[row]));
        }
    }
    for (streams, of_layout) in scalars {
        for (name, slot) in of_layout {
            if let Some(stream) = streams.get(name) {
                put(*slot, Box::new(|row| stream[row]));
            }
        }
    }
    for plan in &layout.markers {
        if let Some(track) = poses.markers.get(&plan.name) {
            for (i, slot) in plan.slots.into_iter().enumerate() {
                put(slot, Box::new(move |row| track[row].map(|p| p[i])));
            }
        }
    }
    for plan in &layout.bodies {
        let Some(track) = poses.bodies.get(&plan.name) else {
            continue;
        };
        let inverted = plan.inverted;
        let written = move |pose: Isometry3<f64>| match inverted {
            true => pose.inverse(),
            false => pose,
        };
        for (i, slot) in plan.position.into_iter().enumerate() {
            let at = move |row: usize| Some(written(track[row]?).translation.vector[i]);
            put(slot, Box::new(at));
        }
        let form = plan.rotation;
        for (i, slot) in plan.rotation.slots().iter().enumerate() {
            let at = move |row: usize| {
                let rotation = written(track[row]?).rotation;
                Some(match form {
                    // q and −q are the same rotation: the scalar part is written ≥ 0.
                    Rotation::Quaternion(_) if rotation.w < 0.0 => -rotation.coords[i],
                    Rotation::Quaternion(_) => rotation.coords[i],
                    Rotation::Vector(_) => rotation.scaled_axis()[i],
                    // R = Rz(c) Ry(b) Rx(a)
                    Rotation::FixedXyz(_) => {
                        let (a, b, c) = rotation.euler_angles();
                        [a, b, c][i]
                    }
                    Rotation::Euler(axes, _) => axes.angles(&rotation)[i],
                    Rotation::Matrix(_) => rotation.to_rotation_matrix()[(i / 3, i % 3)],
                    Rotation::AxisAngle(_) if i == 3 => rotation.angle(),
                    Rotation::AxisAngle(_) => rotation.axis().map_or(0.0, |axis| axis[i]),
                })
            };
            put(*slot, Box::new(at));
        }
    }
    if let Some(slot) = layout.time {
        put(
            slot,
            match &poses.t {
                Some(t) => Box::new(|row| Some(t[row])),
                None => Box::new(|row| Some(row as f64)),
            },
        );
    }
    if let (Some(slot), Some(received)) = (layout.received, &poses.received) {
        put(slot, Box::new(|row| Some(received[row])));
    }
    if let Some(slot) = layout.counter {
        put(slot, Box::new(|row| Some(row as f64)));
    }
    all
}

/// A number as a cell; what is lost is empty, between blanks `NaN`.
fn number(value: Option<f64>, map: &ColumnMap, separator: char, options: &WriteOptions) -> String {
    // Quaternions and angles in radians need the most digits.
    let decimals = options.decimals.max(options.quaternion_decimals);
    let Some(value) = value.filter(|v| v.is_finite()) else {
        return if separator == ' ' { "NaN" } else { "" }.to_owned();
    };
    let mut text = String::new();
    push_number(&mut text, value, options.decimals.and(decimals));
    match map.decimal_comma {
        true => text.replace('.', ","),
        false => text,
    }
}

/// Whether reading gives the same poses: every stream, at every row.
fn reads_back(poses: &Poses, map: &ColumnMap, text: &str) -> Result<(), NotWritten> {
    let refused = |why: String| NotWritten::Mapped { why };
    let options = ReadOptions {
        columns: Some(map.clone()),
        ..ReadOptions::default()
    };
    let read = read_bytes("the table", text.as_bytes(), &options);
    let read = read.map_err(|error| refused(error.to_string()))?;
    let read = read.poses(Filled::Include)?;
    if read.len() != poses.len() {
        let (got, wrote) = (read.len(), poses.len());
        return Err(refused(format!("it reads {got} rows of {wrote}")));
    }
    let number = |a: &f64, b: &f64| (a - b).abs();
    let place = |a: &Point3<f64>, b: &Point3<f64>| (a - b).norm();
    let pose = |a: &Isometry3<f64>, b: &Isometry3<f64>| {
        let off = a.inverse() * b;
        off.translation.vector.norm().max(off.rotation.angle())
    };
    let other = differing(&poses.joints, &read.joints, number)
        .or_else(|| differing(&poses.torques, &read.torques, number))
        .or_else(|| differing(&poses.temperatures, &read.temperatures, number))
        .or_else(|| differing(&poses.markers, &read.markers, place))
        .or_else(|| differing(&poses.bodies, &read.bodies, pose));
    match other {
        Some(name) => Err(NotWritten::Misread { name }),
        None => Ok(()),
    }
}

/// The first stream that does not come back, by how far values lie from each other.
fn differing<T>(
    own: &BTreeMap<String, Vec<Option<T>>>,
    read: &BTreeMap<String, Vec<Option<T>>>,
    off: impl Fn(&T, &T) -> f64,
) -> Option<String> {
    /// Written decimals round by less than this: m, rad, N·m and °C.
    const ROUNDED: f64 = 1e-5;
    let same = |(a, b): (&Option<T>, &Option<T>)| match (a, b) {
        (Some(a), Some(b)) => off(a, b) < ROUNDED,
        (a, b) => a.is_none() && b.is_none(),
    };
    let comes_back = |name: &String, own: &[Option<T>]| {
        let read = read.get(name);
        read.is_some_and(|read| own.iter().zip(read).all(same))
    };
    let lost = own.iter().find(|(name, own)| !comes_back(name, own));
    lost.map(|(name, _)| name.clone())
}
