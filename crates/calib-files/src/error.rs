//! Why a file was not written, and what to do.

use std::io::{Error, ErrorKind};
use std::path::{Path, PathBuf};

use crate::name::NameFault;

/// Why a file was not written; the file that was there before is untouched.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FileError {
    /// The system refused.
    #[error("{}: cannot be written: {source}\n  help: {}", path.display(), self.remedy())]
    Write {
        /// The file or folder.
        path: PathBuf,
        /// Why.
        source: Error,
    },
    /// The system refused to read a state file.
    #[error("{}: cannot be read: {source}\n  help: {}", path.display(), self.remedy())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: Error,
    },
    /// The file that would be replaced may not be written to, by its own permissions.
    #[error("{0}: the file is write-protected\n  help: allow writing (`chmod u+w {0}`), or change a copy", path.display())]
    Protected {
        /// The file.
        path: PathBuf,
    },
    /// A file that must not exist is there.
    #[error("{} exists already\n  help: {}", path.display(), self.remedy())]
    Exists {
        /// The file.
        path: PathBuf,
    },
    /// A file of the folder of results was not written by this program.
    #[error("{} exists already\n  help: {}", path.display(), self.remedy())]
    Foreign {
        /// The file.
        path: PathBuf,
    },
    /// A file of the folder of results was replaced by something else, after this program had written it.
    #[error("{} is not the file any more that this program wrote there\n  help: {}", path.display(), self.remedy())]
    Replaced {
        /// The file.
        path: PathBuf,
    },
    /// Another program writes there.
    #[error("{}: another run of this program is writing there\n  help: {}", path.display(), self.remedy())]
    Busy {
        /// The folder or file.
        path: PathBuf,
    },
    /// No file can have this name.
    #[error("no file can be called {name:?}: {fault}\n  help: {}", self.remedy())]
    Name {
        /// The name.
        name: String,
        /// Why.
        fault: NameFault,
    },
    /// Two results have one name.
    #[error("two results would be written to `{name}`\n  help: {}", self.remedy())]
    SameName {
        /// The name.
        name: String,
    },
    /// A state file belongs to a computation with other settings.
    #[error("{}: it holds {found}, expected {expected}\n  help: {}", path.display(), self.remedy())]
    OtherState {
        /// The file.
        path: PathBuf,
        /// Its header line.
        found: String,
        /// The header line of this computation.
        expected: String,
    },
}

impl FileError {
    /// What to do.
    #[must_use]
    pub fn remedy(&self) -> &'static str {
        match self {
            Self::Write { path, source } => cannot_write(path, source),
            Self::Read { .. } => "grant read permission, or choose another folder with --out",
            Self::Protected { .. } => "allow writing, or change a copy",
            Self::Exists { .. } => "choose another name, or move it away",
            Self::Foreign { .. } => {
                "it was not made by this program: choose another folder with --out"
            }
            Self::Replaced { .. } => {
                "it would be lost: move it away, or choose another folder with --out"
            }
            Self::Busy { .. } => "wait until it has ended, or choose another folder with --out",
            Self::Name { .. } => "choose another name",
            Self::SameName { .. } => "give each output of the profile a name of its own",
            Self::OtherState { .. } => {
                "choose another folder with --out, or start over with --restart"
            }
        }
    }

    /// The file or folder.
    #[must_use]
    pub fn path(&self) -> Option<&Path> {
        match self {
            Self::Write { path, .. }
            | Self::Read { path, .. }
            | Self::Protected { path }
            | Self::Exists { path }
            | Self::Foreign { path }
            | Self::Replaced { path }
            | Self::Busy { path }
            | Self::OtherState { path, .. } => Some(path),
            Self::Name { .. } | Self::SameName { .. } => None,
        }
    }

    pub(crate) fn write(path: &Path) -> impl FnOnce(Error) -> Self + use<> {
        let path = path.to_path_buf();
        move |source| Self::Write { path, source }
    }
}

/// What to do about a file or folder that cannot be written.
#[must_use]
pub fn cannot_write(path: &Path, source: &Error) -> &'static str {
    if path.is_dir() {
        return "it is a folder: name a file in it";
    }
    match source.kind() {
        ErrorKind::NotFound => "make its folder first, or correct the path",
        ErrorKind::PermissionDenied => "choose a folder with write permission, or grant it",
        ErrorKind::AlreadyExists | ErrorKind::NotADirectory => {
            "a file stands where a folder is needed: choose another folder"
        }
        ErrorKind::StorageFull => "make room, or choose another disk",
        _ => "choose another place",
    }
}
