//! What can go wrong, and with which exit code the program ends.

use std::path::Path;

use crate::prepare::paths;

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
    /// A profile or URDF cannot be read.
    #[error("{path}: cannot be read: {source}\n  help: {remedy}")]
    Read {
        /// The file.
        path: String,
        /// Why.
        source: std::io::Error,
        /// What to do.
        remedy: String,
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
    #[error("{file}: {finding}\n  help: {remedy}")]
    Data {
        /// The file.
        file: String,
        /// What was found.
        finding: String,
        /// What to do.
        remedy: String,
    },
    /// The profile asks for something that does not go together.
    #[error("{finding}\n  help: {remedy}")]
    Usage {
        /// What was found.
        finding: String,
        /// What to do.
        remedy: String,
    },
    /// The solver refused the problem.
    #[error("the estimation problem cannot be stated: {0}")]
    Solve(#[from] calib_core::Error),
    /// The patched URDF is not what was asked for.
    #[error("{file}: the URDF cannot be patched: {text}")]
    Patch {
        /// The URDF.
        file: String,
        /// Why.
        text: String,
    },
    /// A text of a robot's description cannot be changed as asked.
    #[error("{0}")]
    Edit(calib_urdf::EditError),
    /// What was asked for should not be done with this result.
    #[error("{finding}\n  help: {remedy}")]
    Refused {
        /// What was found.
        finding: String,
        /// What to do.
        remedy: String,
    },
    /// A plugin or an estimator failed, or is not what the profile needs.
    #[error("{text}")]
    Plugin {
        /// What was found and what was needed.
        text: String,
        /// Usage, data or plugin: whose fault it is.
        code: ExitCode,
    },
    /// The report or scene could not be rendered.
    #[error("the report cannot be written: {0}")]
    Report(#[from] calib_report::ReportError),
}

// Not a `#[from]`: the message is the cause's own, which would then be said twice.
impl From<calib_urdf::EditError> for PipelineError {
    fn from(error: calib_urdf::EditError) -> Self {
        Self::Edit(error)
    }
}

impl PipelineError {
    /// The exit code of this error.
    #[must_use]
    pub fn exit_code(&self) -> ExitCode {
        match self {
            Self::Read { .. }
            | Self::NotText { .. }
            | Self::Profile(_)
            | Self::Urdf(_)
            | Self::Usage { .. } => ExitCode::Usage,
            Self::Recording(_) | Self::Data { .. } => ExitCode::Data,
            Self::Refused { .. } => ExitCode::VerdictFail,
            Self::Solve(_) => ExitCode::NotConverged,
            Self::Plugin { code, .. } => *code,
            Self::Edit(_) | Self::Patch { .. } | Self::Report(_) => ExitCode::NotWritten,
        }
    }

    /// What to do, for an error whose text does not say it in a `help:` line of its own.
    #[must_use]
    pub fn remedy(&self) -> &'static str {
        match self {
            Self::Solve(_) => "look at what `calib check` says of the profile and the recordings",
            Self::Plugin { .. } => {
                "`calib plugins` lists what there is, `calib plugins check PLUGIN` tests a plugin"
            }
            Self::Patch { .. } => "look at the names under `outputs`, and at the URDF there",
            Self::Urdf(_) => "correct it there, or export the nominal URDF again",
            Self::Edit(_) => "nothing was written; give the expanded URDF",
            Self::Report(_) => {
                "look at what `calib check` says; the results are not finite or not whole"
            }
            _ => "`calib help` shows the commands and what they take",
        }
    }

    pub(crate) fn read(path: &Path, source: std::io::Error) -> Self {
        Self::Read {
            remedy: paths::reading(path, &source),
            path: path.display().to_string(),
            source,
        }
    }
}
