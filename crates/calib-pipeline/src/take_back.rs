//! `calib diff` and `calib revert`.

use std::path::{Path, PathBuf};

use calib_urdf::{ChangeRecord, source};

use crate::apply::{Kind, origins};
use crate::error::PipelineError;
use crate::output::write;

fn text(path: &Path) -> Result<String, PipelineError> {
    Ok(source::read_text(path, &path.display().to_string())?)
}

/// The difference of two robots as a table: URDFs, xacros, kinematics YAMLs, or one of each.
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
    let (of_a, of_b) = (origins(a)?, origins(b)?);
    if (of_a.kind, of_b.kind) == (Kind::Urdf, Kind::Urdf) {
        return Ok(calib_urdf::diff(
            &text(a)?,
            &a.display().to_string(),
            &text(b)?,
            &b.display().to_string(),
        )?);
    }
    let mut from = of_a.found;
    // A UR arm's YAML calls `shoulder` what its URDF calls `shoulder_pan_joint`.
    let to: Vec<_> = of_b
        .found
        .into_iter()
        .map(|(name, pose)| {
            let known = from.iter().find(|(other, _)| same_joint(other, &name));
            (known.map_or(name, |(other, _)| other.clone()), pose)
        })
        .collect();
    let computed = |name: &String| {
        let found = of_a.computed.iter().chain(&of_b.computed);
        found.into_iter().any(|other| other == name)
    };
    let mut not_compared: Vec<String> = of_a
        .computed
        .iter()
        .chain(&of_b.computed)
        .cloned()
        .collect();
    not_compared.sort();
    not_compared.dedup();
    from.retain(|(name, _)| !computed(name));
    let to: Vec<_> = to.into_iter().filter(|(name, _)| !computed(name)).collect();
    let mut diff = calib_urdf::diff_origins(&from, &to);
    diff.not_compared = not_compared;
    Ok(diff)
}

fn same_joint(a: &str, b: &str) -> bool {
    a == b || calib_urdf::ur_key(a) == Some(b) || calib_urdf::ur_key(b) == Some(a)
}

/// Where the record of a changed file lies: `<file>.changes.json` beside it.
#[must_use]
pub fn record_path(file: &Path) -> PathBuf {
    PathBuf::from(format!("{}.changes.json", file.display()))
}

/// The record beside a file that `calib run` or `calib apply` wrote.
///
/// # Errors
/// [`PipelineError::Data`] when there is none, or it is none.
pub fn read_record(file: &Path) -> Result<ChangeRecord, PipelineError> {
    let path = record_path(file);
    let wrong = |finding: String| PipelineError::Data {
        file: path.display().to_string(),
        finding,
        remedy:
            "give a file that `calib run` or `calib apply` wrote, with its .changes.json beside it"
                .to_owned(),
    };
    let text = std::fs::read_to_string(&path)
        .map_err(|e| wrong(format!("the change record cannot be read: {e}")))?;
    serde_json::from_str(&text).map_err(|e| wrong(format!("is no change record: {e}")))
}

/// The original bytes of a changed file, by the record beside it.
///
/// # Errors
/// [`PipelineError`] when the record is missing, or the file was edited since.
pub fn original(changed: &Path) -> Result<String, PipelineError> {
    let record = read_record(changed)?;
    calib_urdf::revert(&text(changed)?, &record).map_err(|e| {
        let said = e.to_string();
        let (finding, remedy) = said
            .split_once("\n  help: ")
            .unwrap_or((&said, "revert the file as it was written"));
        PipelineError::Data {
            file: changed.display().to_string(),
            finding: finding.to_owned(),
            remedy: remedy.to_owned(),
        }
    })
}

/// Writes the original bytes of a changed URDF, xacro or YAML to `out`, which must not exist.
///
/// # Errors
/// [`PipelineError`] when the change record is missing, or the file was edited since.
pub fn revert(changed: &Path, out: &Path) -> Result<PathBuf, PipelineError> {
    let original = original(changed)?;
    if out.exists() {
        return Err(PipelineError::Exists {
            path: out.display().to_string(),
            remedy: "choose another name, or move it away",
        });
    }
    write::replace(out, original.as_bytes())?;
    Ok(out.to_path_buf())
}

/// Writes the original bytes over the changed file and removes the record, which has done its work.
///
/// # Errors
/// [`PipelineError`] when the change record is missing, or the file was edited since; the file is untouched then.
pub fn revert_in_place(changed: &Path) -> Result<PathBuf, PipelineError> {
    let original = original(changed)?;
    write::replace(changed, original.as_bytes())?;
    let record = record_path(changed);
    std::fs::remove_file(&record).map_err(|e| PipelineError::write(&record, e))?;
    Ok(changed.to_path_buf())
}
