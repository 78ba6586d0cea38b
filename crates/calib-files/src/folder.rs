//! The folder of a file, and folders that are made for it.

use std::path::{Path, PathBuf};

use crate::disk;
use crate::error::FileError;

/// The folder of a file.
#[must_use]
pub fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    }
}

/// Makes a folder and those above it.
///
/// # Errors
/// [`FileError::Write`].
pub fn make_folder(folder: &Path) -> Result<(), FileError> {
    make_folders(folder, &mut Vec::new())
}

/// Makes a folder and those above it; `made` gets what was not there, outermost first.
pub(crate) fn make_folders(folder: &Path, made: &mut Vec<PathBuf>) -> Result<(), FileError> {
    if folder.is_dir() {
        return Ok(());
    }
    if let Some(above) = folder.parent().filter(|above| *above != Path::new("")) {
        make_folders(above, made)?;
    }
    match disk::create_dir(folder) {
        Ok(()) => made.push(folder.to_path_buf()),
        // Another program was faster.
        Err(_) if folder.is_dir() => {}
        Err(error) => return Err(FileError::write(folder)(error)),
    }
    Ok(())
}
