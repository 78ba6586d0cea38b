//! The original of a changed file, by the record beside it.

use std::path::{Path, PathBuf};

use calib_files::{OutputFile, folder_of, input, remove, replace, write_new};
use calib_urdf::{ChangeRecord, RevertError, sha256_hex, source};

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
    let text = match input::read_text(&path, source::MAX_BYTES) {
        Ok(text) => text,
        Err(source) => return Err(ApplyError::NoRecord { path, source }),
    };
    serde_json::from_str(&text).map_err(|source| ApplyError::NotARecord { path, source })
}

/// How a file stands to the record beside it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Recorded {
    /// There is no record, or it tells of other texts.
    No,
    /// The record was written, the file not yet: what was to change it was stopped.
    Before,
    /// The file holds the change.
    After,
}

/// How a text stands to the record beside its file.
pub(crate) fn recorded(file: &Path, text: &str) -> Recorded {
    let Ok(record) = read_record(file) else {
        return Recorded::No;
    };
    let found = sha256_hex(text.as_bytes());
    if found == record.original_sha256 {
        Recorded::Before
    } else if found == record.patched_sha256 {
        Recorded::After
    } else {
        Recorded::No
    }
}

/// The original bytes of a changed file, by the record beside it. A file that is the original still, because what was to
/// change it was stopped, is its own original.
///
/// # Errors
/// [`ApplyError`] when the record is missing, or the file was edited since.
pub fn original(changed: &Path) -> Result<String, ApplyError> {
    let record = read_record(changed)?;
    let text = source::read_text(changed, &changed.display().to_string())?;
    match reverted(changed, &text, &record) {
        Err(ApplyError::Revert {
            source: RevertError::AlreadyOriginal,
            ..
        }) => Ok(text),
        original => original,
    }
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

/// Writes the original bytes of a changed URDF, xacro or YAML to `out`, which must not exist or hold them already.
///
/// # Errors
/// [`ApplyError`] when the change record is missing, or the file was edited since.
pub fn revert(changed: &Path, out: &Path) -> Result<PathBuf, ApplyError> {
    let original = original(changed)?;
    let name = out.file_name().unwrap_or_default().to_string_lossy();
    write_new(folder_of(out), &[OutputFile::text(name, original)])?;
    Ok(out.to_path_buf())
}

/// Writes the original bytes over the changed file and removes the record, which has done its work. Stopped between the two,
/// the next call removes the record.
///
/// # Errors
/// [`ApplyError`] when the change record is missing, or the file was edited since; the file is untouched then.
pub fn revert_in_place(changed: &Path) -> Result<PathBuf, ApplyError> {
    let original = original(changed)?;
    replace(changed, original.as_bytes())?;
    remove(&record_path(changed))?;
    Ok(changed.to_path_buf())
}
