//! A folder of results as a transaction.
//!
//! ```text
//! lock · stage every file · list old and new names as "unfinished" · rename · list · unlock
//! ```
//!
//! A program that is stopped anywhere leaves whole files, old or new. The list names every file before it is in its place, so
//! that the next run may replace it; while the list says "unfinished", [`is_unfinished`] tells readers of the folder.

use std::fs::{File, TryLockError};
use std::io::{self, ErrorKind, Read as _, Write};
use std::path::{Path, PathBuf};

use crate::disk::{self, is_there};
use crate::error::FileError;
use crate::file::{OutputFile, check_names, names};
use crate::folder::make_folders;
use crate::input;
use crate::name::{MANIFEST, check_name};
use crate::staged::{Staged, clean};

/// First line of the list while its files are replaced.
const UNFINISHED: &str = "# unfinished: run it again";

/// A list of more bytes is not ours: names of some dozen files take a few kilobytes.
const LARGEST_MANIFEST: u64 = 1 << 20;

/// A folder that results will be written to, locked against other runs until they are written.
///
/// Dropped before, it leaves nothing behind: folders that it made are removed if they are empty.
#[derive(Debug)]
pub struct ResultsFolder {
    /// Names of files that must not remain from an earlier run.
    outdated: Vec<String>,
    /// How a file begins that may be replaced by one that begins so.
    over: Option<String>,
    folder: PathBuf,
    /// The folders that were made, outermost first.
    made: Vec<PathBuf>,
    lock: Option<File>,
}

/// A file that is too large to be held in memory, written piece by piece; it gets its place with the others of its folder
/// ([`ResultsFolder::write_with`]), and is removed when it is dropped before.
#[derive(Debug)]
pub struct GrowingFile {
    name: String,
    staged: Staged,
}

