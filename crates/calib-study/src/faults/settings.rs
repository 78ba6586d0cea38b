//! How the matrix is run, and why it cannot be.

use std::path::PathBuf;

use super::fault::Fault;

/// Settings of the study.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FaultOptions {
    /// Cases of each cell; clean cells have four times as many.
    pub cases: u64,
    /// Seed of all draws.
    pub seed: u64,
    /// Threads; `None`: as many as there are processors.
    pub threads: Option<usize>,
    /// Folder of the state file, where finished cases are kept; `None`: nothing is written.
    pub out: Option<PathBuf>,
    /// Keep the finished cases of an earlier run with the same settings.
    pub resume: bool,
    /// Only these faults; empty: all.
    pub only: Vec<Fault>,
}

impl Default for FaultOptions {
    fn default() -> Self {
        Self {
            cases: 4,
            seed: 1,
            threads: None,
            out: None,
            resume: false,
            only: Vec::new(),
        }
    }
}

/// A study that cannot be run.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FaultError {
    /// No cases.
    #[error(
        "a study needs at least 1 case of each cell, got {got}\n  help: give --trials 1 or more"
    )]
    NoCases {
        /// Cases asked for.
        got: u64,
    },
    /// Threads cannot be started.
    #[error("cannot start {threads} threads: {source}\n  help: ask for fewer")]
    Threads {
        /// Threads asked for (0: one for each processor).
        threads: usize,
        /// Why.
        source: rayon::ThreadPoolBuildError,
    },
    /// A file cannot be read or written.
    #[error(transparent)]
    File(#[from] calib_files::FileError),
    /// A result has no JSON form.
    #[error("a result cannot be written: {0}\n  help: report this as a defect")]
    Unwritable(#[from] serde_json::Error),
}
