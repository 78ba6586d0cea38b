//! The original of a changed file, by the record beside it.

use std::path::{Path, PathBuf};

use calib_files::{FileError, replace};
use calib_urdf::{ChangeRecord, source};

use crate::error::ApplyError;

/// Where the record of a changed file lies: `<file>.changes.json` beside it.
#[must_use]
pub fn record_path(file: &Path) -> PathBuf {
    PathBuf::from(format!("{}.changes.json", file.display()))
}

/// The record beside a file that `calib run` or `calib apply` wrote.
///
/// # Errors
/// [`ApplyError::NoRecord`], [`ApplyError::NotARecord`].
pub fn read_record(file: &Path) -> Result<ChangeRecord, ApplyError> {
    let path = record_path(file);
    let text = match std::fs::read_to_string(&path) {
        Ok(text) => text,
        Err(source) => return Err(ApplyError::NoRecord { path, source }),
    };
    serde_json::from_str(&text).map_err(|source| ApplyError::NotARecord { path, source })
}

/// The original bytes of a changed file, by the record beside it.
///
/// # Errors
/// [`ApplyError`] when the record is missing, or the file was edited since.
pub fn original(changed: &Path) -> Result<String, ApplyError> {
    let record = read_record(changed)?;
    let text = source::read_text(changed, &changed.display().to_string())?;
    reverted(changed, &text, &record)
}

/// The original text behind a changed one.
pub(crate) fn reverted(
    file: &Path,
    changed: &str,
    record: &ChangeRecord,
) -> Result<String, ApplyError> {
    calib_urdf::revert(changed, record).map_err(|source| ApplyError::Revert {
        file: file.to_path_buf(),
        source,
    })
}

/// Writes the original bytes of a changed URDF, xacro or YAML to `out`, which must not exist.
///
/// # Errors
/// [`ApplyError`] when the change record is missing, or the file was edited since.
pub fn revert(changed: &Path, out: &Path) -> Result<PathBuf, ApplyError> {
    let original = original(changed)?;
    if out.exists() {
        return Err(FileError::Exists {
            path: out.to_path_buf(),
        }
        .into());
    }
    replace(out, original.as_bytes())?;
    Ok(out.to_path_buf())
}

/// Writes the original bytes over the changed file and removes the record, which has done its work.
///
/// # Errors
/// [`ApplyError`] when the change record is missing, or the file was edited since; the file is untouched then.
pub fn revert_in_place(changed: &Path) -> Result<PathBuf, ApplyError> {
    let original = original(changed)?;
    replace(changed, original.as_bytes())?;
    let record = record_path(changed);
    std::fs::remove_file(&record).map_err(|source| FileError::Write {
        path: record,
        source,
    })?;
    Ok(changed.to_path_buf())
}
