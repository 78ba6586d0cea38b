//! The files that change, and where they go.

use std::path::PathBuf;

use calib_urdf::{ChangeRecord, Patched};

/// Where the changed files go.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Destination {
    /// Nowhere: a dry run.
    Nowhere,
    /// Over the target and the YAML that it loads.
    InPlace,
    /// A new file; a folder where more than one file changes.
    To(PathBuf),
}

/// One file that changes.
#[derive(Debug, Clone)]
pub struct FileChange {
    /// The file, as the caller named it or as it was found from there.
    pub path: PathBuf,
    /// Its text before.
    pub original: String,
    /// Its text after, and what differs.
    pub patched: Patched,
    /// What reverts it.
    pub record: ChangeRecord,
    /// Where it was written.
    pub written: Option<PathBuf>,
}
