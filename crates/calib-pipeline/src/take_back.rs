//! `calib diff` and `calib revert`.

use std::path::{Path, PathBuf};

use calib_urdf::{ChangeRecord, source};

use crate::error::PipelineError;

fn text(path: &Path) -> Result<String, PipelineError> {
    Ok(source::read_text(path, &path.display().to_string())?)
}

/// The difference of two robots as a table.
///
/// # Errors
/// [`PipelineError::Urdf`] with file and place.
pub fn diff_table(a: &Path, b: &Path) -> Result<String, PipelineError> {
    Ok(format!("{}\n", model_diff(a, b)?).trim_end().to_owned() + "\n")
}

/// The difference of two robots as JSON.
///
/// # Errors
/// [`PipelineError::Urdf`] with file and place.
pub fn diff_json(a: &Path, b: &Path) -> Result<String, PipelineError> {
    Ok(calib_report::json::exact_json(&model_diff(a, b)?)?)
}

/// The difference of two files, line by line.
///
/// # Errors
/// [`PipelineError::Urdf`] when a file cannot be read as text.
pub fn diff_unified(a: &Path, b: &Path) -> Result<String, PipelineError> {
    Ok(calib_urdf::unified(
        &text(a)?,
        &a.display().to_string(),
        &text(b)?,
        &b.display().to_string(),
    ))
}

fn model_diff(a: &Path, b: &Path) -> Result<calib_urdf::ModelDiff, PipelineError> {
    Ok(calib_urdf::diff(
        &text(a)?,
        &a.display().to_string(),
        &text(b)?,
        &b.display().to_string(),
    )?)
}

/// Writes the original bytes of a patched URDF to `out`, which must not exist.
///
/// # Errors
/// [`PipelineError`] when the change record is missing, or the patched file was edited since.
pub fn revert(patched: &Path, out: &Path) -> Result<PathBuf, PipelineError> {
    let record_path = PathBuf::from(format!("{}.changes.json", patched.display()));
    let record_text = std::fs::read_to_string(&record_path).map_err(|e| PipelineError::Data {
        file: record_path.display().to_string(),
        finding: format!("the change record cannot be read: {e}"),
        remedy: "give the URDF that `calib run` wrote, with its .changes.json beside it".to_owned(),
    })?;
    let record: ChangeRecord =
        serde_json::from_str(&record_text).map_err(|e| PipelineError::Data {
            file: record_path.display().to_string(),
            finding: format!("is no change record: {e}"),
            remedy: "give the URDF that `calib run` wrote, with its .changes.json beside it"
                .to_owned(),
        })?;
    let original = calib_urdf::revert(&text(patched)?, &record).map_err(|e| {
        let said = e.to_string();
        let (finding, remedy) = said
            .split_once("\nhelp: ")
            .unwrap_or((&said, "revert the file as `calib run` wrote it"));
        PipelineError::Data {
            file: patched.display().to_string(),
            finding: finding.to_owned(),
            remedy: remedy.to_owned(),
        }
    })?;
    if out.exists() {
        return Err(PipelineError::Exists {
            path: out.display().to_string(),
        });
    }
    let part = PathBuf::from(format!("{}.part", out.display()));
    std::fs::write(&part, original.as_bytes()).map_err(|e| PipelineError::write(&part, e))?;
    std::fs::rename(&part, out).map_err(|e| PipelineError::write(out, e))?;
    Ok(out.to_path_buf())
}
