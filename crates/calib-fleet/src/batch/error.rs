//! Why a batch cannot be run. What stops one robot is a row, not an error.

use std::path::{Path, PathBuf};

use calib_files::FileError;
use calib_pipeline::ExitCode;

use crate::error::{FleetError, ShardError};

/// What is wrong with a fleet.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FleetFault {
    /// The list cannot be read.
    #[error(
        "cannot be read: {0}\n  help: give a list of robots in YAML, or a quoted pattern of profiles: 'fleet/*.yaml'"
    )]
    Unreadable(#[source] std::io::Error),
    /// It is not a list of robots.
    #[error(
        "is not a list of robots: {0}\n  help: write `calib_fleet: 1` and below `robots:` a line `- {{profile: robots/r1.yaml}}` for each; for a single robot use `calib run`"
    )]
    NotAList(String),
    /// A list of another version.
    #[error(
        "is a list of version {0}, expected `calib_fleet: 1`\n  help: use the version of calib that it was written for"
    )]
    Version(u32),
    /// No robots.
    #[error("names no robot\n  help: correct the pattern, or add robots to the list")]
    Empty,
    /// Where an earlier batch should be.
    #[error(
        "is no folder of an earlier batch: it has no folder `robots`\n  help: name the folder that `calib batch --out` wrote"
    )]
    NoBatch,
    /// A name that no folder can have.
    #[error("no folder can be called {0:?}\n  help: give that robot another `name`")]
    Name(String),
    /// Two robots have one name.
    #[error("two robots are called `{name}`: {} and {}\n  help: list them in YAML, each with a `name` of its own", profiles[0].display(), profiles[1].display())]
    SameName {
        /// The name.
        name: String,
        /// Their profiles.
        profiles: [PathBuf; 2],
    },
}

/// Why a batch was not finished.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BatchError {
    /// The fleet.
    #[error("{fleet}: {fault}")]
    Fleet {
        /// As it was given.
        fleet: String,
        /// What is wrong.
        fault: FleetFault,
    },
    /// A shard was made from a file that is another one now.
    #[error(
        "{}: the shard with robot `{robot}` was made from another version of this file\n  help: make that shard again with `--shard I/N`, and merge again",
        path.display()
    )]
    Changed {
        /// The robot.
        robot: String,
        /// The file.
        path: PathBuf,
    },
    /// Files, shards and threads.
    #[error(transparent)]
    Work(#[from] FleetError),
}

impl From<FileError> for BatchError {
    fn from(error: FileError) -> Self {
        Self::Work(error.into())
    }
}

impl From<ShardError> for BatchError {
    fn from(error: ShardError) -> Self {
        Self::Work(error.into())
    }
}

impl From<serde_json::Error> for BatchError {
    fn from(error: serde_json::Error) -> Self {
        Self::Work(error.into())
    }
}

impl BatchError {
    pub(super) fn fleet(fleet: &str, fault: FleetFault) -> Self {
        Self::Fleet {
            fleet: fleet.to_owned(),
            fault,
        }
    }

    /// The exit code of the program.
    #[must_use]
    pub fn exit_code(&self) -> ExitCode {
        match self {
            Self::Fleet { .. } => ExitCode::Usage,
            Self::Changed { .. } => ExitCode::Data,
            Self::Work(error) => error.exit_code(),
        }
    }

    /// The file that it is about.
    #[must_use]
    pub fn path(&self) -> Option<&Path> {
        match self {
            Self::Fleet { fleet, .. } => Some(Path::new(fleet)),
            Self::Changed { path, .. } => Some(path),
            Self::Work(error) => error.path(),
        }
    }
}
