//! What can go wrong, and with which exit code the program ends.
//!
//! A variant holds ids and values; the sentences stand here and in `data`, and nowhere else
//! (book/src/decisions/errors.md).

mod data;
mod file;
mod seen;

use std::error::Error as _;
use std::path::Path;

pub use data::{DataProblem, NotATrack, RowsDiffer};
pub use file::{NamedBy, UnreadFile, WhyUnread};
pub use seen::SeenInstead;

/// Exit codes of the program.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum ExitCode {
    /// Finished and accepted.
    Accepted = 0,
    /// Finished; the verdict is not a pass.
    VerdictFail = 1,
    /// Wrong usage, or a wrong profile or URDF.
    Usage = 2,
    /// The data cannot be read or are not usable.
    Data = 3,
    /// A requested quantity is not observable.
    NotObservable = 4,
    /// The solver did not converge.
    NotConverged = 5,
    /// A plugin failed.
    Plugin = 6,
    /// The output could not be written.
    NotWritten = 7,
}

/// Why a stage stopped.
#[derive(Debug, thiserror::Error)]
pub enum PipelineError {
    /// A file cannot be read.
    #[error("{file}\n  help: {}", file.remedy())]
    Read {
        /// The file, who named it, and why.
        file: Box<UnreadFile>,
    },
    /// A profile or URDF is not text.
    #[error(
        "{path}: is not UTF-8 text (byte {offset})\n  help: save it as UTF-8, or name another file"
    )]
    NotText {
        /// The file.
        path: String,
        /// First bad byte.
        offset: usize,
    },
    /// The profile is wrong.
    #[error("{0}")]
    Profile(#[from] calib_profile::ProfileError),
    /// The URDF is wrong.
    #[error("{0}")]
    Urdf(#[from] calib_urdf::ReadError),
    /// A recording is wrong.
    #[error("{0}")]
    Recording(#[from] calib_recording::Error),
    /// Recordings do not hold what the profile asks of them.
    #[error("{file}: {problem}\n  help: {}", problem.remedy())]
    Data {
        /// The file.
        file: String,
        /// What was found.
        problem: Box<DataProblem>,
    },
    /// A recording of the profile that is to be simulated is not among the tables.
    #[error("recording `{recording}` is not simulated\n  help: add it under `simulate.recordings`")]
    NotSimulated {
        /// The recording.
        recording: String,
    },
    /// The method estimates origins, and none is stated.
    #[error(
        "{file}: the method `paper` estimates the origins of joints, and the profile states none\n  help: state `origins`, or use `method: ml`"
    )]
    NoOrigins {
        /// The profile.
        file: String,
    },
    /// An estimator does not take the data of an origin.
    #[error("origin `{origin}`: {cause}\n  help: check the poses of the body")]
    Origin {
        /// The origin.
        origin: String,
        /// What the estimator says.
        cause: calib_aor::EstimatorError,
    },
    /// The solver refused the problem.
    #[error("the estimation problem cannot be stated: {0}")]
    Solve(#[from] calib_core::Error),
    /// The patched URDF is not what was asked for.
    #[error("{file}: the URDF cannot be patched: {cause}")]
    Patch {
        /// The URDF.
        file: String,
        /// Why.
        cause: Box<calib_urdf::EditError>,
    },
    /// A text of a robot's description cannot be changed as asked.
    #[error("{0}")]
    Edit(Box<calib_urdf::EditError>),
    /// A plugin or an estimator failed, or is not what the profile needs.
    #[error("{}", chain(.0))]
    Plugin(Box<calib_plugin::PluginError>),
    /// The report or scene could not be rendered.
    #[error("the report cannot be written: {0}")]
    Report(#[from] calib_report::ReportError),
}

// Not a `#[from]`: the message is the cause's own, which would then be said twice.
impl From<calib_urdf::EditError> for PipelineError {
    fn from(error: calib_urdf::EditError) -> Self {
        Self::Edit(Box::new(error))
    }
}

impl From<calib_plugin::PluginError> for PipelineError {
    fn from(error: calib_plugin::PluginError) -> Self {
        Self::Plugin(Box::new(error))
    }
}

/// An error and its causes in one line.
fn chain(error: &calib_plugin::PluginError) -> String {
    let mut text = error.to_string();
    let mut source = error.source();
    while let Some(cause) = source {
        text.push_str(&format!(": {cause}"));
        source = cause.source();
    }
    text
}

/// The exit code of what went wrong with a plugin or an estimator.
#[must_use]
pub fn exit_code_of(error: &calib_plugin::PluginError) -> ExitCode {
    match error.exit_code() {
        2 => ExitCode::Usage,
        3 => ExitCode::Data,
        _ => ExitCode::Plugin,
    }
}

impl PipelineError {
    /// The exit code of this error.
    #[must_use]
    pub fn exit_code(&self) -> ExitCode {
        match self {
            Self::Read { file } => match file.named_by {
                NamedBy::Caller | NamedBy::Urdf { .. } => ExitCode::Usage,
                NamedBy::Recording(_) | NamedBy::RobotLog(_) => ExitCode::Data,
            },
            Self::NotText { .. }
            | Self::Profile(_)
            | Self::Urdf(_)
            | Self::NotSimulated { .. }
            | Self::NoOrigins { .. }
            | Self::Origin { .. } => ExitCode::Usage,
            Self::Recording(_) | Self::Data { .. } => ExitCode::Data,
            Self::Solve(_) => ExitCode::NotConverged,
            Self::Plugin(error) => exit_code_of(error),
            Self::Edit(_) | Self::Patch { .. } | Self::Report(_) => ExitCode::NotWritten,
        }
    }

    /// What to do, for an error whose text does not say it in a `help:` line of its own.
    #[must_use]
    pub fn remedy(&self) -> &'static str {
        match self {
            Self::Solve(_) => "look at what `calib check` says of the profile and the recordings",
            Self::Plugin(error) => error.remedy(),
            Self::Patch { .. } => "look at the names under `outputs`, and at the URDF there",
            Self::Urdf(_) => "correct it there, or export the nominal URDF again",
            Self::Edit(_) => "nothing was written; give the expanded URDF",
            Self::Report(_) => {
                "look at what `calib check` says; the results are not finite or not whole"
            }
            _ => "`calib help` shows the commands and what they take",
        }
    }

    pub(crate) fn data(file: impl Into<String>, problem: DataProblem) -> Self {
        Self::Data {
            file: file.into(),
            problem: Box::new(problem),
        }
    }

    pub(crate) fn read(path: &Path, named_by: NamedBy, why: WhyUnread) -> Self {
        Self::Read {
            file: Box::new(UnreadFile::new(path, named_by, why)),
        }
    }
}
