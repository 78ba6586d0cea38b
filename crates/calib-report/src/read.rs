//! Reads the report of a folder of results.

use std::path::{Path, PathBuf};

use calib_files::{folder_of, input, is_unfinished};

use crate::{Report, ReportError, json};

/// Reports of hundreds of poses stay under a few megabytes; this is a recording given by mistake.
const LARGEST: u64 = 1 << 30;

/// Name of the report as data in a folder of results.
pub const REPORT: &str = "report.json";

/// Why a file is not a report that can be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum NotAReport {
    /// The system refused to read the file.
    #[error("{}: cannot be read: {source}\n  help: {}", path.display(), self.remedy())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// A run was stopped while it replaced the files of the folder.
    #[error(
        "{}: a run was stopped while it wrote here; the files are of two runs\n  help: {}",
        path.display(), self.remedy()
    )]
    Unfinished {
        /// The folder.
        path: PathBuf,
    },
    /// The file is not the JSON of a report.
    #[error("{}: is not a report: {source}\n  help: {}", path.display(), self.remedy())]
    Invalid {
        /// The file.
        path: PathBuf,
        /// Line, column and what was expected.
        source: ReportError,
    },
}

impl NotAReport {
    /// The file or folder.
    #[must_use]
    pub fn path(&self) -> &Path {
        match self {
            Self::Unreadable { path, .. }
            | Self::Unfinished { path }
            | Self::Invalid { path, .. } => path,
        }
    }

    /// What to do.
    #[must_use]
    pub fn remedy(&self) -> &'static str {
        match self {
            Self::Unfinished { .. } => "run the calibration again",
            _ => "give a report.json, or the folder, that `calib run` wrote",
        }
    }
}

/// The report at `path`: a folder of results, or its `report.json`.
///
/// # Errors
/// [`NotAReport`] with the file and the reason.
pub fn read_report(path: &Path) -> Result<Report, NotAReport> {
    let path = report_path(path);
    let folder = folder_of(&path);
    if is_unfinished(folder) {
        return Err(NotAReport::Unfinished {
            path: folder.to_path_buf(),
        });
    }
    let text = input::read_text(&path, LARGEST).map_err(|source| NotAReport::Unreadable {
        path: path.clone(),
        source,
    })?;
    json::read_report(&text).map_err(|source| NotAReport::Invalid { path, source })
}

/// Where the report of a folder of results lies; a path that is not a folder is the report itself.
#[must_use]
pub fn report_path(path: &Path) -> PathBuf {
    if path.is_dir() {
        path.join(REPORT)
    } else {
        path.to_path_buf()
    }
}
