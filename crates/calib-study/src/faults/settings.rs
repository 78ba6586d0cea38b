//! How the matrix is run.

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
