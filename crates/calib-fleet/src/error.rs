//! What can go wrong with fleets, shards and tables, and what to do.

use std::path::{Path, PathBuf};

use calib_files::FileError;
use calib_pipeline::ExitCode;

use crate::shard::{Difference, Shard};
use crate::store::error::StoreError;
use crate::table::TableFault;

/// What is wrong with the file of a shard.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ShardFault {
    /// It is torn, changed, or no table of this program.
    #[error("{0}")]
    Table(TableFault),
    /// It has other columns.
    #[error(
        "is a table, but not the file of a shard: its columns are not `unit`, `name` and `result`"
    )]
    Columns,
    /// It has more or fewer rows than its part of the work has units.
    #[error("has {found} rows, expected {expected}")]
    Rows {
        /// Units of its part.
        expected: u64,
        /// Rows of the file.
        found: u64,
    },
    /// A row is not the unit that comes next.
    #[error("unit {unit} is missing or out of order")]
    Order {
        /// The unit that was expected.
        unit: u64,
    },
    /// It belongs to another work.
    #[error(
        "belongs to another work: its {} is `{}`, that of the others `{}`",
        .0.of.word(), .0.found, .0.expected
    )]
    Foreign(Difference),
    /// It belongs to another work than the one that is asked for.
    #[error(
        "holds another work: its {} is `{}`, that of this call `{}`",
        .0.of.word(), .0.found, .0.expected
    )]
    OtherWork(Difference),
    /// The same part is there twice.
    #[error("is shard {shard}, and so is {}", first.display())]
    Doubled {
        /// The part.
        shard: Shard,
        /// The other file.
        first: PathBuf,
    },
    /// It is a part where the whole is needed.
    #[error("is shard {0}, not a whole work")]
    Part(Shard),
    /// A result cannot be read.
    #[error("the result of unit {unit} cannot be read: {source}")]
    Result {
        /// The unit.
        unit: u64,
        /// Why.
        source: serde_json::Error,
    },
}

/// The file of a shard that cannot be used.
#[derive(Debug, thiserror::Error)]
#[error("{}: {fault}\n  help: {}", path.display(), self.remedy())]
pub struct ShardError {
    /// The file.
    pub path: PathBuf,
    /// What is wrong.
    pub fault: Box<ShardFault>,
}

impl ShardError {
    pub(crate) fn new(path: &Path, fault: ShardFault) -> Self {
        Self {
            path: path.to_path_buf(),
            fault: Box::new(fault),
        }
    }

    /// What to do.
    #[must_use]
    pub fn remedy(&self) -> &'static str {
        match &*self.fault {
            ShardFault::Table(TableFault::Unreadable(error)) => match error.kind() {
                std::io::ErrorKind::IsADirectory => "name the files in it",
                std::io::ErrorKind::PermissionDenied => "grant read permission",
                _ => "correct the path",
            },
            ShardFault::Foreign(_) => {
                "leave it out, or run that shard again with the settings and inputs of the others"
            }
            ShardFault::OtherWork(_) => {
                "call with the settings and inputs that the shards were made with"
            }
            ShardFault::Doubled { .. } => "give each shard once",
            ShardFault::Part(_) => "merge all shards first: `calib merge SHARD... --out FILE`",
            ShardFault::Columns => "give files that a command with --shard wrote",
            _ => "leave it out if it is not a shard; otherwise remove it and run that shard again",
        }
    }
}

/// Why a fleet or a shard was not finished.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FleetError {
    /// A file was not written, or another program writes there.
    #[error(transparent)]
    File(#[from] FileError),
    /// The file of a shard cannot be used.
    #[error(transparent)]
    Shard(#[from] ShardError),
    /// A store cannot be used.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// A table cannot be made.
    #[error("a table {0}\n  help: report this as a defect")]
    Table(TableFault),
    /// A row of a robot that was calibrated is gone.
    #[error("{}: the row of this robot was removed or changed meanwhile\n  help: run the batch again", path.display())]
    Lost {
        /// The robot's folder.
        path: PathBuf,
    },
    /// Nothing to merge.
    #[error("no shards were given\n  help: name the files that commands with --shard wrote")]
    NoShards,
    /// Parts of the work are missing.
    #[error(
        "of {of} shards of `{kind}`, {} missing\n  help: run these again, with `--shard i/{of}`, and merge then",
        listed(missing)
    )]
    Missing {
        /// The work.
        kind: String,
        /// Which, from 1.
        missing: Vec<u64>,
        /// How many there are.
        of: u64,
    },
    /// Threads cannot be started.
    #[error("cannot start {threads} threads: {source}\n  help: ask for fewer")]
    Threads {
        /// Threads asked for (0: one for each processor).
        threads: usize,
        /// Why.
        source: rayon::ThreadPoolBuildError,
    },
    /// A result has no JSON form.
    #[error("a result cannot be written: {0}\n  help: report this as a defect")]
    Unwritable(#[from] serde_json::Error),
}

impl FleetError {
    pub(crate) fn unusable(path: &Path, fault: ShardFault) -> Self {
        ShardError::new(path, fault).into()
    }

    /// The exit code of the program.
    #[must_use]
    pub fn exit_code(&self) -> ExitCode {
        match self {
            Self::File(FileError::OtherState { .. }) => ExitCode::Usage,
            Self::File(_) | Self::Unwritable(_) | Self::Table(_) | Self::Lost { .. } => {
                ExitCode::NotWritten
            }
            Self::Shard(_) | Self::Missing { .. } => ExitCode::Data,
            Self::Store(error) => error.exit_code(),
            _ => ExitCode::Usage,
        }
    }

    /// The file that it is about.
    #[must_use]
    pub fn path(&self) -> Option<&Path> {
        match self {
            Self::File(error) => error.path(),
            Self::Shard(error) => Some(&error.path),
            Self::Lost { path } => Some(path),
            _ => None,
        }
    }
}

/// `3 is`, `3 and 5 are`, `3, 5, 6 and 40 others are`.
fn listed(numbers: &[u64]) -> String {
    /// As many as a line has room for.
    const SHOWN: usize = 12;
    let shown = numbers.iter().take(SHOWN).map(u64::to_string);
    let mut shown: Vec<String> = shown.collect();
    match numbers.len() - shown.len() {
        0 => {}
        1 => shown.extend(numbers.last().map(u64::to_string)),
        others => shown.push(format!("{others} others")),
    }
    let Some(last) = shown.pop() else {
        return String::new();
    };
    match shown.is_empty() {
        true => format!("{last} is"),
        false => format!("{} and {last} are", shown.join(", ")),
    }
}
