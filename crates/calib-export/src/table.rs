//! Tables of joint positions: in, with their lines; out, as CSV.

use std::collections::BTreeMap;
use std::path::Path;

use calib_model::{Model, Place, Pose};
use calib_recording::{
    ColumnMap, Filled, JointUnit, Poses, Problem, ReadOptions, Recording, WHOLE_ROBOT, read_path,
};
use nalgebra::Point3;

use crate::error::ExportError;
use crate::read::Robot;

/// First column of a corrected program.
const LINE: &str = "line";

/// Columns beside the joints of a corrected program; the first is before them.
pub(crate) const NOTES: [&str; 6] = [
    LINE,
    "outcome",
    "before_mm",
    "after_mm",
    "before_mrad",
    "after_mrad",
];

/// Joint positions by row, in the order of [`Model::joints`].
#[derive(Debug, Clone, Default)]
pub(crate) struct Program {
    /// Name of the file, for messages.
    pub file: String,
    /// Line of each row, from 1.
    pub lines: Vec<u64>,
    /// rad or m; `None` where a joint of the row was lost.
    pub q: Vec<Option<Vec<f64>>>,
    /// Torques that the joints hold, N m or N; empty where the table has none.
    pub held: Vec<Option<Vec<f64>>>,
    /// Temperatures of the links before joints, °C; empty where the table has none.
    pub temperature_c: Vec<Vec<f64>>,
    /// Poses that the table has, by name and row.
    pub poses: BTreeMap<String, Vec<Option<Pose>>>,
    /// Positions without an orientation that the table has, by name and row, m.
    pub points: BTreeMap<String, Vec<Option<Point3<f64>>>>,
    /// Joints of the robot that the table has no column for: they count as 0.
    pub absent: Vec<String>,
}

impl Program {
    /// Of a row; empty where the table has none.
    pub(crate) fn temperature_c(&self, row: usize) -> &[f64] {
        self.temperature_c.get(row).map_or(&[], Vec::as_slice)
    }

    /// The reference temperature, °C, where the robot grows and the table does not say how warm it is.
    pub(crate) fn assumed_temperature_c(&self, model: &Model) -> Option<f64> {
        let unknown = self.temperature_c.is_empty() && model.grows();
        unknown.then(|| model.reference_temperature_c())
    }
}

/// How a table is written that follows a recording of a profile.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct WrittenLike {
    /// Column maps: the first by which it can be read.
    pub columns: Vec<ColumnMap>,
    /// Joints that it does not list and that stand still, rad or m.
    pub held: BTreeMap<String, f64>,
}

impl WrittenLike {
    /// Each map, and each with its joints alone: a program has neither markers nor times. None where the columns have our own names.
    fn maps(&self) -> Vec<Option<ColumnMap>> {
        let joints_alone = |map: &ColumnMap| ColumnMap {
            time: None,
            markers: BTreeMap::new(),
            bodies: BTreeMap::new(),
            long: None,
            labels: Vec::new(),
            ..map.clone()
        };
        let whole = self.columns.iter().cloned();
        let maps: Vec<_> = whole
            .chain(self.columns.iter().map(joints_alone))
            .map(Some)
            .collect();
        if maps.is_empty() { vec![None] } else { maps }
    }
}

/// Reads a table of joint positions in any format that `calib` reads.
pub(crate) fn program(
    path: &Path,
    robot: &Robot,
    like: &WrittenLike,
) -> Result<Program, ExportError> {
    let file = path.display().to_string();
    let model = &robot.model;
    // Columns `x_mm`, `y_mm` and `z_mm` are those of a gantry's joints of these names.
    let options = ReadOptions {
        joints: model.joints().iter().map(|j| j.name.clone()).collect(),
        of_robot: true,
        remarks: true,
        ..ReadOptions::default()
    };
    let recording = read_by_one(path, &options, like).or_else(|error| match *error.problem {
        // What `calib correct` wrote has its notes beside the joints.
        Problem::UnknownColumn { ref name, .. } if name == LINE => {
            let notes = NOTES.iter().map(|note| (*note).to_owned());
            let columns = ColumnMap {
                labels: notes.collect(),
                ..ColumnMap::default()
            };
            let noted = ReadOptions {
                columns: Some(columns),
                ..options
            };
            read_path(path, &noted).map_err(|_| error)
        }
        _ => Err(error),
    })?;
    let mut poses =
        recording
            .poses(Filled::Include)
            .map_err(|source| ExportError::NotOneTable {
                file: file.clone(),
                source,
            })?;
    let n = poses.rows.len();
    // Of joints that follow others the model knows where they are, and a map may name more than the robot has.
    let follows = |name: &String| {
        let mut all = robot.file.joints.iter();
        all.any(|j| j.name == *name && j.mimic.is_some())
    };
    let own = |name: &String| model.joints().iter().any(|j| j.name == *name);
    let is_used = |name: &String| own(name) || like.columns.is_empty() && !follows(name);
    poses.joints.retain(|name, _| is_used(name));
    poses.joint_units.retain(|name, _| is_used(name));
    fits(&file, &poses, model)?;
    let column = |name: &str| poses.joints.get(name);
    let row = |k: usize| -> Option<Vec<f64>> {
        let joints = model.joints().iter();
        joints
            .map(|j| match column(&j.name) {
                Some(column) => column[k],
                None => Some(like.held.get(&j.name).copied().unwrap_or(0.0)),
            })
            .collect()
    };
    let torques = |k: usize| -> Option<Vec<f64>> {
        let joints = model.joints().iter();
        joints
            .map(|j| poses.torques.get(&j.name).map_or(Some(0.0), |c| c[k]))
            .collect()
    };
    let with_torques = !poses.torques.is_empty();
    let is_absent = |name: &str| column(name).is_none() && !like.held.contains_key(name);
    let absent = model.joints().iter().filter(|j| is_absent(&j.name));
    Ok(Program {
        q: (0..n).map(row).collect(),
        held: if with_torques {
            (0..n).map(torques).collect()
        } else {
            Vec::new()
        },
        temperature_c: temperatures(&poses, model),
        absent: absent.map(|j| j.name.clone()).collect(),
        poses: poses
            .bodies
            .iter()
            .map(|(name, rows)| {
                let rows = rows.iter().map(|p| p.as_ref().map(Pose::of));
                (name.clone(), rows.collect())
            })
            .collect(),
        points: poses.markers,
        lines: poses.rows,
        file,
    })
}

