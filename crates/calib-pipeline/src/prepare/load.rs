//! Reads the profile, the robot and the recordings. No other stage opens a file.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use calib_finding::{Fact, Finding, Subject, catalog};
use calib_plugin::{Control, Source};
use calib_profile::{BodyKind, Profile, ProfileError, RecordingSpec, RobotLog};
use calib_recording::{ColumnMap, Filled, JointUnit, Meta, Poses, ReadOptions, Recording};
use calib_urdf::{RobotModel, sha256_hex};
use nalgebra::Matrix3;

use crate::error::PipelineError;
use crate::estimate::estimators::{Estimators, values};
use crate::prepare::align::{Alignment, align, with_robot_log};
use crate::prepare::{paths, readers};

/// A profile with its robot, before any recording is read.
#[derive(Debug, Clone)]
pub struct RobotProfile {
    /// The profile's file name, without folder.
    pub file: String,
    /// Folder that relative paths start from.
    pub folder: PathBuf,
    /// The checked profile.
    pub profile: Profile,
    /// The nominal robot.
    pub model: RobotModel,
    /// The robot description, byte for byte.
    pub urdf_text: String,
    /// Digests of the profile and the description.
    pub digests: Vec<Digest>,
}

/// A file that was read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Digest {
    /// Relative to the profile.
    pub path: String,
    /// SHA-256 of its bytes, hexadecimal.
    pub sha256: String,
}

/// One recording, ready for the estimators.
#[derive(Debug, Clone)]
pub struct Loaded {
    /// Its name in the profile.
    pub name: String,
    /// What the profile says of it.
    pub spec: RecordingSpec,
    /// The table, SI.
    pub poses: Poses,
    /// Joint positions per row, indexed by joint id, rad or m; `None` where a recorded joint is missing in that row.
    pub q: Vec<Option<Vec<f64>>>,
    /// Where it comes from and what was converted.
    pub meta: Meta,
    /// How rows with a time became poses; `None` for a table whose rows are poses.
    pub alignment: Option<Alignment>,
    /// Speed of each recorded joint per row of a motion, rad/s or m/s; empty for static poses.
    pub velocities: BTreeMap<String, Vec<Option<f64>>>,
    /// Shape of each marker's covariance per row, in units of the usual variance; empty where no scatter is known.
    pub shapes: BTreeMap<String, Vec<Option<Matrix3<f64>>>>,
}

/// A body or marker of one row that takes no part in the fit.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Excluded {
    /// The recording.
    pub recording: String,
    /// The row, from 0.
    pub row: usize,
    /// The body or marker.
    pub body: String,
    /// Why.
    pub reason: String,
}

/// Everything the estimation needs.
#[derive(Debug, Clone)]
pub struct Inputs {
    /// Profile and robot.
    pub robot: RobotProfile,
    /// Recordings by name.
    pub recordings: BTreeMap<String, Loaded>,
    /// What was noticed while reading.
    pub findings: Vec<Finding>,
    /// What of the recordings takes no part, found before the fit.
    pub excluded: Vec<Excluded>,
    /// Digests of all files read, profile first.
    pub digests: Vec<Digest>,
    /// Estimators, readers and writers that the profile can name.
    pub estimators: Arc<Estimators>,
}

/// Largest profile or robot description that is read, bytes.
const LARGEST_TEXT: u64 = 64 << 20;

/// Reads and checks a profile and its robot description.
///
/// # Errors
/// [`PipelineError`] with file, place and remedy.
pub fn load_robot(profile_path: &Path) -> Result<RobotProfile, PipelineError> {
    let shown = profile_path.display().to_string();
    let text = read_text(profile_path)?;
    let raw = calib_profile::parse(&text, &shown)?;
    let folder = profile_path
        .parent()
        .map_or_else(PathBuf::new, Path::to_path_buf);
    let urdf_path = folder.join(&raw.robot.urdf);
    let urdf_text = read_text(&urdf_path).map_err(|error| match error {
        PipelineError::Read {
            path,
            source,
            remedy,
        } => PipelineError::Read {
            path,
            source,
            remedy: format!("{remedy} `robot: urdf` in {shown} starts from the profile's folder"),
        },
        other => other,
    })?;
    let model = RobotModel::from_urdf_text(&urdf_text, &urdf_path.display().to_string())?;
    let profile = calib_profile::check(&raw, &text, &shown, &model)?;
    known_estimators(&profile, &text, &shown)?;
    let file = profile_path
        .file_name()
        .map_or_else(String::new, |f| f.to_string_lossy().into_owned());
    let digests = vec![
        Digest {
            path: file.clone(),
            sha256: sha256_hex(text.as_bytes()),
        },
        Digest {
            path: profile.urdf.clone(),
            sha256: sha256_hex(urdf_text.as_bytes()),
        },
    ];
    Ok(RobotProfile {
        file,
        folder,
        profile,
        model,
        urdf_text,
        digests,
    })
}

