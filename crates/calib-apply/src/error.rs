//! Why a result is not applied, or a file not reverted.

use std::path::{Path, PathBuf};

use calib_files::FileError;
use calib_report::{NotAReport, ReportError, Verdict};
use calib_urdf::{EditError, ReadError, RevertError};

/// Why a result is not applied, or a file not reverted. Nothing was written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ApplyError {
    /// A URDF or a YAML cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The text of the target cannot be changed as asked.
    #[error("{0}")]
    Edit(EditError),
    /// The report of the result cannot be read.
    #[error(transparent)]
    Report(#[from] NotAReport),
    /// A file was not written.
    #[error(transparent)]
    File(#[from] FileError),
    /// A change record or a comparison has no JSON form.
    #[error("the output cannot be written: {0}")]
    Unwritable(#[from] ReportError),
    /// There is no result at this path.
    #[error(
        "{}: there is no such file or folder\n  help: give the folder that `calib run` wrote (results/<profile>)",
        path.display()
    )]
    NoResult {
        /// The path.
        path: PathBuf,
    },
    /// The result was given as the target, and the target as the result.
    #[error(
        "{} is a result, and {} the file to change: they are exchanged\n  help: give the result first: calib apply {} {}",
        result.display(), target.display(),
        calib_report::shell_path(&result.to_string_lossy()), calib_report::shell_path(&target.to_string_lossy())
    )]
    Exchanged {
        /// What was given as the target.
        result: PathBuf,
        /// What was given as the result.
        target: PathBuf,
    },
    /// A YAML without origins of joints was to be compared.
    #[error(
        "{}: this YAML holds no origins of joints{}\n  help: give a URDF, a xacro, or a YAML of origins like `kinematics_params`{}",
        path.display(),
        if *is_profile { ": it is a profile of calib" } else { "" },
        if *is_profile { "; the robot of a profile is the file at `robot.urdf`" } else { "" }
    )]
    NoOrigins {
        /// The file.
        path: PathBuf,
        /// Whether it is a profile of calib.
        is_profile: bool,
    },
    /// The report lists no calibrated URDF.
    #[error("{}: this report names no calibrated URDF\n  help: run the calibration again", report.display())]
    NoUrdf {
        /// The report.
        report: PathBuf,
    },
    /// The calibration was not accepted, and the caller did not force it.
    #[error(
        "{}: the verdict of this calibration is \"{}\": {}\n  help: improve the calibration first, or apply it at your own risk with --force",
        path.display(), verdict.word(), reasons.iter().map(|r| r.trim_end_matches('.')).collect::<Vec<_>>().join("; ")
    )]
    NotAccepted {
        /// The result.
        path: PathBuf,
        /// The verdict.
        verdict: Verdict,
        /// Its reasons, as the report states them.
        reasons: Vec<String>,
    },
    /// The change record beside a file cannot be read.
    #[error("{}: the change record cannot be read: {source}\n  help: {RECORD_REMEDY}", path.display())]
    NoRecord {
        /// The record.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// A xacro was not changed, but a YAML that it loads was.
    #[error(
        "{}: it has no change record: its numbers were changed in {}\n  help: revert that file: calib revert {} --in-place",
        file.display(), yaml.display(), calib_report::shell_path(&yaml.to_string_lossy())
    )]
    RecordedElsewhere {
        /// The xacro.
        file: PathBuf,
        /// The YAML.
        yaml: PathBuf,
    },
    /// The change record beside a file is damaged, or is something else.
    #[error("{}: is not a change record: {source}\n  help: {RECORD_REMEDY}", path.display())]
    NotARecord {
        /// The record.
        path: PathBuf,
        /// Line, column and what was expected.
        source: serde_json::Error,
    },
    /// A file cannot be reverted by the record beside it.
    #[error("{}: {source}{}", file.display(), revert_help(source))]
    Revert {
        /// The changed file.
        file: PathBuf,
        /// Why.
        source: RevertError,
    },
    /// A YAML was named for a target that loads none.
    #[error(
        "{} loads no YAML, so --yaml {} has no use\n  help: leave --yaml out, or give that YAML as the target",
        target.display(), yaml.display()
    )]
    YamlUnused {
        /// The target.
        target: PathBuf,
        /// The YAML.
        yaml: PathBuf,
    },
    /// Some joints hold the result already, the others what it started from.
    #[error(
        "{}: {applied} of {joints} joints hold this result already, the others what it started from\n  help: restore the file that was calibrated first",
        target.display()
    )]
    PartlyApplied {
        /// The target.
        target: PathBuf,
        /// Joints that hold the result.
        applied: usize,
        /// Joints that the target and the result share.
        joints: usize,
    },
    /// An earlier change was stopped between the target and a file that it loads.
    #[error(
        "{}: an earlier change was stopped between this file and one that it loads\n  help: complete it with --in-place",
        file.display()
    )]
    Stopped {
        /// The target.
        file: PathBuf,
    },
    /// The target's origins are not those that the calibration started from.
    #[error(
        "{}: its origins are not those that were calibrated: they differ in {}\n  help: apply to the nominal URDF that the profile names, or calibrate with this one",
        target.display(), differences(others)
    )]
    OtherOrigins {
        /// The target.
        target: PathBuf,
        /// What differs, in the order of the joints' names.
        others: Vec<OriginDifference>,
    },
    /// Joints of the target are others than those that were calibrated.
    #[error(
        "{}: it is of another robot than the one that was calibrated: axis, kind, parent or child of {} differ\n  help: compare with `calib diff`, apply to the nominal URDF that the profile names, or calibrate with this one",
        target.display(), joints.iter().map(|j| format!("`{j}`")).collect::<Vec<_>>().join(", ")
    )]
    OtherKinematics {
        /// The target.
        target: PathBuf,
        /// The joints.
        joints: Vec<String>,
    },
    /// The target was edited since a change that has a record: the first original could not be restored.
    #[error(
        "{}: it was edited after the change that {} records\n  help: undo those edits, or write elsewhere with --out",
        file.display(), record.display()
    )]
    ChangedAlready {
        /// The target.
        file: PathBuf,
        /// The record.
        record: PathBuf,
    },
}

