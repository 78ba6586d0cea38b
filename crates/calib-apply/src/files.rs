//! Where the changed files and their records go.

use std::path::{Path, PathBuf};

use calib_files::{FileError, OutputFile, check_writable, folder_of, remove, replace, write_new};

use crate::change::{Destination, FileChange};
use crate::error::ApplyError;
use crate::revert::{Recorded, record_path, recorded, waiting_path};

/// Writes the files, each with its record; nothing where they go nowhere.
pub(super) fn write(files: &mut [FileChange], destination: &Destination) -> Result<(), ApplyError> {
    let places = match destination {
        Destination::Nowhere => return Ok(()),
        Destination::InPlace => {
            over(files)?;
            files.iter().map(|f| f.path.clone()).collect()
        }
        Destination::To(out) => {
            let places = out_places(files, out);
            for (file, place) in files.iter().zip(&places) {
                let changed = OutputFile::text(name(place), file.patched.text.clone());
                let record = OutputFile::text(name(&record_path(place)), record_text(file)?);
                write_new(folder_of(place), &[changed, record])?;
            }
            places
        }
    };
    for (file, place) in files.iter_mut().zip(places) {
        file.written = Some(place);
    }
    Ok(())
}

/// Over the targets: first all records, then the files. Whatever stops it, every file that was changed has its record, and
/// a record without its change is recognized by the next call. A record that replaces an earlier one waits beside it until its file is
/// written: what was stopped leaves the earlier change with its own record.
fn over(files: &[FileChange]) -> Result<(), ApplyError> {
    let mut records = Vec::new();
    for file in files {
        let record = record_path(&file.path);
        let replaces = recorded(&file.path, &file.original) == Recorded::After;
        if let Some(refused) = refused(file) {
            return Err(refused);
        }
        let place = if replaces {
            waiting_path(&file.path)
        } else {
            record.clone()
        };
        records.push((record, place, record_text(file)?));
    }
    let write_all = || -> Result<(), FileError> {
        for (_, place, text) in &records {
            replace(place, text.as_bytes())?;
        }
        files
            .iter()
            .try_for_each(|file| replace(&file.path, file.patched.text.as_bytes()))?;
        for (record, place, text) in &records {
            if place != record {
                replace(record, text.as_bytes())?;
                remove(place)?;
            }
        }
        Ok(())
    };
    write_all().map_err(|error| {
        // The error that counts is the first; a record stays where its file could not be restored.
        for (file, (_, place, _)) in files.iter().zip(&records) {
            let changed = text_of(&file.path) == file.patched.text;
            if !changed || replace(&file.path, file.original.as_bytes()).is_ok() {
                let _ = remove(place);
            }
        }
        error.into()
    })
}

/// Why a file is not changed in place: it was edited after an earlier change of ours, or is write-protected.
fn refused(file: &FileChange) -> Option<ApplyError> {
    let record = record_path(&file.path);
    let edited = record.exists() && recorded(&file.path, &file.original) == Recorded::No;
    let edited = edited.then(|| ApplyError::ChangedAlready {
        file: file.path.clone(),
        record,
    });
    edited.or_else(|| check_writable(&file.path).err().map(ApplyError::from))
}

/// A dry run says what a change in place would be refused for.
pub(super) fn announce(files: &[FileChange], destination: &Destination, notes: &mut Vec<String>) {
    if *destination == Destination::Nowhere {
        let refusals = files.iter().filter_map(refused);
        notes.extend(refusals.map(|why| format!("--in-place would be refused: {why}")));
    }
}

fn text_of(path: &Path) -> String {
    calib_urdf::source::read_text(path, "").unwrap_or_default()
}

fn record_text(file: &FileChange) -> Result<String, ApplyError> {
    let mut record = calib_report::json::exact_json(&file.record)?;
    if !record.ends_with('\n') {
        record.push('\n');
    }
    Ok(record)
}

fn name(path: &Path) -> String {
    let name = path.file_name().unwrap_or_default();
    name.to_string_lossy().into_owned()
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
