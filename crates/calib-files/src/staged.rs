//! A file or a folder beside its place, under a name that nobody else has, until it is renamed.

use std::fs::{self, File};
use std::hash::{BuildHasher as _, Hasher as _, RandomState};
use std::io::{Error, ErrorKind, Result};
use std::path::{Path, PathBuf};

use crate::disk;
use crate::name::{is_part, part};

/// Something that is being written. It is locked while its writer lives, and removed when it is dropped before it was put
/// in its place; what a killed writer left is not locked, and [`clean`] removes it.
///
/// Nothing can be created and locked in one call, so another program's [`clean`] may come between the two. It removes only
/// under its own lock; whoever creates waits for that lock, and starts over under another name if the file is gone by then.
#[derive(Debug)]
pub(crate) struct Staged {
    path: PathBuf,
    is_folder: bool,
    /// Open for its lock.
    held: Option<File>,
    placed: bool,
}

impl Staged {
    /// Writes a file into the folder under a name of its own.
    pub(crate) fn file(folder: &Path, bytes: &[u8]) -> Result<Self> {
        Self::filled(folder, |file| disk::write(file, bytes))
    }

    /// The same with bytes that `fill` writes piece by piece.
    pub(crate) fn filled<E: From<Error>>(
        folder: &Path,
        fill: impl FnOnce(&mut File) -> std::result::Result<(), E>,
    ) -> std::result::Result<Self, E> {
        let (path, mut file) = unique(folder, |path| {
            let file = disk::create_new(path)?;
            locked(path, &file).map(|()| file)
        })?;
        let mut staged = Self {
            path,
            is_folder: false,
            held: None,
            placed: false,
        };
        let done = fill(&mut file).and_then(|()| Ok(disk::sync(&file)?));
        staged.held = Some(file);
        done.map(|()| staged)
    }

    /// Makes an empty folder in the folder.
    pub(crate) fn folder(parent: &Path) -> Result<Self> {
        let (path, held) = unique(parent, |path| {
            disk::create_dir(path)?;
            match File::open(path) {
                Ok(file) => locked(path, &file).map(|()| Some(file)),
                Err(error) if error.kind() == ErrorKind::NotFound => Err(taken()),
                // Windows does not open a folder; there it is not cleaned either.
                Err(_) => Ok(None),
            }
        })?;
        Ok(Self {
            path,
            is_folder: true,
            held,
            placed: false,
        })
    }

    /// Adds bytes to a file.
    pub(crate) fn add(&mut self, bytes: &[u8]) -> Result<()> {
        match &mut self.held {
            Some(file) => disk::write(file, bytes),
            None => Err(Error::from(ErrorKind::NotFound)),
        }
    }

    /// Synchronizes a file that grew.
    pub(crate) fn sync(&self) -> Result<()> {
        self.held.as_ref().map_or(Ok(()), disk::sync)
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Renames it to its place; what was there is replaced. The open file is returned.
    pub(crate) fn place(mut self, to: &Path) -> Result<Option<File>> {
        disk::rename(&self.path, to)?;
        self.placed = true;
        Ok(self.held.take())
    }

    /// Gives it its place, where nothing may be: of several writers at once, one does. The open file is returned.
    ///
    /// # Errors
    /// [`ErrorKind::AlreadyExists`] where something is there.
    pub(crate) fn place_new(self, to: &Path) -> Result<Option<File>> {
        match disk::hard_link(&self.path, to) {
            Ok(()) => {
                let mut staged = self;
                disk::remove_file(&staged.path)?;
                staged.placed = true;
                Ok(staged.held.take())
            }
            Err(error) if error.kind() == ErrorKind::AlreadyExists => Err(error),
            // A file system without links.
            Err(_) if disk::is_there(to) => Err(taken()),
            Err(_) => self.place(to),
        }
    }
}

impl Drop for Staged {
    fn drop(&mut self) {
        if self.placed {
            return;
        }
        let _ = match self.is_folder {
            true => disk::remove_tree(&self.path),
            false => disk::remove_file(&self.path),
        };
    }
}

fn taken() -> Error {
    Error::from(ErrorKind::AlreadyExists)
}

/// Locks what was just created; [`ErrorKind::AlreadyExists`] if it was removed before.
fn locked(path: &Path, file: &File) -> Result<()> {
    // Only `clean` locks such a file besides, and not for long. Where the system has no locks, nothing is cleaned.
    let _ = file.lock();
    // The name is random: if it is there, it is this file.
    match disk::is_there(path) {
        true => Ok(()),
        false => Err(taken()),
    }
}

/// Makes something under a random name, another one as long as `make` says that it is taken.
fn unique<T>(folder: &Path, make: impl Fn(&Path) -> Result<T>) -> Result<(PathBuf, T)> {
    loop {
        // Seeded by the system for each table: not from the clock, and different in every process.
        let random = RandomState::new().build_hasher().finish();
        let path = folder.join(part(random));
        match make(&path) {
            Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
            made => return made.map(|made| (path, made)),
        }
    }
}

/// Removes what killed writers left in a folder, as far as that can be done.
pub(crate) fn clean(folder: &Path) {
    let Ok(entries) = fs::read_dir(folder) else {
        return;
    };
    for entry in entries.flatten() {
        if !entry.file_name().to_str().is_some_and(is_part) {
            continue;
        }
        let path = entry.path();
        // `file_type` does not follow links, and a link of such a name is not ours.
        let Ok(kind) = entry.file_type() else {
            continue;
        };
        if !(kind.is_file() || kind.is_dir()) {
            continue;
        }
        let Ok(file) = crate::input::file_or_folder(&path) else {
            continue;
        };
        // The lock is held until the file is gone.
        if file.try_lock().is_ok() {
            let _ = match kind.is_dir() {
                true => disk::remove_tree(&path),
                false => disk::remove_file(&path),
            };
        }
    }
}