const RECORD_REMEDY: &str =
    "give a file that `calib run` or `calib apply` wrote, with its .changes.json beside it";

/// By how much the origin of a joint in a target differs from the one that was calibrated.
#[derive(Debug, Clone, PartialEq)]
pub struct OriginDifference {
    /// The joint.
    pub joint: String,
    /// Distance of the origins, m.
    pub translation: f64,
    /// Angle between the frames, rad.
    pub rotation: f64,
}

/// The first few of the joints that differ.
fn differences(others: &[OriginDifference]) -> String {
    /// More than this many say the same again.
    const SHOWN: usize = 3;
    let shown: Vec<String> = others
        .iter()
        .take(SHOWN)
        .map(|o| {
            let (mm, deg) = (o.translation * 1e3, o.rotation.to_degrees());
            format!("`{}` by {mm:.3} mm and {deg:.4} deg", o.joint)
        })
        .collect();
    let more = match others.len().saturating_sub(SHOWN) {
        0 => String::new(),
        n => format!(" and {n} more"),
    };
    format!("{}{more}", shown.join(", "))
}

/// A remedy for those errors of the record that state none.
fn revert_help(source: &RevertError) -> &'static str {
    match source {
        RevertError::Version { .. } | RevertError::Edited { .. } => "",
        _ => "\n  help: revert the file as it was written",
    }
}

// Not a `#[from]`: the message is the cause's own, which would then be said twice.
impl From<EditError> for ApplyError {
    fn from(error: EditError) -> Self {
        Self::Edit(error)
    }
}

impl ApplyError {
    /// The file or folder that it is about; `None`: the error inside knows.
    #[must_use]
    pub fn path(&self) -> Option<&Path> {
        match self {
            Self::Read(_) | Self::Edit(_) | Self::Unwritable(_) => None,
            Self::Report(error) => Some(error.path()),
            Self::File(error) => error.path(),
            Self::Exchanged { target, .. } => Some(target),
            Self::NoResult { path }
            | Self::NoOrigins { path, .. }
            | Self::NotAccepted { path, .. }
            | Self::NoRecord { path, .. }
            | Self::NotARecord { path, .. } => Some(path),
            Self::NoUrdf { report } => Some(report),
            Self::RecordedElsewhere { file, .. }
            | Self::Revert { file, .. }
            | Self::Stopped { file }
            | Self::ChangedAlready { file, .. } => Some(file),
            Self::YamlUnused { target, .. }
            | Self::PartlyApplied { target, .. }
            | Self::OtherKinematics { target, .. }
            | Self::OtherOrigins { target, .. } => Some(target),
        }
    }

    /// Whether the result can be read, but should not be applied.
    #[must_use]
    pub fn is_refusal(&self) -> bool {
        matches!(self, Self::NotAccepted { .. })
    }
}
