//! What a command ends with: an error of one of the libraries, its exit code and its remedy.

pub mod place;

use calib_apply::ApplyError;
use calib_capture::{CaptureError, SourceError};
use calib_drift::DriftError;
use calib_export::ExportError;
use calib_files::FileError;
use calib_fit::FitError;
use calib_fleet::FleetError;
use calib_fleet::batch::BatchError;
use calib_init::InitError;
use calib_pipeline::{ExitCode, PipelineError};
use calib_plan::PlanError;
use calib_plugin::NewProjectError;
use calib_study::StudyError;
use calib_study::cases::CaseError;
use calib_twin::TwinError;
use calib_urdf::EditError;

use crate::commands::record::error::RecordError;
use crate::commands::view::error::ViewError;

/// Where the commands are explained.
pub const HELP: &str = "`calib help` shows the commands and what they take";

/// Why a command failed.
#[derive(Debug, thiserror::Error)]
pub enum CliError {
    /// Of a stage of the calibration.
    #[error(transparent)]
    Pipeline(#[from] PipelineError),
    /// Of `calib apply`, `diff` and `revert`.
    #[error(transparent)]
    Apply(#[from] ApplyError),
    /// Of `calib drift`.
    #[error(transparent)]
    Drift(#[from] DriftError),
    /// Of `calib predict`, `correct` and `export`.
    #[error(transparent)]
    Export(#[from] ExportError),
    /// Another plugin than the one that the run used.
    #[error(
        "joint {joint}: its effect `{effect}` was found with the plugin {needed}; the one that is loaded is {found}\n  help: give the file that the run used, or run the calibration again with this one"
    )]
    OtherPlugin {
        /// The effect.
        effect: String,
        /// The joint.
        joint: String,
        /// Name, version and hash of the one that the run used.
        needed: String,
        /// The same of the one that is loaded.
        found: String,
    },
    /// A bound on corrections is none.
    #[error("{bound} is not a bound\n  help: give a number above 0, as `--largest-deg 3`")]
    NotABound {
        /// What was given.
        bound: f64,
    },
    /// A profile has no column map for a table.
    #[error("{file}: {finding}\n  help: {remedy}")]
    NoColumnMap {
        /// The profile.
        file: String,
        /// What there is.
        finding: String,
        /// What to do.
        remedy: &'static str,
    },
    /// Of `calib fit`.
    #[error(transparent)]
    Fit(#[from] FitError),
    /// Of `calib init`.
    #[error(transparent)]
    Init(#[from] InitError),
    /// Of `calib plan`.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// Of `calib twin`.
    #[error(transparent)]
    Twin(#[from] TwinError),
    /// A σ that is asked for is none.
    #[error("{sigma} is not a σ\n  help: give a number above 0, in mm: `--sigma-mm 0.1`")]
    NotASigma {
        /// What was given.
        sigma: f64,
    },
    /// A time that is asked for is none.
    #[error("{time} is not a time\n  help: give a number of seconds above 0: `--path-time-s 120`")]
    NotATime {
        /// What was given.
        time: f64,
    },
    /// A factor of the noise that is none.
    #[error(
        "the noise cannot be multiplied by {factor}\n  help: give a number above 0: `--noise-times 2`"
    )]
    NotANoiseFactor {
        /// What was given.
        factor: f64,
    },
    /// Estimators of plugins are tried in studies of estimators.
    #[error(
        "--plugin is for the studies of estimators\n  help: calib study cor|aor --plugin PLUGIN; plugins of a profile are named in it"
    )]
    NoEstimatorStudied,
    /// Of `calib batch`.
    #[error(transparent)]
    Batch(BatchError),
    /// Of work that is divided into shards.
    #[error(transparent)]
    Fleet(#[from] FleetError),
    /// A profile is of no use to check or create a plugin.
    #[error(
        "--profile lists what the plugins of a profile offer; it is not for `check`, `new` and `header`\n  help: calib plugins --profile PROFILE"
    )]
    OnlyListed,
    /// A file was not written.
    #[error(transparent)]
    File(#[from] FileError),
    /// A recording cannot be read.
    #[error(transparent)]
    Recording(#[from] calib_recording::Error),
    /// A recording cannot be written as a table.
    #[error("{file}: {source}\n  help: {remedy}")]
    Table {
        /// The recording.
        file: String,
        /// Why.
        source: calib_recording::NotWritten,
        /// What to do.
        remedy: &'static str,
        /// Whether the data or the call are at fault.
        code: ExitCode,
    },
    /// The profile cannot be simulated.
    #[error("{file}: {source}")]
    Simulation {
        /// The profile.
        file: String,
        /// Why.
        source: Box<calib_sim::SimError>,
    },
    /// Something has no JSON form.
    #[error("{what} cannot be written: {source}\n  help: {remedy}")]
    Json {
        /// What.
        what: &'static str,
        /// Why.
        source: serde_json::Error,
        /// What to do.
        remedy: &'static str,
    },
    /// A report has no text or JSON form.
    #[error("the report cannot be written: {0}")]
    Report(#[from] calib_report::ReportError),
    /// Of `calib study cor`, `aor` and `faults`.
    #[error(transparent)]
    Study(#[from] StudyError),
    /// Of `calib study justin` and `ripley`.
    #[error(transparent)]
    Cases(#[from] CaseError),
    /// `calib record` was asked for what does not go together.
    #[error("{0}")]
    Record(#[from] RecordError),
    /// A capture was stopped by its source or its file.
    #[error("{0}")]
    Capture(#[from] CaptureError),
    /// Of `calib view`.
    #[error(transparent)]
    View(#[from] ViewError),
    /// A plugin project cannot be made.
    #[error(
        "{0}\n  help: calib plugins new NAME --kind center|axis|reader|report|effect --lang rust|c --out FOLDER"
    )]
    NewPlugin(NewProjectError),
    /// What a command printed is lost.
    #[error(
        "standard output cannot be written: {0}\n  help: make room, or send the output elsewhere"
    )]
    Stdout(std::io::Error),
}

// Not a `#[from]`: what is wrong with a shard or a file is the same error in every command.
impl From<BatchError> for CliError {
    fn from(error: BatchError) -> Self {
        match error {
            BatchError::Work(error) => Self::Fleet(error),
            error => Self::Batch(error),
        }
    }
}

impl From<calib_fleet::ShardError> for CliError {
    fn from(error: calib_fleet::ShardError) -> Self {
        Self::Fleet(error.into())
    }
}

// Not a `#[from]`: a file that cannot be written is the same error in every command.
impl From<NewProjectError> for CliError {
    fn from(error: NewProjectError) -> Self {
        match error {
            NewProjectError::File(error) => Self::File(error),
            error => Self::NewPlugin(error),
        }
    }
}

impl CliError {
    /// The exit code of this error.
    #[must_use]
    pub fn exit_code(&self) -> ExitCode {
        match self {
            Self::Pipeline(error) => error.exit_code(),
            Self::Plan(error) => error.exit_code(),
            Self::Init(error) => error.exit_code(),
            Self::Twin(error) => error.exit_code(),
            Self::Fleet(error) => error.exit_code(),
            Self::Batch(error) => error.exit_code(),
            Self::Export(
                ExportError::Name { .. } | ExportError::Tool { .. } | ExportError::Unfit { .. },
            ) => ExitCode::Usage,
            Self::Export(_) => ExitCode::Data,
            Self::Apply(error) => of_apply(error),
            Self::Drift(error) if error.is_refusal() => ExitCode::NotObservable,
            Self::Drift(DriftError::Unwritable(_)) | Self::Report(_) | Self::Stdout(_) => {
                ExitCode::NotWritten
            }
            Self::Drift(_)
            | Self::Recording(_)
            | Self::Fit(FitError::Data { .. } | FitError::Recording(_)) => ExitCode::Data,
            Self::Fit(FitError::Plugin(error)) => calib_pipeline::error::exit_code_of(error),
            Self::File(error)
            | Self::Study(StudyError::File(error))
            | Self::Cases(CaseError::State(error)) => of_file(error),
            Self::Table { code, .. } => *code,
            Self::Cases(CaseError::Profile(error)) => error.exit_code(),
            Self::Capture(CaptureError::Source(SourceError::Port { .. })) => ExitCode::Usage,
            Self::Capture(CaptureError::Source(_)) => ExitCode::Data,
            Self::Capture(CaptureError::Table(_)) => ExitCode::NotWritten,
            Self::NotASigma { .. }
            | Self::NotATime { .. }
            | Self::NotANoiseFactor { .. }
            | Self::NotABound { .. }
            | Self::NoColumnMap { .. }
            | Self::OtherPlugin { .. }
            | Self::Simulation { .. }
            | Self::Json { .. }
            | Self::Fit(_)
            | Self::Study(_)
            | Self::Cases(_)
            | Self::Record(_)
            | Self::View(_)
            | Self::NoEstimatorStudied
            | Self::OnlyListed
            | Self::NewPlugin(_) => ExitCode::Usage,
        }
    }

    /// What to do, for an error whose text does not say it in a `help:` line of its own.
    #[must_use]
    pub fn remedy(&self) -> Option<&'static str> {
        match self {
            Self::Pipeline(error)
            | Self::Plan(PlanError::Pipeline(error))
            | Self::Init(InitError::Pipeline(error))
            | Self::Twin(
                TwinError::Pipeline(error) | TwinError::Plan(PlanError::Pipeline(error)),
            ) => Some(error.remedy()),
            Self::Apply(ApplyError::Read(_)) | Self::Init(InitError::Urdf(_)) => {
                Some("correct it there, or export the nominal URDF again")
            }
            Self::Apply(ApplyError::Edit(_)) => Some("nothing was written; give the expanded URDF"),
            Self::Report(_) => {
                Some("look at what `calib check` says; the results are not finite or not whole")
            }
            Self::Capture(_) => None,
            _ => Some(HELP),
        }
    }
}

fn of_apply(error: &ApplyError) -> ExitCode {
    match error {
        ApplyError::Read(_) | ApplyError::YamlUnused { .. } | ApplyError::Exchanged { .. } => {
            ExitCode::Usage
        }
        ApplyError::NotAccepted { .. } => ExitCode::VerdictFail,
        ApplyError::File(error) => of_file(error),
        // A file that was given and is not what it should be.
        ApplyError::Edit(EditError::Read(_) | EditError::Yaml { .. }) => ExitCode::Usage,
        ApplyError::Edit(_) | ApplyError::Unwritable(_) => ExitCode::NotWritten,
        _ => ExitCode::Data,
    }
}

fn of_file(error: &FileError) -> ExitCode {
    match error {
        FileError::SameName { .. } | FileError::Name { .. } | FileError::OtherState { .. } => {
            ExitCode::Usage
        }
        _ => ExitCode::NotWritten,
    }
}
