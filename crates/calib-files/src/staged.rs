//! A file or a folder beside its place, under a name that nobody else has, until it is renamed.

use std::fs::{self, File};
use std::hash::{BuildHasher as _, Hasher as _, RandomState};
use std::io::{ErrorKind, Result};
use std::path::{Path, PathBuf};

use crate::disk;
use crate::name::{is_part, part};

/// Something that is being written. It is locked while its writer lives, and removed when it is dropped before it was put
/// in its place; what a killed writer left is not locked, and [`clean`] removes it.
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
        let (path, mut file) = unique(folder, disk::create_new)?;
        // Where the system has no locks, nothing is cleaned either.
        let _ = file.try_lock();
        let mut staged = Self {
            path,
            is_folder: false,
            held: None,
            placed: false,
        };
        let done = disk::write(&mut file, bytes).and_then(|()| disk::sync(&file));
        staged.held = Some(file);
        done.map(|()| staged)
    }

    /// Makes an empty folder in the folder.
    pub(crate) fn folder(parent: &Path) -> Result<Self> {
        let (path, ()) = unique(parent, disk::create_dir)?;
        let held = File::open(&path).ok();
        if let Some(file) = &held {
            let _ = file.try_lock();
        }
        Ok(Self {
            path,
            is_folder: true,
            held,
            placed: false,
        })
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

/// Makes something under a random name.
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
        let free = crate::input::open(&path).is_ok_and(|file| file.try_lock().is_ok());
        if free {
            let _ = match kind.is_dir() {
                true => disk::remove_tree(&path),
                false => disk::remove_file(&path),
            };
        }
    }
}
