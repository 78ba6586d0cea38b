//! The record beside a changed file, and what it says of the file.

use std::path::{Path, PathBuf};

use calib_files::input;
use calib_urdf::{ChangeRecord, sha256_hex, source};

use crate::error::ApplyError;

/// Where the record of a changed file lies: `<file>.changes.json` beside it. Of a link, beside what it leads to: whoever names the file by
/// another way finds it.
#[must_use]
pub fn record_path(file: &Path) -> PathBuf {
    /// Links of links: more lead in a circle.
    const LINKS: usize = 40;
    let mut real = file.to_path_buf();
    for _ in 0..LINKS {
        let Ok(to) = std::fs::read_link(&real) else {
            break;
        };
        real = real.parent().unwrap_or(Path::new("")).join(to);
    }
    PathBuf::from(format!("{}.changes.json", real.display()))
}

/// Where the record of a change waits that replaces an earlier one, until the file holds it.
pub(crate) fn waiting_path(file: &Path) -> PathBuf {
    PathBuf::from(format!("{}.next", record_path(file).display()))
}

/// The record beside a file that `calib run` or `calib apply` wrote.
///
/// # Errors
/// [`ApplyError::NoRecord`], [`ApplyError::NotARecord`].
pub fn read_record(file: &Path) -> Result<ChangeRecord, ApplyError> {
    read_at(record_path(file))
}

fn read_at(path: PathBuf) -> Result<ChangeRecord, ApplyError> {
    let text = match input::read_text(&path, source::MAX_BYTES) {
        Ok(text) => text,
        Err(source) => return Err(ApplyError::NoRecord { path, source }),
    };
    serde_json::from_str(&text).map_err(|source| ApplyError::NotARecord { path, source })
}

/// The record that tells of this text: that beside the file, or that of a change that was stopped before its record took the place of
/// the earlier one.
///
/// # Errors
/// As [`read_record`].
pub(crate) fn record_of(file: &Path, text: &str) -> Result<ChangeRecord, ApplyError> {
    let record = read_record(file)?;
    let found = sha256_hex(text.as_bytes());
    if found == record.original_sha256 || found == record.patched_sha256 {
        return Ok(record);
    }
    match read_at(waiting_path(file)) {
        Ok(waiting) if found == waiting.patched_sha256 => Ok(waiting),
        _ => Ok(record),
    }
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
    let Ok(record) = record_of(file, text) else {
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
