//! Which error it is, and where, for programs.

use std::path::Path;

use calib_apply::ApplyError;
use calib_capture::CaptureError;
use calib_drift::DriftError;
use calib_export::ExportError;
use calib_files::FileError;
use calib_fit::FitError;
use calib_fleet::FleetError;
use calib_init::InitError;
use calib_pipeline::PipelineError;
use calib_plan::PlanError;
use calib_recording::At;
use calib_twin::TwinError;
use serde::Serialize;

use super::CliError;
use crate::commands::view::error::ViewError;

/// Where an error is.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Place {
    /// The file or folder.
    pub file: String,
    /// Line, from 1.
    pub line: Option<u64>,
    /// Column, from 1: a character of a text.
    pub column: Option<u64>,
}

impl Place {
    /// A file or folder as a whole.
    pub fn of(file: impl Into<String>) -> Self {
        Self {
            file: file.into(),
            line: None,
            column: None,
        }
    }

    fn path(path: &Path) -> Self {
        Self::of(path.display().to_string())
    }

    fn at(file: &str, (line, column): (usize, usize)) -> Self {
        Self {
            file: file.to_owned(),
            line: Some(line as u64),
            column: Some(column as u64),
        }
    }
}

impl CliError {
    /// Which error it is; the words stay for later versions.
    #[must_use]
    pub fn id(&self) -> &'static str {
        match self {
            Self::Pipeline(error)
            | Self::Plan(PlanError::Pipeline(error))
            | Self::Init(InitError::Pipeline(error))
            | Self::Twin(
                TwinError::Pipeline(error) | TwinError::Plan(PlanError::Pipeline(error)),
            ) => of_pipeline(error),
            Self::Init(InitError::Urdf(_)) => "urdf",
            Self::Init(InitError::Recording(_)) => "recording",
            Self::Init(_) => "init",
            Self::Plan(_)
            | Self::NotASigma { .. }
            | Self::NotATime { .. }
            | Self::Twin(TwinError::Plan(_)) => "plan",
            Self::Twin(TwinError::State(error)) => of_file(error),
            Self::Twin(TwinError::OtherSession { .. }) => "other-state",
            Self::Twin(_) | Self::NotANoiseFactor { .. } => "twin",
            Self::Apply(error) => of_apply(error),
            Self::Drift(_) => "drift",
            Self::Export(ExportError::Table(_)) => "recording",
            Self::Export(_) => "model",
            Self::NotABound { .. } => "correct",
            Self::NoColumnMap { .. } => "profile",
            Self::OtherPlugin { .. } => "plugin",
            Self::Fit(_) => "fit",
            Self::File(error) => of_file(error),
            Self::Recording(_) => "recording",
            Self::Table { .. } => "table-not-written",
            Self::Simulation { .. } => "simulation",
            Self::Json { .. } | Self::Report(_) => "report-not-written",
            Self::Fleet(FleetError::File(error)) => of_file(error),
            Self::Fleet(FleetError::Shard(_) | FleetError::Missing { .. }) => "shard",
            Self::Fleet(FleetError::Store(_)) => "store",
            Self::Fleet(_) | Self::Batch(_) => "fleet",
            Self::Study(_) | Self::Cases(_) | Self::NoEstimatorStudied => "study",
            Self::Record(_) => "record",
            Self::View(_) => "view",
            Self::Capture(_) => "capture",
            Self::OnlyListed => "plugin",
            Self::NewPlugin(_) => "new-plugin",
            Self::Stdout(_) => "output-lost",
        }
    }

    /// Where it is.
    #[must_use]
    pub fn place(&self) -> Option<Place> {
        Some(match self {
            Self::Pipeline(error)
            | Self::Plan(PlanError::Pipeline(error))
            | Self::Init(InitError::Pipeline(error))
            | Self::Twin(
                TwinError::Pipeline(error) | TwinError::Plan(PlanError::Pipeline(error)),
            ) => {
                return place_of_pipeline(error);
            }
            Self::Init(InitError::Urdf(error)) => place_of_urdf(error)?,
            Self::Init(InitError::Recording(error)) => place_of_recording(error),
            Self::Init(error) => Place::of(error.file()?.to_owned()),
            Self::Twin(TwinError::State(error)) => place_of_file(error)?,
            Self::Twin(TwinError::Plan(error)) => Place::of(error.file()?.to_owned()),
            Self::Twin(error) => Place::of(error.file()?.to_owned()),
            Self::Plan(error) => Place::of(error.file()?.to_owned()),
            Self::Apply(ApplyError::Read(error)) => place_of_urdf(error)?,
            Self::Apply(error) => Place::path(error.path()?),
            Self::File(error) => place_of_file(error)?,
            Self::Fit(FitError::Recording(error)) => place_of_recording(error),
            Self::Fit(FitError::Data { file, .. }) => Place::of(file.clone()),
            Self::View(ViewError::NoReport { path }) => Place::path(path),
            Self::Capture(CaptureError::Table(error)) => Place::path(error.path()?),
            Self::Fleet(FleetError::Store(error)) => Place::of(error.url.clone()),
            Self::Fleet(error) => Place::path(error.path()?),
            Self::Batch(error) => Place::path(error.path()?),
            Self::Drift(DriftError::Report(error)) => Place::path(error.path()),
            Self::Export(ExportError::Table(error)) => place_of_recording(error),
            Self::Export(error) => {
                let (file, line) = error.place()?;
                Place {
                    line,
                    ..Place::of(file)
                }
            }
            Self::Recording(error) => place_of_recording(error),
            Self::Table { file, .. } | Self::Simulation { file, .. } => Place::of(file.clone()),
            _ => return None,
        })
    }

    /// What to do: the text's own help, or [`CliError::remedy`].
    #[must_use]
    pub fn remedy_of(&self, said: &str) -> Option<String> {
        let own = said.lines().find_map(|line| line.strip_prefix("  help: "));
        own.or(self.remedy()).map(str::to_owned)
    }
}

