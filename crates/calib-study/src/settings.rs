//! Which study, how it is run, and why it cannot be.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

/// Which study.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Study {
    /// Centers of rotation: paper §3.3.
    Cor,
    /// Axes of rotation and frames: paper §4 and §5.2.
    Aor,
}

impl Study {
    /// `cor` or `aor`: the word on the command line, and the stem of the files.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Cor => "cor",
            Self::Aor => "aor",
        }
    }
}

/// Settings of a study.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StudyOptions {
    /// Trials of an ordinary cell; slow methods take a stated part of them, error rates a multiple. 1500: efficiencies
    /// to about 0.005, one million fits for the study of centers.
    pub trials: u64,
    /// Seed of all draws.
    pub seed: u64,
    /// Threads; `None`: as many as there are processors.
    pub threads: Option<usize>,
    /// Folder of the state file `<study>.state.jsonl`, where finished scenes are kept; `None`: nothing is written.
    pub out: Option<PathBuf>,
    /// Keep the finished scenes of an earlier run with the same settings; otherwise start over.
    pub resume: bool,
    /// Run only the scenes whose id begins with one of these; empty: all. A part of the scenes is never saved.
    pub only: Vec<String>,
}

impl Default for StudyOptions {
    fn default() -> Self {
        Self {
            trials: 1500,
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
pub enum StudyError {
    /// No trials.
    #[error(
        "a study needs at least 1 trial of each cell, got {got}\n  help: give --trials 1 or more"
    )]
    NoTrials {
        /// Trials asked for.
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
    /// The state file belongs to another study or other settings.
    #[error(
        "{}: holds {found}, this run is {expected}\n  help: choose another folder with --out, or start over with --restart",
        path.display()
    )]
    OtherState {
        /// The file.
        path: PathBuf,
        /// Settings in the file.
        found: String,
        /// Settings of this run.
        expected: String,
    },
}