/// A profile does not know the estimators; their names are checked here, at their place in the profile.
fn known_estimators(profile: &Profile, text: &str, shown: &str) -> Result<(), PipelineError> {
    if !profile.plugins.is_empty() {
        // What plugins offer is known when they are loaded.
        return Ok(());
    }
    let centers: Vec<&str> = calib_cor::estimators().iter().map(|e| e.id).collect();
    let axes: Vec<&str> = calib_aor::estimators().iter().map(|e| e.id).collect();
    for (name, origin) in &profile.origins {
        for (key, wanted, ids) in [
            ("center", &origin.center, &centers),
            ("axis", &origin.axis, &axes),
        ] {
            if ids.contains(&wanted.as_str()) {
                continue;
            }
            let near = match calib_urdf::nearest::nearest(wanted, ids.iter().copied()) {
                Some(near) => format!("did you mean `{near}`? "),
                None => String::new(),
            };
            return Err(ProfileError::at(
                shown,
                text,
                &["origins", name, key],
                format!("origin `{name}`: no {key} estimator is called `{wanted}`"),
                format!("{near}known: {}", ids.join(", ")),
            )
            .into());
        }
    }
    Ok(())
}

/// Reads all recordings of a profile.
///
/// # Errors
/// [`PipelineError`] with file, place and remedy.
pub fn load_recordings(robot: RobotProfile, plugins: bool) -> Result<Inputs, PipelineError> {
    let estimators = Estimators::of_profile(&robot.profile, &robot.folder, plugins)?;
    let mut recordings = BTreeMap::new();
    let mut findings = Vec::new();
    let mut digests = robot.digests.clone();
    let mut excluded = Vec::new();
    for (name, spec) in &robot.profile.recordings {
        let path = robot.folder.join(&spec.file);
        let bytes = std::fs::read(&path).map_err(|e| PipelineError::Data {
            file: path.display().to_string(),
            finding: format!("recording `{name}` cannot be read: {e}"),
            remedy: format!(
                "{} `file` starts from the profile's folder",
                paths::reading(&path, &e)
            ),
        })?;
        digests.push(Digest {
            path: spec.file.clone(),
            sha256: sha256_hex(&bytes),
        });
        let shown = path.display().to_string();
        let mut recording = read(spec, &shown, &bytes, &estimators)?;
        if let Some(log) = &spec.robot_log {
            let of_robot = read_robot_log(&robot, name, spec, log, &estimators, &mut digests)?;
            recording = with_robot_log(recording, of_robot);
        }
        let loaded = match &spec.timing {
            None => {
                let poses = recording
                    .poses(Filled::Exclude)
                    .map_err(|e| PipelineError::Data {
                        file: shown.clone(),
                        finding: e.to_string(),
                        remedy: "add `timing: {}` to the recording in the profile: holds become poses, and the clocks are brought together"
                            .to_owned(),
                    })?;
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
                excluded.extend(aligned.excluded);
                loaded
            }
        };
        recordings.insert(name.clone(), loaded);
    }
    let mut inputs = Inputs {
        robot,
        recordings,
        findings,
        excluded: Vec::new(),
        digests,
        estimators: Arc::new(estimators),
    };
    inputs.exclude(excluded);
    Ok(inputs)
}

