//! Where the changed files and their records go.

use std::path::{Path, PathBuf};

use calib_files::{OutputFile, replace, write_new};

use crate::change::{Destination, FileChange};
use crate::error::ApplyError;
use crate::revert::record_path;

/// Writes the files, each with its record; nothing where they go nowhere.
pub(super) fn write(files: &mut [FileChange], destination: &Destination) -> Result<(), ApplyError> {
    let places = match destination {
        Destination::Nowhere => return Ok(()),
        Destination::InPlace => {
            for file in files.iter() {
                let record = record_path(&file.path);
                if record.exists() {
                    return Err(ApplyError::ChangedAlready {
                        file: file.path.clone(),
                        record,
                    });
                }
            }
            files.iter().map(|f| f.path.clone()).collect()
        }
        Destination::To(out) => out_places(files, out),
    };
    for (file, place) in files.iter_mut().zip(&places) {
        let mut record = calib_report::json::exact_json(&file.record)?;
        if !record.ends_with('\n') {
            record.push('\n');
        }
        let folder = match place.parent() {
            Some(folder) if folder != Path::new("") => folder,
            _ => Path::new("."),
        };
        let name = |path: &Path| {
            path.file_name()
                .unwrap_or_default()
                .to_string_lossy()
                .into_owned()
        };
        let record = OutputFile::text(name(&record_path(place)), record);
        let changed = OutputFile::text(name(place), file.patched.text.clone());
        if *destination == Destination::InPlace {
            // The record first: whatever happens then, the original can be had.
            write_new(folder, &[record])?;
            if let Err(error) = replace(place, &changed.bytes) {
                let _ = std::fs::remove_file(record_path(place));
                return Err(error.into());
            }
        } else {
            write_new(folder, &[changed, record])?;
        }
        file.written = Some(place.clone());
    }
    Ok(())
}

fn out_places(files: &[FileChange], out: &Path) -> Vec<PathBuf> {
    if files.len() == 1 && !out.is_dir() {
        return vec![out.to_path_buf()];
    }
    files
        .iter()
        .map(|f| out.join(f.path.file_name().unwrap_or_default()))
        .collect()
}