/// The table by the first map by which it can be read; else why not by the first one.
fn read_by_one(
    path: &Path,
    options: &ReadOptions,
    like: &WrittenLike,
) -> Result<Recording, calib_recording::Error> {
    let mut first = None;
    for columns in like.maps() {
        let options = ReadOptions {
            columns,
            ..options.clone()
        };
        match read_path(path, &options) {
            Ok(recording) => return Ok(recording),
            Err(error) => first = first.or(Some(error)),
        }
    }
    first.map_or_else(|| read_path(path, options), Err)
}

/// By row and joint, °C; a cell that is empty has that of the last one before it, or of the first.
fn temperatures(poses: &Poses, model: &Model) -> Vec<Vec<f64>> {
    if poses.temperatures.is_empty() {
        return Vec::new();
    }
    let mut rows = vec![vec![model.reference_temperature_c(); model.joints().len()]; poses.len()];
    for (i, joint) in model.joints().iter().enumerate() {
        let own = poses.temperatures.get(&joint.name);
        let column = own.or_else(|| poses.temperatures.get(WHOLE_ROBOT));
        let column = column.map(Vec::as_slice).unwrap_or_default();
        let Some(mut last) = column.iter().flatten().next().copied() else {
            continue;
        };
        for (row, celsius) in rows.iter_mut().zip(column) {
            last = celsius.unwrap_or(last);
            row[i] = last;
        }
    }
    rows
}

/// Where a robot is used.
#[derive(Debug, Clone, PartialEq)]
pub struct Region {
    /// Joint positions of each posture.
    pub postures: Vec<Vec<f64>>,
    /// Joints without a column: they are taken as 0.
    pub absent: Vec<String>,
}

/// The postures of a table, without rows that lost a joint.
///
/// # Errors
/// [`ExportError`].
pub fn region(path: &Path, robot: &Robot, like: &WrittenLike) -> Result<Region, ExportError> {
    let program = program(path, robot, like)?;
    Ok(Region {
        postures: program.q.into_iter().flatten().collect(),
        absent: program.absent,
    })
}

/// Columns of joints are the robot's, in its units.
fn fits(file: &str, poses: &Poses, model: &Model) -> Result<(), ExportError> {
    let wrong = |found: &str, what: String, remedy: String| ExportError::Column {
        file: file.to_owned(),
        found: found.to_owned(),
        what,
        remedy,
    };
    let own = || {
        model
            .joints()
            .iter()
            .map(|j| j.name.as_str())
            .collect::<Vec<_>>()
            .join(", ")
    };
    for (name, unit) in &poses.joint_units {
        let Some(joint) = model.joints().iter().find(|j| j.name == *name) else {
            let what = "is not a joint that this robot moves".to_owned();
            return Err(wrong(name, what, format!("it has {}", own())));
        };
        if joint.prismatic != (*unit == JointUnit::Length) {
            let (is, expected) = match joint.prismatic {
                true => ("an angle", "a length: `_m` or `_mm`"),
                false => ("a length", "an angle: `_deg` or `_rad`"),
            };
            let what = format!("is {is} in the table");
            return Err(wrong(name, what, format!("give this joint as {expected}")));
        }
    }
    let some = model
        .joints()
        .iter()
        .any(|j| poses.joints.contains_key(&j.name));
    let tool = |name: &str| {
        model
            .place(name)
            .is_some_and(|p| !matches!(p, Place::Body(_)))
    };
    let names = || poses.bodies.keys().chain(poses.markers.keys());
    if !some && !names().any(|name| tool(name)) {
        let what = match names().next() {
            None => "has no column of a joint".to_owned(),
            Some(name) => {
                format!("has no column of a joint, and `{name}` is no link or point of this robot")
            }
        };
        let first = model.joints().first().map_or("joint", |j| j.name.as_str());
        let remedy = format!(
            "name the columns after the joints, as `{first}_deg`: {}",
            own()
        );
        return Err(wrong("the table", what, remedy));
    }
    Ok(())
}

/// Lines of a CSV that is written column by column.
#[derive(Debug, Default)]
pub(crate) struct Csv {
    text: String,
    begun: bool,
}

impl Csv {
    /// Another cell of the line.
    pub(crate) fn cell(&mut self, text: &str) {
        if self.begun {
            self.text.push(',');
        }
        self.begun = true;
        self.text.push_str(text);
    }

    /// A number with this many decimals; an empty cell where there is none.
    pub(crate) fn number(&mut self, x: Option<f64>, decimals: usize) {
        // −0 is 0.
        let text = x.map(|x| format!("{:.decimals$}", if x == 0.0 { 0.0 } else { x }));
        let text = text.unwrap_or_default();
        let zero = text.starts_with('-') && text[1..].chars().all(|c| c == '0' || c == '.');
        self.cell(if zero { &text[1..] } else { &text });
    }

    /// The line ends.
    pub(crate) fn end(&mut self) {
        self.text.push('\n');
        self.begun = false;
    }

    pub(crate) fn text(self) -> String {
        self.text
    }
}
