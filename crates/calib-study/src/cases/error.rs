//! Why a case study cannot be run.

use calib_files::FileError;
use calib_pipeline::PipelineError;

/// Why a case study cannot be run. A robot that cannot be calibrated is a result, not an error.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CaseError {
    /// No robots.
    #[error("a case study needs at least 1 robot, got 0\n  help: give --trials 1 or more")]
    NoRobots,
    /// Threads cannot be started.
    #[error("cannot start {threads} threads: {source}\n  help: ask for fewer")]
    Threads {
        /// Threads asked for (0: one for each processor).
        threads: usize,
        /// Why.
        source: rayon::ThreadPoolBuildError,
    },
    /// The profile or the robot cannot be read.
    #[error(transparent)]
    Profile(#[from] PipelineError),
    /// The profile cannot be simulated.
    #[error("{file}: {source}")]
    Simulation {
        /// The profile.
        file: String,
        /// Why.
        source: Box<calib_sim::SimError>,
    },
    /// The state file cannot be used.
    #[error(transparent)]
    State(#[from] FileError),
    /// A result has no JSON form.
    #[error("a result cannot be written: {0}\n  help: report this as a defect")]
    Unwritable(#[from] serde_json::Error),
}
