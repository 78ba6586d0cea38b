//! Reads and checks a profile and its URDF.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use calib_files::input;
use calib_finding::{About, Fact, Finding, catalog};
use calib_plugin::OwnEntries;
use calib_profile::Profile;
use calib_profile::raw::RawProfile;
use calib_urdf::{Problem, ReadError, ReadProblem, RobotModel, doubt, sha256_hex};

use crate::error::{NamedBy, PipelineError, WhyUnread};
use crate::prepare::estimators::Estimators;
use crate::prepare::inputs::{Digest, RobotProfile, Written};
use crate::prepare::loads::Masses;
use crate::prepare::unknown;

/// Largest profile or URDF that is read, bytes.
const LARGEST_TEXT: u64 = 64 << 20;

/// Reads and checks a profile and its URDF.
///
/// # Errors
/// [`PipelineError`] with file, place and remedy.
pub fn load_robot(profile_path: &Path) -> Result<RobotProfile, PipelineError> {
    load_robot_with(profile_path, &OwnEntries::default())
}

/// A profile as it is written, with its text; nothing of it is checked against a robot.
///
/// # Errors
/// [`PipelineError`] for a file that cannot be read, or is no profile.
pub fn read_profile(path: &Path) -> Result<(RawProfile, String), PipelineError> {
    let text = read_text(path, &NamedBy::Caller)?;
    let raw = calib_profile::parse(&text, &path.display().to_string())?;
    Ok((raw, text))
}

/// [`load_robot`] for a profile that may name estimators of the calling program.
///
/// # Errors
/// As [`load_robot`].
pub fn load_robot_with(
    profile_path: &Path,
    own: &OwnEntries,
) -> Result<RobotProfile, PipelineError> {
    let shown = profile_path.display().to_string();
    let (raw, text) = read_profile(profile_path)?;
    let folder = profile_path
        .parent()
        .map_or_else(PathBuf::new, Path::to_path_buf);
    let urdf_path = folder.join(&raw.robot.urdf);
    let named_by = NamedBy::Urdf {
        profile: shown.clone(),
    };
    let urdf_text = read_text(&urdf_path, &named_by)?;
    let model = RobotModel::from_urdf_text(&urdf_text, &urdf_path.display().to_string())?;
    let profile = calib_profile::check(&raw, &text, &shown, &model)?;
    let written = Written { shown, text };
    // What plugins and the calling program offer is known when the recordings are read.
    if profile.plugins.is_empty() && own.is_empty() {
        unknown::check(&profile, &model, &Estimators::built_in()?.tables, &written)?;
    }
    limits_of_moved_joints(&profile, &model, &urdf_path)?;
    let file = profile_path
        .file_name()
        .map_or_else(String::new, |f| f.to_string_lossy().into_owned());
    let digests = vec![
        Digest {
            path: file.clone(),
            sha256: sha256_hex(written.text.as_bytes()),
        },
        Digest {
            path: profile.urdf.clone(),
            sha256: sha256_hex(urdf_text.as_bytes()),
        },
    ];
    Ok(RobotProfile {
        file,
        written,
        folder,
        masses: Masses::of(&model, &profile.load),
        profile,
        model,
        urdf_text,
        digests,
    })
}

/// Limits in the wrong order are a warning, but not for a joint that the profile moves.
fn limits_of_moved_joints(
    profile: &Profile,
    model: &RobotModel,
    urdf: &Path,
) -> Result<(), PipelineError> {
    let moved = |joint: &str| {
        let id = model.joint_id(joint);
        let recordings = profile.recordings.values();
        id.is_ok_and(|id| recordings.flat_map(|r| r.ranges.keys()).any(|j| *j == id))
    };
    let wrong = |found: &&ReadProblem| match &found.problem {
        Problem::LimitsReversed { joint, .. } => moved(joint),
        _ => false,
    };
    let problems: Vec<ReadProblem> = model.warnings().iter().filter(wrong).cloned().collect();
    match problems.is_empty() {
        true => Ok(()),
        false => Err(ReadError::new(&urdf.display().to_string(), problems).into()),
    }
}

/// What is wrong in the URDF and no reason to refuse it.
pub(crate) fn urdf_warnings(robot: &RobotProfile) -> Vec<Finding> {
    let finding = |found: &ReadProblem| {
        Some(match &found.problem {
            Problem::MimicOfFixed {
                joint,
                source_joint,
            } => Finding::of_kind(
                catalog::URDF_INCONSISTENT,
                "mimic_of_fixed",
                About::Joint(joint.clone()),
            )
            .with("source", Fact::name(source_joint.clone())),
            Problem::LimitsReversed {
                joint,
                lower,
                upper,
            } => Finding::of_kind(
                catalog::URDF_INCONSISTENT,
                "limits_reversed",
                About::Joint(joint.clone()),
            )
            .with("lower", Fact::name(lower.clone()))
            .with("upper", Fact::name(upper.clone())),
            _ => return None,
        })
    };
    let mut findings: Vec<Finding> = robot.model.warnings().iter().filter_map(finding).collect();
    findings.extend(doubts(&robot.model));
    findings
}

/// Numbers of the URDF that are probably in another unit.
fn doubts(model: &RobotModel) -> Vec<Finding> {
    let mut findings = Vec::new();
    for joint in doubt::limits_in_degrees(model) {
        let joint = model.joint(joint);
        if let Some((low, high)) = joint.limits.range() {
            let about = About::Joint(joint.name.clone());
            let finding = Finding::of_kind(catalog::URDF_INCONSISTENT, "limits_in_degrees", about)
                .with("lower", Fact::radians(low))
                .with("upper", Fact::radians(high));
            findings.push(finding);
        }
    }
    let reach = doubt::reach(model);
    if reach > doubt::LARGEST {
        let kind = "too_large";
        let finding = Finding::of_kind(catalog::URDF_INCONSISTENT, kind, About::Lengths);
        findings.push(finding.with("reach", Fact::meters(reach)));
    }
    findings
}

fn read_text(path: &Path, named_by: &NamedBy) -> Result<String, PipelineError> {
    let unread = |why: WhyUnread| PipelineError::read(path, named_by.clone(), why);
    let bytes = input::read(path, LARGEST_TEXT).map_err(|e| {
        let size = std::fs::metadata(path).map_or(0, |m| m.len());
        unread(match e.kind() {
            ErrorKind::FileTooLarge => WhyUnread::TooLarge(size),
            _ => WhyUnread::Io(e),
        })
    })?;
    String::from_utf8(bytes).map_err(|e| PipelineError::NotText {
        path: path.display().to_string(),
        offset: e.utf8_error().valid_up_to(),
    })
}
