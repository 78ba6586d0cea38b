//! Why a table was not fitted: the place, what was found there, and what to do.

/// Why a table was not fitted.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FitError {
    /// The request does not go together, or names something that does not exist.
    #[error("{finding}\n  help: {remedy}")]
    Usage {
        /// What was found.
        finding: String,
        /// What to do.
        remedy: String,
    },
    /// A file does not hold what was asked of it.
    #[error("{file}: {finding}\n  help: {remedy}")]
    Data {
        /// The file.
        file: String,
        /// What was found.
        finding: String,
        /// What to do.
        remedy: String,
    },
    /// The table cannot be read.
    #[error(transparent)]
    Recording(#[from] calib_recording::Error),
    /// A plugin was not loaded, or its estimator failed.
    #[error("{0}\n  help: `calib plugins check PLUGIN` tests a plugin and lists what it offers")]
    Plugin(#[from] calib_plugin::PluginError),
}