impl Inputs {
    /// Takes bodies and markers of single rows out, as if the tracker had lost them, and remembers why.
    pub fn exclude(&mut self, excluded: Vec<Excluded>) {
        for out in &excluded {
            let markers = match self.robot.profile.bodies.get(&out.body).map(|b| &b.kind) {
                Some(BodyKind::Markers { names, .. }) => names.clone(),
                Some(BodyKind::Pose) | None => vec![out.body.clone()],
            };
            let Some(loaded) = self.recordings.get_mut(&out.recording) else {
                continue;
            };
            if let Some(pose) = loaded
                .poses
                .bodies
                .get_mut(&out.body)
                .and_then(|track| track.get_mut(out.row))
            {
                *pose = None;
            }
            for marker in markers {
                let track = loaded.poses.markers.get_mut(&marker);
                if let Some(point) = track.and_then(|track| track.get_mut(out.row)) {
                    *point = None;
                }
            }
        }
        self.excluded.extend(excluded);
    }
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
    let bytes = std::fs::read(&path).map_err(|e| PipelineError::Data {
        file: shown.clone(),
        finding: format!("the robot's log of recording `{name}` cannot be read: {e}"),
        remedy: format!(
            "{} `robot_log: {{file: …}}` starts from the profile's folder",
            paths::reading(&path, &e)
        ),
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
    let recording = read(&own, &shown, &bytes, estimators)?;
    if recording.joints.is_empty() {
        return Err(PipelineError::Data {
            file: shown,
            finding: "the robot's log has no joints".to_owned(),
            remedy: "name the columns as the robot's joints with their unit (`elbow_rad`), or map them under `columns`"
                .to_owned(),
        });
    }
    Ok(recording)
}

/// Before streams are aligned: names that are no joint are an error, or dropped where a column map is given.
fn check_joint_names(
    robot: &RobotProfile,
    spec: &RecordingSpec,
    recording: &mut Recording,
) -> Result<(), PipelineError> {
    let mapped = spec.columns.is_some()
        || spec
            .robot_log
            .as_ref()
            .is_some_and(|log| log.columns.is_some());
    if mapped {
        let known = |name: &str| robot.model.joint_id(name).is_ok();
        recording.joints.retain(|j| known(&j.name));
    }
    for joint in &recording.joints {
        robot
            .model
            .joint_id(&joint.name)
            .map_err(|unknown| PipelineError::Data {
                file: robot.folder.join(&spec.file).display().to_string(),
                finding: format!("stream `{}` is no joint: {unknown}", joint.name),
                remedy: "rename it, or map it under `columns`".to_owned(),
            })?;
    }
    Ok(())
}

/// Recordings that are in memory: simulated ones, by the profile's names.
///
/// # Errors
/// [`PipelineError`] for a recording of the profile that is missing, and as [`load_recordings`] for tables that do not fit the robot.
pub fn of_tables(
    robot: RobotProfile,
    mut tables: BTreeMap<String, Poses>,
) -> Result<Inputs, PipelineError> {
    let estimators = Estimators::of_profile(&robot.profile, &robot.folder, true)?;
    let mut recordings = BTreeMap::new();
    let mut findings = Vec::new();
    for (name, spec) in &robot.profile.recordings {
        let poses = tables.remove(name).ok_or_else(|| PipelineError::Usage {
            finding: format!("recording `{name}` is not simulated"),
            remedy: "add it under `simulate.recordings`".to_owned(),
        })?;
        let meta = Meta {
            source: spec.file.clone(),
            format: "simulated".to_owned(),
            ..Meta::default()
        };
        let loaded = prepare(&robot, name, spec, poses, meta, &mut findings)?;
        recordings.insert(name.clone(), loaded);
    }
    Ok(Inputs {
        excluded: Vec::new(),
        digests: robot.digests.clone(),
        robot,
        recordings,
        findings,
        estimators: Arc::new(estimators),
    })
}

/// Reads one file with the profile's reader: a built-in one directly, a plugin's across the border.
fn read(
    spec: &RecordingSpec,
    shown: &str,
    bytes: &[u8],
    estimators: &Estimators,
) -> Result<Recording, PipelineError> {
    let built_in = |id: &String| {
        calib_recording::readers::readers()
            .iter()
            .any(|r| r.id == id)
    };
    match &spec.reader {
        Some(id) if !built_in(id) || !spec.reader_parameters.is_empty() => {
            let reader = estimators
                .tables
                .reader
                .get(id)?
                .with(&values(&spec.reader_parameters))?;
            let source = Source { name: shown, bytes };
            Ok(readers::recording(
                reader.read(&source, &Control::default())?,
                shown,
                id,
            ))
        }
        format => {
            let options = ReadOptions {
                format: format.clone(),
                columns: column_map(spec),
                ..ReadOptions::default()
            };
            Ok(calib_recording::read_bytes(shown, bytes, &options)?)
        }
    }
}

/// The profile's column map, with its group column among the texts to keep.
fn column_map(spec: &RecordingSpec) -> Option<ColumnMap> {
    let Some(group) = &spec.group else {
        return spec.columns.clone();
    };
    let mut map = spec.columns.clone().unwrap_or_default();
    if !map.labels.contains(group) {
        map.labels.push(group.clone());
    }
    Some(map)
}

/// Checks the names of a table against robot and profile and makes its joint vectors.
fn prepare(
    robot: &RobotProfile,
    name: &str,
    spec: &RecordingSpec,
    mut poses: Poses,
    meta: Meta,
    findings: &mut Vec<Finding>,
) -> Result<Loaded, PipelineError> {
    let model = &robot.model;
    let error = |finding: String, remedy: String| PipelineError::Data {
        file: robot.folder.join(&spec.file).display().to_string(),
        finding,
        remedy,
    };
    if poses.is_empty() {
        return Err(error(
            "has no poses".to_owned(),
            "record at least one row".to_owned(),
        ));
    }
    findings.extend(meta.findings.iter().cloned().map(|mut finding| {
        finding.subject = finding.subject.in_file(&spec.file);
        finding
    }));
    ignore_unmapped(robot, name, spec, &mut poses, findings);
    for joint in poses.joints.keys() {
        let id = model.joint_id(joint).map_err(|unknown| {
            error(
                format!("column `{joint}` is no joint: {unknown}"),
                "rename the column, or map it under `columns`".to_owned(),
            )
        })?;
        let robot_joint = model.joint(id);
        let turns = robot_joint.kind.turns();
        let is_angle = poses
            .joint_units
            .get(joint)
            .is_none_or(|u| *u == JointUnit::Angle);
        if turns != is_angle {
            let units = if turns { "an angle" } else { "a length" };
            return Err(error(
                format!(
                    "joint `{joint}` is {}, its column is not {units}",
                    robot_joint.kind.name()
                ),
                "correct the unit in the column name".to_owned(),
            ));
        }
        if spec.hold.contains_key(&id) {
            return Err(error(
                format!("joint `{joint}` is in the file and held by the profile"),
                "remove it from `hold`".to_owned(),
            ));
        }
    }
    let q = joint_vectors(model, spec, &poses);
    Ok(Loaded {
        name: name.to_owned(),
        spec: spec.clone(),
        poses,
        q,
        meta,
        alignment: None,
        velocities: BTreeMap::new(),
        shapes: BTreeMap::new(),
    })
}

/// In a table with a column map, a column that only looks like a joint is ignored, and said so.
fn ignore_unmapped(
    robot: &RobotProfile,
    name: &str,
    spec: &RecordingSpec,
    poses: &mut Poses,
    findings: &mut Vec<Finding>,
) {
    if spec.columns.is_none() {
        return;
    }
    let strangers: Vec<String> = poses
        .joints
        .keys()
        .filter(|j| robot.model.joint_id(j).is_err())
        .cloned()
        .collect();
    if strangers.is_empty() {
        return;
    }
    for joint in &strangers {
        poses.joints.remove(joint);
        poses.joint_units.remove(joint);
    }
    findings.push(
        Finding::new(catalog::COLUMN_IGNORED, Subject::recording(name))
            .with("columns", Fact::names(strangers)),
    );
}

fn joint_vectors(model: &RobotModel, spec: &RecordingSpec, poses: &Poses) -> Vec<Option<Vec<f64>>> {
    let mut base = model.zero_positions();
    for (joint, value) in &spec.hold {
        base[joint.index()] = *value;
    }
    let columns: Vec<(usize, &Vec<Option<f64>>)> = poses
        .joints
        .iter()
        .filter_map(|(joint, column)| Some((model.joint_id(joint).ok()?.index(), column)))
        .collect();
    (0..poses.len())
        .map(|row| {
            let mut q = base.clone();
            for (joint, column) in &columns {
                q[*joint] = column[row]?;
            }
            Some(q)
        })
        .collect()
}

fn read_text(path: &Path) -> Result<String, PipelineError> {
    let size = std::fs::metadata(path).map_err(|e| PipelineError::read(path, e))?;
    if size.is_dir() {
        return Err(PipelineError::read(
            path,
            std::io::Error::other("it is a folder"),
        ));
    }
    if size.len() > LARGEST_TEXT {
        return Err(PipelineError::read(
            path,
            std::io::Error::other(format!(
                "{} bytes are too many for a profile or URDF",
                size.len()
            )),
        ));
    }
    let bytes = std::fs::read(path).map_err(|e| PipelineError::read(path, e))?;
    String::from_utf8(bytes).map_err(|e| PipelineError::NotText {
        path: path.display().to_string(),
        offset: e.utf8_error().valid_up_to(),
    })
}