/// The id of an error of a run.
pub fn of_pipeline(error: &PipelineError) -> &'static str {
    match error {
        PipelineError::Read { .. } => "file-not-read",
        PipelineError::NotText { .. } => "not-text",
        PipelineError::Profile(_) => "profile",
        PipelineError::Urdf(_) => "urdf",
        PipelineError::Recording(_) => "recording",
        PipelineError::Data { .. } => "recording-not-usable",
        PipelineError::NotSimulated { .. } => "not-simulated",
        PipelineError::NoOrigins { .. } => "no-origins",
        PipelineError::Origin { .. } => "origin",
        PipelineError::Solve(_) => "not-solved",
        PipelineError::Patch { .. } | PipelineError::Edit(_) => "urdf-not-patched",
        PipelineError::Plugin(_) => "plugin",
        PipelineError::Report(_) => "report-not-written",
    }
}

fn of_apply(error: &ApplyError) -> &'static str {
    match error {
        ApplyError::Read(_) => "urdf",
        ApplyError::Edit(_) => "urdf-not-patched",
        ApplyError::File(error) => of_file(error),
        ApplyError::NotAccepted { .. } => "not-accepted",
        ApplyError::ChangedAlready { .. } => "changed-already",
        ApplyError::OtherOrigins { .. } => "other-origins",
        ApplyError::OtherKinematics { .. } => "other-kinematics",
        ApplyError::PartlyApplied { .. } => "partly-applied",
        ApplyError::Stopped { .. } => "apply-stopped",
        ApplyError::NoRecord { .. } | ApplyError::NotARecord { .. } => "no-record",
        ApplyError::Revert { .. } => "not-reverted",
        _ => "apply",
    }
}

fn of_file(error: &FileError) -> &'static str {
    match error {
        FileError::Busy { .. } => "folder-busy",
        FileError::Name { .. } | FileError::SameName { .. } => "file-name",
        FileError::Protected { .. } => "write-protected",
        FileError::Exists { .. } | FileError::Foreign { .. } | FileError::Replaced { .. } => {
            "file-exists"
        }
        FileError::OtherState { .. } => "other-state",
        _ => "file-not-written",
    }
}

fn place_of_pipeline(error: &PipelineError) -> Option<Place> {
    Some(match error {
        PipelineError::Read { file } => Place::of(file.path.clone()),
        PipelineError::NotText { path, .. } => Place::of(path.clone()),
        PipelineError::Profile(error) => {
            let first = error.problems.first().and_then(|p| p.place);
            first.map_or_else(
                || Place::of(error.file()),
                |p| Place::at(error.file(), (p.line, p.column)),
            )
        }
        PipelineError::Urdf(error) => place_of_urdf(error)?,
        PipelineError::Recording(error) => place_of_recording(error),
        PipelineError::Data { file, .. }
        | PipelineError::Patch { file, .. }
        | PipelineError::NoOrigins { file } => Place::of(file.clone()),
        _ => return None,
    })
}

fn place_of_urdf(error: &calib_urdf::ReadError) -> Option<Place> {
    let first = error.problems.first().and_then(|p| p.place);
    Some(first.map_or_else(
        || Place::of(error.file.clone()),
        |p| Place::at(&error.file, (p.line, p.column)),
    ))
}

fn place_of_recording(error: &calib_recording::Error) -> Place {
    let line = match &error.at {
        At::Line(line) | At::Cell { line, .. } => Some(*line),
        At::File | At::Byte(_) => None,
    };
    Place {
        line,
        ..Place::of(error.file.clone())
    }
}

fn place_of_file(error: &FileError) -> Option<Place> {
    error.path().map(Place::path)
}
