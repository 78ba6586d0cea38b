//! Reads the profile, the robot and the recordings. No other stage opens a file.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use calib_files::input;
use calib_plugin::OwnEntries;
use calib_profile::{Profile, RecordingSpec, RobotLog};
use calib_recording::{ColumnMap, Filled, Meta, Poses, ReadOptions, Recording};
use calib_urdf::sha256_hex;

use crate::error::{DataProblem, NamedBy, PipelineError, WhyUnread};
use crate::options::Plugins;
use crate::prepare::align::align;
use crate::prepare::copied;
use crate::prepare::estimators::{Estimators, values};
use crate::prepare::inputs::stated_sights;
use crate::prepare::robot::urdf_warnings;
use crate::prepare::rows::prepare;
use crate::prepare::timelines::{with_robot_log, with_robot_rows};
use crate::prepare::{effects, named, readers, twice};

pub use crate::prepare::excluded::Excluded;
pub use crate::prepare::inputs::{Digest, Inputs, Loaded, RobotProfile};
pub use crate::prepare::robot::load_robot;

/// Reads all recordings of a profile.
///
/// # Errors
/// [`PipelineError`] with file, place and remedy.
pub fn load_recordings(robot: RobotProfile, plugins: Plugins) -> Result<Inputs, PipelineError> {
    load_recordings_with(robot, plugins, &OwnEntries::default())
}

/// [`load_recordings`] with estimators and readers of the calling program.
///
/// # Errors
/// As [`load_recordings`], and [`PipelineError::Plugin`] for a name that is taken.
pub fn load_recordings_with(
    mut robot: RobotProfile,
    plugins: Plugins,
    own: &OwnEntries,
) -> Result<Inputs, PipelineError> {
    let mut estimators = Estimators::of_profile(&robot.profile, &robot.folder, plugins)?;
    estimators.tables.add_own(own)?;
    named::check(&robot, &estimators.tables)?;
    effects::resolve(&mut robot, &mut estimators)?;
    let mut recordings = BTreeMap::new();
    let mut findings = urdf_warnings(&robot);
    let mut digests = robot.digests.clone();
    let mut excluded = Vec::new();
    for (name, spec) in &robot.profile.recordings {
        let path = robot.folder.join(&spec.file);
        let bytes = input::read(&path, largest()).map_err(|e| {
            PipelineError::read(&path, NamedBy::Recording(name.clone()), WhyUnread::Io(e))
        })?;
        digests.push(Digest {
            path: spec.file.clone(),
            sha256: sha256_hex(&bytes),
        });
        let shown = path.display().to_string();
        let texts = texts(&robot.profile, name, spec);
        let known = known(&robot, false);
        let mut recording = read(spec, (&texts, known), &shown, &bytes, &estimators)?;
        if let Some(log) = &spec.robot_log {
            let of_robot = read_robot_log(&robot, name, spec, log, &estimators, &mut digests)?;
            recording = match &spec.timing {
                Some(_) => with_robot_log(recording, of_robot),
                None => with_robot_rows(recording, of_robot)
                    .map_err(|e| PipelineError::data(&shown, DataProblem::RowsDiffer(e)))?,
            };
        }
        recording.rename(&robot.profile.names)?;
        let loaded = match &spec.timing {
            None => {
                let poses = recording
                    .poses(Filled::Exclude)
                    .map_err(|e| PipelineError::data(&shown, DataProblem::NotOneTable(e)))?;
                prepare(&robot, name, spec, poses, recording.meta, &mut findings)?
            }
            Some(timing) => {
                check_joint_names(&robot, spec, &mut recording)?;
                let aligned = align(&robot, name, spec, timing, &recording)?;
                findings.extend(aligned.findings);
                let meta = recording.meta;
                let poses = aligned.poses;
                let mut loaded = prepare(&robot, name, spec, poses, meta, &mut findings)?;
                loaded.alignment = Some(aligned.alignment);
                loaded.velocities = aligned.velocities;
                loaded.shapes = aligned.shapes;
                loaded.row_noise = aligned.row_noise;
                excluded.extend(aligned.excluded);
                loaded
            }
        };
        recordings.insert(name.clone(), loaded);
    }
    let mut inputs = Inputs {
        sights: stated_sights(&robot.profile),
        robot,
        recordings,
        findings,
        excluded: Vec::new(),
        taken_out: BTreeSet::new(),
        condensed: BTreeMap::new(),
        digests,
        estimators: Arc::new(estimators),
    };
    inputs.exclude(excluded);
    copied::leave_out(&mut inputs);
    inputs.findings.extend(twice::findings(&inputs));
    inputs.findings.extend(named::unused(&inputs));
    effects::evaluate(&inputs)?;
    Ok(inputs)
}

/// The most bytes that a recording may have.
fn largest() -> u64 {
    ReadOptions::default().max_bytes
}

/// Reads the robot's own log of a recording.
fn read_robot_log(
    robot: &RobotProfile,
    name: &str,
    spec: &RecordingSpec,
    log: &RobotLog,
    estimators: &Estimators,
    digests: &mut Vec<Digest>,
) -> Result<Recording, PipelineError> {
    let path = robot.folder.join(&log.file);
    let shown = path.display().to_string();
    let bytes = input::read(&path, largest()).map_err(|e| {
        PipelineError::read(&path, NamedBy::RobotLog(name.to_owned()), WhyUnread::Io(e))
    })?;
    digests.push(Digest {
        path: log.file.clone(),
        sha256: sha256_hex(&bytes),
    });
    let own = RecordingSpec {
        file: log.file.clone(),
        group: None,
        reader: log.reader.clone(),
        reader_parameters: BTreeMap::new(),
        columns: log.columns.clone(),
        ..spec.clone()
    };
    let recording = read(&own, (&[], known(robot, true)), &shown, &bytes, estimators)?;
    if recording.joints.is_empty() {
        return Err(PipelineError::data(shown, DataProblem::NoJointsInLog));
    }
    Ok(recording)
}

