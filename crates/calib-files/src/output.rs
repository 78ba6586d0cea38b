//! Whole files: each beside its place, synchronized, then renamed.

use std::fs::{self, File};
use std::io::Write as _;
use std::path::{Path, PathBuf};

use crate::error::FileError;

/// A file to be written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OutputFile {
    /// Name within the output folder.
    pub name: String,
    /// Its bytes.
    pub bytes: Vec<u8>,
}

impl OutputFile {
    /// A text file.
    pub fn text(name: impl Into<String>, text: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            bytes: text.into().into_bytes(),
        }
    }
}

/// Name of the list in a folder of results: what this program wrote there and may replace.
pub const MANIFEST: &str = "calib.manifest";

/// Writes a folder of results: all files, or none; returns their paths.
///
/// Files of an earlier run, listed in the folder's [`MANIFEST`], are replaced. Any other file of the same name is kept,
/// and the call fails before a byte is written.
///
/// # Errors
/// [`FileError::SameName`], [`FileError::Foreign`] or [`FileError::Write`].
pub fn write_results(folder: &Path, files: &[OutputFile]) -> Result<Vec<PathBuf>, FileError> {
    let ours: Vec<String> = fs::read_to_string(folder.join(MANIFEST))
        .map(|text| text.lines().map(str::to_owned).collect())
        .unwrap_or_default();
    for (i, file) in files.iter().enumerate() {
        if files[..i].iter().any(|earlier| earlier.name == file.name) {
            return Err(FileError::SameName {
                name: file.name.clone(),
            });
        }
        let path = folder.join(&file.name);
        if path.exists() && !ours.contains(&file.name) {
            return Err(FileError::Foreign { path });
        }
    }
    fs::create_dir_all(folder).map_err(FileError::write(folder))?;
    let mut staged = Vec::new();
    for file in files.iter().chain([&manifest(folder, &ours, files)]) {
        match stage(folder, file) {
            Ok(temporary) => staged.push((temporary, folder.join(&file.name))),
            Err(error) => {
                for (temporary, _) in &staged {
                    let _ = fs::remove_file(temporary);
                }
                return Err(error);
            }
        }
    }
    let mut written = Vec::new();
    for (temporary, path) in staged {
        fs::rename(&temporary, &path).map_err(FileError::write(&path))?;
        written.push(path);
    }
    Ok(written)
}

/// The names of these files, and those of earlier files that are still there.
fn manifest(folder: &Path, ours: &[String], files: &[OutputFile]) -> OutputFile {
    let mut names: Vec<&str> = files.iter().map(|f| f.name.as_str()).collect();
    names.extend(
        ours.iter()
            .map(String::as_str)
            .filter(|n| folder.join(n).exists()),
    );
    names.sort_unstable();
    names.dedup();
    OutputFile::text(MANIFEST, names.join("\n") + "\n")
}

/// Writes files that must not exist yet, outside a folder of results: no manifest is kept.
///
/// # Errors
/// [`FileError::Exists`] or [`FileError::Write`].
pub fn write_new(folder: &Path, files: &[OutputFile]) -> Result<Vec<PathBuf>, FileError> {
    let paths: Vec<PathBuf> = files.iter().map(|file| folder.join(&file.name)).collect();
    if let Some(path) = paths.iter().find(|path| path.exists()) {
        return Err(FileError::Exists { path: path.clone() });
    }
    fs::create_dir_all(folder).map_err(FileError::write(folder))?;
    for (file, path) in files.iter().zip(&paths) {
        let temporary = stage(folder, file)?;
        fs::rename(&temporary, path).map_err(FileError::write(path))?;
    }
    Ok(paths)
}

/// Replaces a file, or makes it; its permissions stay. A symbolic link stays a link: the file behind it is replaced.
///
/// # Errors
/// [`FileError::Write`]; the old file is untouched then.
pub fn replace(path: &Path, bytes: &[u8]) -> Result<(), FileError> {
    let path = &fs::canonicalize(path).unwrap_or_else(|_| path.to_path_buf());
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let folder = match path.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    };
    let file = OutputFile {
        name: name.into_owned(),
        bytes: bytes.to_vec(),
    };
    let temporary = stage(folder, &file)?;
    let kept = fs::metadata(path).map(|old| old.permissions());
    let done = kept
        .map_or(Ok(()), |permissions| {
            fs::set_permissions(&temporary, permissions)
        })
        .and_then(|()| fs::rename(&temporary, path));
    done.map_err(|source| {
        let _ = fs::remove_file(&temporary);
        FileError::write(path)(source)
    })
}

/// Writes the file beside its place; returns where.
fn stage(folder: &Path, file: &OutputFile) -> Result<PathBuf, FileError> {
    let temporary = folder.join(format!(".{}.part", file.name));
    let mut out = File::create(&temporary).map_err(FileError::write(&temporary))?;
    match out.write_all(&file.bytes).and_then(|()| out.sync_all()) {
        Ok(()) => Ok(temporary),
        Err(source) => {
            let _ = fs::remove_file(&temporary);
            Err(FileError::write(&folder.join(&file.name))(source))
        }
    }
}