impl Write for GrowingFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.staged.add(bytes).map(|()| bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl ResultsFolder {
    /// Makes the folder where needed, locks it, and removes what a killed run left.
    ///
    /// # Errors
    /// [`FileError::Busy`] while another run writes there; [`FileError::Write`].
    pub fn open(folder: &Path) -> Result<Self, FileError> {
        let mut made = Vec::new();
        let done = make_folders(folder, &mut made);
        let mut results = Self {
            folder: folder.to_path_buf(),
            made,
            lock: None,
            outdated: Vec::new(),
            over: None,
        };
        done?;
        results.lock = lock(folder)?;
        clean(folder);
        Ok(results)
    }

    /// Files of these names must not remain from an earlier run: those that the folder's [`MANIFEST`] lists are removed as the new files are
    /// written.
    #[must_use]
    pub fn without(mut self, names: &[&str]) -> Self {
        self.outdated = names.iter().map(|name| (*name).to_owned()).collect();
        self
    }

    /// A new file that begins with `start` replaces only a file that begins so too. What somebody else put in the place of a listed file is kept, and
    /// the call fails.
    #[must_use]
    pub fn over(mut self, start: &str) -> Self {
        self.over = Some(start.to_owned());
        self
    }

    /// Starts a file that is written piece by piece.
    ///
    /// # Errors
    /// [`FileError::Write`].
    pub fn grow(&self, name: &str) -> Result<GrowingFile, FileError> {
        let staged = Staged::file(&self.folder, &[]);
        let staged = staged.map_err(FileError::write(&self.folder.join(name)))?;
        Ok(GrowingFile {
            name: name.to_owned(),
            staged,
        })
    }

    /// [`Self::write_with`] without files that grew.
    ///
    /// # Errors
    /// As there.
    pub fn write(self, files: &[OutputFile]) -> Result<Vec<PathBuf>, FileError> {
        self.write_with(Vec::new(), files)
    }

    /// Writes all files, or none; returns their paths.
    ///
    /// Files of an earlier run, listed in the folder's [`MANIFEST`], are replaced, or removed ([`Self::without`]). Any other file of the same name is kept,
    /// and the call fails before a name is changed.
    ///
    /// # Errors
    /// [`FileError::Name`], [`FileError::SameName`], [`FileError::Foreign`], [`FileError::Replaced`] or [`FileError::Write`].
    pub fn write_with(
        mut self,
        grown: Vec<GrowingFile>,
        files: &[OutputFile],
    ) -> Result<Vec<PathBuf>, FileError> {
        let new: Vec<String> = grown.iter().map(|file| file.name.clone()).collect();
        let mut new: Vec<&str> = new.iter().map(String::as_str).collect();
        new.extend(names(files));
        check_names(&new)?;
        let folder = self.folder.clone();
        let ours = manifest(&folder);
        for name in &new {
            let path = folder.join(name);
            if is_there(&path) && !ours.iter().any(|n| n == name) {
                return Err(FileError::Foreign { path });
            }
        }
        let start = self.over.as_deref().unwrap_or_default().as_bytes();
        for file in files.iter().filter(|file| file.bytes.starts_with(start)) {
            let path = folder.join(&file.name);
            if is_there(&path) && !begins(&path, start) {
                return Err(FileError::Replaced { path });
            }
        }
        let outdated: Vec<&String> = (self.outdated.iter())
            .filter(|name| ours.contains(name) && !new.contains(&name.as_str()))
            .collect();
        // Until they are removed, the list names them: a run that is stopped before can be repeated.
        let unfinished = format!("{UNFINISHED}\n{}", listed(&folder, &ours, &new));
        let remaining: Vec<String> = (ours.iter())
            .filter(|name| !outdated.contains(name))
            .cloned()
            .collect();
        let names = listed(&folder, &remaining, &new);
        let list = folder.join(MANIFEST);
        let stage = |path: &Path, bytes: &[u8]| {
            Staged::file(&folder, bytes).map_err(FileError::write(path))
        };
        let mut staged = Vec::new();
        for file in grown {
            let path = folder.join(&file.name);
            file.staged.sync().map_err(FileError::write(&path))?;
            staged.push((file.staged, path));
        }
        for file in files {
            let path = folder.join(&file.name);
            staged.push((stage(&path, &file.bytes)?, path));
        }
        let first = stage(&list, unfinished.as_bytes())?;
        staged.push((stage(&list, names.as_bytes())?, list.clone()));
        let place = |staged: Staged, path: &Path| {
            let placed = staged.place(path).map_err(FileError::write(path));
            placed.map(drop)
        };
        let durable = || disk::sync_folder(&folder).map_err(FileError::write(&folder));
        place(first, &list)?;
        self.made.clear();
        durable()?;
        for name in outdated {
            let path = folder.join(name);
            if is_there(&path) {
                disk::remove_file(&path).map_err(FileError::write(&path))?;
            }
        }
        let mut written = Vec::new();
        for (staged, path) in staged {
            if path == list {
                durable()?;
            }
            place(staged, &path)?;
            written.push(path);
        }
        durable()?;
        Ok(written)
    }
}

impl Drop for ResultsFolder {
    fn drop(&mut self) {
        for folder in self.made.iter().rev() {
            let _ = disk::remove_folder(folder);
        }
    }
}

/// Writes a folder of results: [`ResultsFolder::open`], [`ResultsFolder::write`].
///
/// # Errors
/// As those.
pub fn write_results(folder: &Path, files: &[OutputFile]) -> Result<Vec<PathBuf>, FileError> {
    check_names(&names(files))?;
    ResultsFolder::open(folder)?.write(files)
}

/// Whether a run was stopped while it replaced the files of this folder: each is whole, but they may be of two runs.
#[must_use]
pub fn is_unfinished(folder: &Path) -> bool {
    let list = input::read_text(&folder.join(MANIFEST), LARGEST_MANIFEST);
    list.is_ok_and(|text| text.lines().next() == Some(UNFINISHED))
}

/// Whether a file begins with these bytes; every file begins with none.
fn begins(path: &Path, start: &[u8]) -> bool {
    let mut head = vec![0; start.len()];
    let read = |mut file: File| file.read_exact(&mut head);
    start.is_empty() || input::open(path).and_then(read).is_ok() && head == start
}

fn manifest(folder: &Path) -> Vec<String> {
    let list = input::read_text(&folder.join(MANIFEST), LARGEST_MANIFEST);
    let lines = |text: String| text.lines().map(str::to_owned).collect();
    list.map(lines).unwrap_or_default()
}

/// The names of these files, and those of earlier files that are still there.
fn listed(folder: &Path, ours: &[String], new: &[&str]) -> String {
    let mut names = new.to_vec();
    names.extend(
        ours.iter()
            .map(String::as_str)
            .filter(|n| check_name(n).is_ok() && is_there(&folder.join(n))),
    );
    names.sort_unstable();
    names.dedup();
    names.join("\n") + "\n"
}

/// The folder itself is locked: no file is left over, and the lock ends with the process. Where the system cannot lock a
/// folder (Windows, some network disks) there is none.
fn lock(folder: &Path) -> Result<Option<File>, FileError> {
    let Ok(file) = File::open(folder) else {
        return Ok(None);
    };
    match file.try_lock() {
        Ok(()) => Ok(Some(file)),
        Err(TryLockError::WouldBlock) => Err(FileError::Busy {
            path: folder.to_path_buf(),
        }),
        Err(TryLockError::Error(error)) if error.kind() == ErrorKind::Interrupted => lock(folder),
        Err(TryLockError::Error(_)) => Ok(None),
    }
}
