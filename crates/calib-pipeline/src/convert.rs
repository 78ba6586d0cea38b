//! `calib convert`: any recording as canonical CSV.

use std::path::{Path, PathBuf};

use calib_recording::{ReadOptions, WriteOptions, read_path_with, write_recording};

use crate::error::PipelineError;
use crate::output::write::OutputFile;

/// What a conversion gives: the files (one per clock) and what the reader did and noticed.
#[derive(Debug, Clone)]
pub struct Converted {
    /// Folder to write to.
    pub folder: PathBuf,
    /// One table per clock; the first has the name asked for.
    pub files: Vec<OutputFile>,
    /// Conversions and findings, one line each.
    pub notes: Vec<String>,
}

/// Reads a recording of any known format and renders it as canonical CSV; `progress(bytes read, bytes in all)` is told
/// how far the reading is.
///
/// # Errors
/// [`PipelineError`] when it cannot be read, or would not read back the same.
pub fn convert(
    input: &Path,
    output: &Path,
    format: Option<&str>,
    progress: &mut dyn FnMut(u64, u64),
) -> Result<Converted, PipelineError> {
    let options = ReadOptions {
        format: format.map(str::to_owned),
        ..ReadOptions::default()
    };
    let recording = read_path_with(input, &options, progress)?;
    let mut notes = vec![format!("read as {}", recording.meta.format)];
    notes.extend(recording.meta.conversions.iter().cloned());
    notes.extend(
        recording
            .meta
            .findings
            .iter()
            .map(|f| format!("{}: {}", f.id, f.text)),
    );
    let tables =
        write_recording(&recording, &WriteOptions::default()).map_err(|e| PipelineError::Data {
            file: input.display().to_string(),
            finding: e.to_string(),
            remedy: "rename what cannot stand in a table".to_owned(),
        })?;
    let name = output.file_name().map_or_else(
        || "recording.csv".to_owned(),
        |n| n.to_string_lossy().into_owned(),
    );
    let stem = name.trim_end_matches(".csv").to_owned();
    let files = tables
        .into_iter()
        .enumerate()
        .map(|(i, (_, table))| {
            let name = if i == 0 {
                name.clone()
            } else {
                format!("{stem}.{}.csv", i + 1)
            };
            OutputFile::text(name, table)
        })
        .collect();
    let folder = output
        .parent()
        .filter(|p| !p.as_os_str().is_empty())
        .map_or_else(|| PathBuf::from("."), Path::to_path_buf);
    Ok(Converted {
        folder,
        files,
        notes,
    })
}
