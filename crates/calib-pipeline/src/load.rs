//! Reads the profile, the robot and the recordings. No other stage opens a file.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use calib_profile::{Profile, RecordingSpec};
use calib_recording::{ColumnMap, Filled, Finding, JointUnit, Meta, Poses, ReadOptions, Severity};
use calib_urdf::{RobotModel, sha256_hex};

use crate::error::PipelineError;

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
    /// Digests of all files read, profile first.
    pub digests: Vec<Digest>,
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
    let urdf_text = read_text(&urdf_path)?;
    let model = RobotModel::from_urdf_text(&urdf_text, &urdf_path.display().to_string())?;
    let profile = calib_profile::check(&raw, &text, &shown, &model)?;
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

/// Reads all recordings of a profile.
///
/// # Errors
/// [`PipelineError`] with file, place and remedy.
pub fn load_recordings(robot: RobotProfile) -> Result<Inputs, PipelineError> {
    let mut recordings = BTreeMap::new();
    let mut findings = Vec::new();
    let mut digests = robot.digests.clone();
    for (name, spec) in &robot.profile.recordings {
        let path = robot.folder.join(&spec.file);
        let bytes = std::fs::read(&path).map_err(|e| PipelineError::read(&path, e))?;
        digests.push(Digest {
            path: spec.file.clone(),
            sha256: sha256_hex(&bytes),
        });
        let options = ReadOptions {
            columns: column_map(spec),
            ..ReadOptions::default()
        };
        let shown = path.display().to_string();
        let recording = calib_recording::read_bytes(&shown, &bytes, &options)?;
        let poses = recording
            .poses(Filled::Exclude)
            .map_err(|e| PipelineError::Data {
                file: shown.clone(),
                finding: e.to_string(),
                remedy: "record one table of static poses, or synchronise the streams first"
                    .to_owned(),
            })?;
        let loaded = prepare(&robot, name, spec, poses, recording.meta, &mut findings)?;
        recordings.insert(name.clone(), loaded);
    }
    Ok(Inputs {
        robot,
        recordings,
        findings,
        digests,
    })
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
    poses: Poses,
    meta: Meta,
    findings: &mut Vec<Finding>,
) -> Result<Loaded, PipelineError> {
    let model = &robot.model;
    let error = |finding: String, remedy: String| PipelineError::Data {
        file: spec.file.clone(),
        finding,
        remedy,
    };
    if poses.is_empty() {
        return Err(error(
            "has no poses".to_owned(),
            "record at least one row".to_owned(),
        ));
    }
    findings.extend(
        meta.findings
            .iter()
            .cloned()
            .map(|f| in_file(f, &spec.file)),
    );
    for (joint, column) in &poses.joints {
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
        if let (Some((lower, upper)), true) = (robot_joint.limits.range(), turns) {
            // Encoders and limits are rounded differently: half a degree.
            let slack = 0.5_f64.to_radians();
            let outside: Vec<u64> =
                rows_where(&poses, column, |q| q < lower - slack || q > upper + slack);
            if !outside.is_empty()
                && !matches!(robot_joint.kind, calib_urdf::JointKind::Continuous { .. })
            {
                findings.push(
                    Finding::new(
                        "joint-outside-limits",
                        Severity::Warning,
                        format!("{name}: {joint}"),
                        format!(
                            "{} of {} poses lie outside the URDF's limits {:.1} … {:.1} deg",
                            outside.len(),
                            poses.len(),
                            lower.to_degrees(),
                            upper.to_degrees()
                        ),
                        "check the unit and sign of the column, or the limits in the URDF",
                    )
                    .at_rows(outside),
                );
            }
        }
    }
    check_bodies(robot, name, &poses, findings);
    let q = joint_vectors(model, spec, &poses);
    Ok(Loaded {
        name: name.to_owned(),
        spec: spec.clone(),
        poses,
        q,
        meta,
    })
}

fn in_file(mut finding: Finding, file: &str) -> Finding {
    if !finding.subject.contains(file) {
        finding.subject = if finding.subject.is_empty() {
            file.to_owned()
        } else {
            format!("{file}: {}", finding.subject)
        };
    }
    finding
}

fn rows_where(poses: &Poses, column: &[Option<f64>], is: impl Fn(f64) -> bool) -> Vec<u64> {
    column
        .iter()
        .zip(&poses.rows)
        .filter(|(q, _)| q.is_some_and(&is))
        .map(|(_, row)| *row)
        .collect()
}

/// Says which declared bodies and markers a recording does not have; none of one body is "not in view".
fn check_bodies(robot: &RobotProfile, name: &str, poses: &Poses, findings: &mut Vec<Finding>) {
    for (body, spec) in &robot.profile.bodies {
        if let calib_profile::BodyKind::Markers { names, .. } = &spec.kind {
            let missing: Vec<&str> = names
                .iter()
                .filter(|m| !poses.markers.contains_key(*m))
                .map(String::as_str)
                .collect();
            if !missing.is_empty() && missing.len() < names.len() {
                findings.push(Finding::new(
                    "marker-not-recorded",
                    Severity::Warning,
                    format!("{name}: {body}"),
                    format!("the recording has no column for {}", missing.join(", ")),
                    "export all markers of the body, or remove them from the profile",
                ));
            }
        }
    }
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