/// Before streams are aligned: names that are no joint are an error, or dropped where a column map is given.
fn check_joint_names(
    robot: &RobotProfile,
    spec: &RecordingSpec,
    recording: &mut Recording,
) -> Result<(), PipelineError> {
    let log = spec.robot_log.as_ref();
    let mapped = describes_columns(spec.columns.as_ref())
        || describes_columns(log.and_then(|log| log.columns.as_ref()));
    if mapped {
        let known = |name: &str| robot.model.joint_id(name).is_ok();
        recording.joints.retain(|j| known(&j.name));
    }
    for joint in &recording.joints {
        robot.model.joint_id(&joint.name).map_err(|unknown| {
            let file = robot.folder.join(&spec.file).display().to_string();
            let stream = joint.name.clone();
            PipelineError::data(file, DataProblem::StreamNotAJoint { stream, unknown })
        })?;
    }
    Ok(())
}

/// Recordings that are in memory: simulated ones, by the profile's names.
///
/// # Errors
/// [`PipelineError`] for a recording of the profile that is missing, and as [`load_recordings`] for tables that do not fit the robot.
pub fn of_tables(
    mut robot: RobotProfile,
    mut tables: BTreeMap<String, Poses>,
    plugins: Plugins,
) -> Result<Inputs, PipelineError> {
    let mut estimators = Estimators::of_profile(&robot.profile, &robot.folder, plugins)?;
    named::check(&robot, &estimators.tables)?;
    effects::resolve(&mut robot, &mut estimators)?;
    let mut recordings = BTreeMap::new();
    let mut findings = Vec::new();
    for (name, spec) in &robot.profile.recordings {
        let missing = || PipelineError::NotSimulated {
            recording: name.clone(),
        };
        let poses = tables.remove(name).ok_or_else(missing)?;
        let meta = Meta {
            source: spec.file.clone(),
            format: "simulated".to_owned(),
            inverse_bodies: spec.inverse_bodies(),
            ..Meta::default()
        };
        let loaded = prepare(&robot, name, spec, poses, meta, &mut findings)?;
        recordings.insert(name.clone(), loaded);
    }
    let inputs = Inputs {
        excluded: Vec::new(),
        taken_out: BTreeSet::new(),
        condensed: BTreeMap::new(),
        sights: stated_sights(&robot.profile),
        digests: robot.digests.clone(),
        robot,
        recordings,
        findings,
        estimators: Arc::new(estimators),
    };
    effects::evaluate(&inputs)?;
    Ok(inputs)
}

/// Reads one file with the profile's reader, or with that of a plugin which recognizes it: a built-in one directly, a plugin's across the
/// border.
fn read(
    spec: &RecordingSpec,
    (texts, known): (&[&String], ReadOptions),
    shown: &str,
    bytes: &[u8],
    estimators: &Estimators,
) -> Result<Recording, PipelineError> {
    let built_in = |id: &String| {
        calib_recording::readers::readers()
            .iter()
            .any(|r| r.id == id)
    };
    let of_tables = &estimators.tables.reader;
    let entry = match &spec.reader {
        Some(id) if !built_in(id) || !spec.reader_parameters.is_empty() => Some(of_tables.get(id)?),
        None if !describes_columns(spec.columns.as_ref()) => of_tables.recognizing(bytes),
        _ => None,
    };
    let Some(entry) = entry else {
        let options = ReadOptions {
            format: spec.reader.clone(),
            columns: column_map(spec, texts),
            ..known
        };
        return Ok(calib_recording::read_bytes(shown, bytes, &options)?);
    };
    readers::read(entry, &values(&spec.reader_parameters), shown, bytes)
}

/// Whether there is a map that says what the columns are.
fn describes_columns(map: Option<&ColumnMap>) -> bool {
    map.is_some_and(ColumnMap::describes_columns)
}

/// What is known of a table before it is read; `of_robot`: it is the robot's own log.
fn known(robot: &RobotProfile, of_robot: bool) -> ReadOptions {
    let joints = robot.model.joints().iter();
    ReadOptions {
        joints: joints
            .filter(|joint| joint.kind.axis().is_some())
            .map(|joint| joint.name.clone())
            .collect(),
        of_robot,
        ..ReadOptions::default()
    }
}

/// Text columns that the profile needs of a recording: its groups, and the names of touched spots.
fn texts<'a>(profile: &'a Profile, name: &String, spec: &'a RecordingSpec) -> Vec<&'a String> {
    let contacts = profile.contacts.values();
    let here = contacts.filter(|c| c.recordings.contains(name));
    let spots = here.filter_map(|c| Some(&c.spots()?.named_in));
    spec.group.iter().chain(spots).collect()
}

/// The profile's column map, with these texts among those to keep.
fn column_map(spec: &RecordingSpec, texts: &[&String]) -> Option<ColumnMap> {
    if texts.is_empty() {
        return spec.columns.clone();
    }
    let mut map = spec.columns.clone().unwrap_or_default();
    for text in texts {
        if !map.labels.contains(*text) {
            map.labels.push((*text).clone());
        }
    }
    Some(map)
}
