//! Why a report is not shown.

use std::path::PathBuf;

/// Why a page is not shown.
#[derive(Debug, thiserror::Error)]
pub enum ViewError {
    /// There is no report.
    #[error("{}: no report to show\n  help: name a folder that `calib run` wrote, or a page in it", path.display())]
    NoReport {
        /// What was looked for.
        path: PathBuf,
    },
    /// The port is taken, or not allowed.
    #[error(
        "port {port} of 127.0.0.1 cannot be served: {source}\n  help: name another one with --port, or none"
    )]
    Port {
        /// The port.
        port: u16,
        /// Why.
        source: std::io::Error,
    },
}
