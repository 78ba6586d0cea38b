//! Why a session has no twin.

use calib_files::FileError;
use calib_pipeline::{ExitCode, PipelineError};
use calib_plan::PlanError;

/// Why a session has no twin.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TwinError {
    /// The profile, the robot or its recordings.
    #[error(transparent)]
    Pipeline(#[from] PipelineError),
    /// The plan.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// No trials.
    #[error("a twin needs at least 1 trial, got 0\n  help: give --trials 200")]
    NoTrials,
    /// A plan for another robot.
    #[error(
        "{file}: the plan is for `{planned}`, the profile for `{robot}`\n  help: plan with this profile: `calib plan {}`",
        calib_finding::shell_path(file)
    )]
    OtherRobot {
        /// The profile.
        file: String,
        /// The robot of the plan.
        planned: String,
        /// That of the profile.
        robot: String,
    },
    /// Closed forms state no noise that could be replayed.
    #[error(
        "{file}: `solve: {{method: paper}}` finds no noise that could be simulated\n  help: set `method: ml` in a copy of the profile"
    )]
    NoLikelihood {
        /// The profile.
        file: String,
    },
    /// Touches are joint readings: another robot would have had other ones.
    #[error(
        "{file}: `contacts` cannot be simulated: another robot touches in other postures\n  help: leave `contacts` out of a copy of the profile"
    )]
    Contacts {
        /// The profile.
        file: String,
    },
    /// There is nothing whose twin it could be.
    #[error(
        "{file}: nothing is recorded, and there is neither a plan nor a `simulate` section\n  help: give `--plan plan.yaml` from `calib plan`, or add `simulate`"
    )]
    NothingToSimulate {
        /// The profile.
        file: String,
    },
    /// A folder of results whose profile is elsewhere.
    #[error(
        "{folder}: the profile `{profile}` that it was made from is not there, or was changed\n  help: give the profile itself: `calib twin {}`", calib_finding::shell_path(&format!("path/to/{profile}"))
    )]
    NoProfile {
        /// The folder.
        folder: String,
        /// The profile's name.
        profile: String,
    },
    /// Recordings that are not those of the results.
    #[error(
        "{folder}: `{file}` is not the file that the results were made from\n  help: run `calib run` again"
    )]
    Changed {
        /// The folder.
        folder: String,
        /// The file.
        file: String,
    },
    /// Results that cannot be read.
    #[error(transparent)]
    Results(#[from] calib_report::NotAReport),
    /// Threads cannot be started.
    #[error("cannot start {threads} threads: {source}\n  help: ask for fewer")]
    Threads {
        /// Threads asked for (0: one for each processor).
        threads: usize,
        /// Why.
        source: rayon::ThreadPoolBuildError,
    },
    /// The state file cannot be used.
    #[error(transparent)]
    State(#[from] FileError),
    /// A folder with trials of another session.
    #[error(
        "{file}: the trials in this folder are of another session: {} {}\n  help: choose another folder with --out, or start over with --restart",
        .what.join(", "), if .what.len() == 1 { "differs" } else { "differ" }
    )]
    OtherSession {
        /// The file of the trials.
        file: String,
        /// What differs.
        what: Vec<String>,
    },
    /// A result has no JSON form.
    #[error("a result cannot be written: {0}\n  help: report this as a defect")]
    Unwritable(#[from] serde_json::Error),
}

impl TwinError {
    /// The exit code of the program.
    #[must_use]
    pub fn exit_code(&self) -> ExitCode {
        match self {
            Self::Pipeline(error) => error.exit_code(),
            Self::Plan(error) => error.exit_code(),
            Self::OtherRobot { .. } | Self::Changed { .. } | Self::Results(_) => ExitCode::Data,
            Self::State(FileError::OtherState { .. }) => ExitCode::Usage,
            Self::State(_) | Self::Unwritable(_) => ExitCode::NotWritten,
            _ => ExitCode::Usage,
        }
    }

    /// The file that it is about; `None`: the error inside knows.
    #[must_use]
    pub fn file(&self) -> Option<&str> {
        match self {
            Self::OtherRobot { file, .. }
            | Self::OtherSession { file, .. }
            | Self::NoLikelihood { file }
            | Self::Contacts { file }
            | Self::NothingToSimulate { file } => Some(file),
            Self::NoProfile { folder, .. } | Self::Changed { folder, .. } => Some(folder),
            _ => None,
        }
    }
}
