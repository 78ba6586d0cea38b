//! Whole files: each staged beside its place, synchronized, then renamed.

use std::fs::{self, File, OpenOptions};
use std::io::{Error, ErrorKind};
use std::path::{Path, PathBuf};

use crate::disk::{self, is_there};
use crate::error::FileError;
use crate::file::{OutputFile, check_names, names};
use crate::folder::{folder_of, make_folder};
use crate::input;
use crate::staged::{Staged, clean};

/// Writes files that must not exist yet, outside a folder of results: no manifest is kept. A file that is there with the very
/// same bytes is done already, so that a call that was stopped can be repeated.
///
/// # Errors
/// [`FileError::Name`], [`FileError::SameName`], [`FileError::Exists`] or [`FileError::Write`].
pub fn write_new(folder: &Path, files: &[OutputFile]) -> Result<Vec<PathBuf>, FileError> {
    check_names(&names(files))?;
    let mut missing = Vec::new();
    for file in files {
        let path = folder.join(&file.name);
        if !is_there(&path) {
            missing.push((file, path));
        } else if !holds(&path, &file.bytes) {
            return Err(FileError::Exists { path });
        }
    }
    make_folder(folder)?;
    clean(folder);
    let mut staged = Vec::new();
    for (file, path) in missing {
        let one = Staged::file(folder, &file.bytes).map_err(FileError::write(&path))?;
        staged.push((one, path));
    }
    for (one, path) in staged {
        one.place(&path).map_err(FileError::write(&path))?;
    }
    disk::sync_folder(folder).map_err(FileError::write(folder))?;
    Ok(files.iter().map(|file| folder.join(&file.name)).collect())
}

fn holds(path: &Path, bytes: &[u8]) -> bool {
    let is_file = fs::symlink_metadata(path).is_ok_and(|m| m.is_file());
    is_file && input::read(path, bytes.len() as u64).is_ok_and(|there| there == bytes)
}

/// Makes a folder that must not exist, with files in it and below (`src/lib.rs`): all of them, or nothing.
///
/// # Errors
/// [`FileError::Exists`] or [`FileError::Write`].
pub fn new_folder(path: &Path, files: &[OutputFile]) -> Result<(), FileError> {
    if is_there(path) {
        return Err(FileError::Exists {
            path: path.to_path_buf(),
        });
    }
    let parent = folder_of(path);
    make_folder(parent)?;
    clean(parent);
    let staged = Staged::folder(parent).map_err(FileError::write(path))?;
    for file in files {
        let place = staged.path().join(&file.name);
        make_folder(folder_of(&place))?;
        let written = disk::create_new(&place).and_then(|mut out| {
            disk::write(&mut out, &file.bytes)?;
            disk::sync(&out)
        });
        written.map_err(FileError::write(&path.join(&file.name)))?;
    }
    staged.place(path).map_err(FileError::write(path))?;
    disk::sync_folder(parent).map_err(FileError::write(parent))
}

/// Refuses a file without write permission. Its folder would let it be replaced all the same, but its owner asked that it stay.
///
/// # Errors
/// [`FileError::Protected`].
pub fn check_writable(path: &Path) -> Result<(), FileError> {
    match fs::metadata(path) {
        Ok(found) if found.permissions().readonly() => Err(FileError::Protected {
            path: path.to_path_buf(),
        }),
        _ => Ok(()),
    }
}

/// Replaces a file, or makes it; its permissions stay. A symbolic link stays a link: the file behind it is replaced. A hard
/// link is broken: the other names keep the old bytes.
///
/// # Errors
/// [`FileError::Write`]; the old file is untouched then.
pub fn replace(path: &Path, bytes: &[u8]) -> Result<(), FileError> {
    let path = &fs::canonicalize(path).unwrap_or_else(|_| path.to_path_buf());
    let folder = folder_of(path);
    clean(folder);
    let staged = Staged::file(folder, bytes).map_err(FileError::write(path))?;
    let kept = fs::metadata(path).map(|old| old.permissions());
    kept.map_or(Ok(()), |permissions| {
        disk::set_permissions(staged.path(), permissions)
    })
    .and_then(|()| staged.place(path).map(drop))
    .and_then(|()| disk::sync_folder(folder))
    .map_err(FileError::write(path))
}

/// Removes a file.
///
/// # Errors
/// [`FileError::Write`].
pub fn remove(path: &Path) -> Result<(), FileError> {
    disk::remove_file(path)
        .and_then(|()| disk::sync_folder(folder_of(path)))
        .map_err(FileError::write(path))
}

/// Starts a file that grows: it must not exist, and appears with these bytes in it. The file is locked while it is open.
///
/// # Errors
/// [`FileError::Exists`] or [`FileError::Write`].
pub fn start(path: &Path, bytes: &[u8]) -> Result<File, FileError> {
    if is_there(path) {
        return Err(FileError::Exists {
            path: path.to_path_buf(),
        });
    }
    let folder = folder_of(path);
    make_folder(folder)?;
    clean(folder);
    Staged::file(folder, bytes)
        .and_then(|staged| staged.place_new(path))
        .and_then(|file| file.ok_or_else(|| Error::from(ErrorKind::NotFound)))
        .and_then(|file| disk::sync_folder(folder).map(|()| file))
        .map_err(|error| match error.kind() {
            ErrorKind::AlreadyExists => FileError::Exists {
                path: path.to_path_buf(),
            },
            _ => FileError::write(path)(error),
        })
}

/// Opens a regular file that grows, locked while it is open; the bytes after the first `whole` are cut off.
///
/// # Errors
/// [`FileError::Busy`] while another program appends to it; [`FileError::Write`].
pub fn resume(path: &Path, whole: u64) -> Result<File, FileError> {
    input::open(path).map_err(FileError::write(path))?;
    let file = OpenOptions::new().append(true).open(path);
    let file = file.map_err(FileError::write(path))?;
    if let Err(fs::TryLockError::WouldBlock) = file.try_lock() {
        return Err(FileError::Busy {
            path: path.to_path_buf(),
        });
    }
    file.set_len(whole).map_err(FileError::write(path))?;
    Ok(file)
}
