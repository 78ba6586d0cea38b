//! The original of a changed file, by the record beside it.

use std::path::{Path, PathBuf};

use calib_files::{OutputFile, check_writable, folder_of, remove, replace, write_new};
use calib_urdf::{RevertError, source};

use crate::error::ApplyError;
use crate::files::text_of;
use crate::revert::{read_record, record_of, record_path, reverted, waiting_path};
use crate::target::changed_yaml;

/// The original bytes of a changed file, by the record beside it. A file that is the original still, because what was to
/// change it was stopped, is its own original.
///
/// # Errors
/// [`ApplyError`] when the record is missing, or the file was edited since.
pub fn original(changed: &Path) -> Result<String, ApplyError> {
    if let Err(error) = read_record(changed) {
        // A xacro whose numbers all stand in its YAML has not changed itself.
        return Err(match changed_yaml(changed).into_iter().next() {
            Some(yaml) => ApplyError::RecordedElsewhere {
                file: changed.to_path_buf(),
                yaml,
            },
            None => error,
        });
    }
    let text = source::read_text(changed, &changed.display().to_string())?;
    let record = record_of(changed, &text)?;
    match reverted(changed, &text, &record) {
        Err(ApplyError::Revert {
            source: RevertError::AlreadyOriginal,
            ..
        }) => Ok(text),
        original => original,
    }
}

/// What belongs to the same change as a file and is not reverted with it: the YAMLs that a xacro loads, with how to revert them.
#[must_use]
pub fn not_reverted(file: &Path) -> Vec<String> {
    let yaml = changed_yaml(file).into_iter();
    yaml.map(|yaml| {
        let yaml = yaml.display().to_string();
        let quoted = calib_report::shell_path(&yaml);
        format!("{yaml} still holds its part of the change: calib revert {quoted} --in-place")
    })
    .collect()
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
    if text_of(changed) != original {
        check_writable(changed)?;
        replace(changed, original.as_bytes())?;
    }
    remove(&record_path(changed))?;
    if waiting_path(changed).exists() {
        remove(&waiting_path(changed))?;
    }
    Ok(changed.to_path_buf())
}
