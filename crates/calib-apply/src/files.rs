//! Where the changed files and their records go.

use std::path::{Path, PathBuf};

use calib_files::{FileError, OutputFile, check_writable, folder_of, remove, replace, write_new};
use calib_urdf::{ChangeRecord, replay, sha256_hex};

use crate::change::{Destination, FileChange};
use crate::error::ApplyError;
use crate::revert::{Recorded, read_record, record_path, recorded, reverted, waiting_path};

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
        if let Some(refused) = refused(file) {
            return Err(refused);
        }
        records.push(Record::of(file)?);
    }
    let write_all = || -> Result<(), FileError> {
        for record in &records {
            replace(&record.first, record.text.as_bytes())?;
        }
        files
            .iter()
            .try_for_each(|file| replace(&file.path, file.patched.text.as_bytes()))?;
        for record in records.iter().filter(|r| r.earlier.is_some()) {
            replace(&record.path, record.text.as_bytes())?;
            remove(&record.first)?;
        }
        Ok(())
    };
    write_all().map_err(|error| {
        // The error that counts is the first; a record stays where its file could not be restored.
        for (file, record) in files.iter().zip(&records) {
            let changed = text_of(&file.path) == file.patched.text;
            if changed && replace(&file.path, file.original.as_bytes()).is_err() {
                continue;
            }
            match &record.earlier {
                Some(earlier) => {
                    let is_there = text_of(&record.path) == *earlier;
                    if is_there || replace(&record.path, earlier.as_bytes()).is_ok() {
                        let _ = remove(&record.first);
                    }
                }
                None => {
                    let _ = remove(&record.first);
                }
            }
        }
        error.into()
    })
}

/// Completes a change that was stopped: where one of the files holds it, the others get it as well, and its records take the place of the earlier ones.
/// Whether there was any. Records of one that was stopped before its first file are removed: a later change that is stopped must not complete that one.
pub(super) fn complete<'a>(paths: impl Iterator<Item = &'a PathBuf>) -> Result<bool, ApplyError> {
    let waiting = paths.filter_map(|path| Waiting::of(path));
    let waiting: Vec<Waiting<'_>> = waiting.collect();
    if !waiting.iter().any(Waiting::holds) {
        for Waiting { file, .. } in &waiting {
            remove(&waiting_path(file))?;
        }
        return Ok(false);
    }
    for Waiting { file, text, record } in waiting.iter().filter(|w| !w.holds()) {
        let original = match sha256_hex(text.as_bytes()) == record.original_sha256 {
            true => text.clone(),
            false => reverted(file, text, &read_record(file)?)?,
        };
        // Edited since, or of another file: the records tell of that.
        if let Some(changed) = replay(&original, record) {
            check_writable(file)?;
            replace(file, changed.as_bytes())?;
        }
    }
    for Waiting { file, record, .. } in &waiting {
        if sha256_hex(text_of(file).as_bytes()) == record.patched_sha256 {
            let place = waiting_path(file);
            replace(&record_path(file), text_of(&place).as_bytes())?;
            remove(&place)?;
        }
    }
    Ok(true)
}

/// Whether a change was stopped between these files.
pub(super) fn is_stopped<'a>(paths: impl Iterator<Item = &'a PathBuf>) -> bool {
    paths
        .filter_map(|path| Waiting::of(path))
        .any(|w| w.holds())
}

/// A file whose change has not taken the place of an earlier one yet.
struct Waiting<'a> {
    file: &'a Path,
    text: String,
    record: ChangeRecord,
}

impl<'a> Waiting<'a> {
    fn of(file: &'a Path) -> Option<Self> {
        Some(Self {
            record: serde_json::from_str(&text_of(&waiting_path(file))).ok()?,
            text: text_of(file),
            file,
        })
    }

    /// Whether the file holds the change.
    fn holds(&self) -> bool {
        sha256_hex(self.text.as_bytes()) == self.record.patched_sha256
    }
}

/// The record of a change.
struct Record {
    /// Its place in the end.
    path: PathBuf,
    /// Where it is written first.
    first: PathBuf,
    text: String,
    /// The record that it replaces, of a change that the file holds.
    earlier: Option<String>,
}

impl Record {
    fn of(file: &FileChange) -> Result<Self, ApplyError> {
        let path = record_path(&file.path);
        let replaces = recorded(&file.path, &file.original) == Recorded::After;
        Ok(Self {
            first: if replaces {
                waiting_path(&file.path)
            } else {
                path.clone()
            },
            earlier: replaces.then(|| text_of(&path)),
            text: record_text(file)?,
            path,
        })
    }
}

/// Why a file is not changed in place: it was edited after an earlier change of ours, or it or its record is write-protected.
fn refused(file: &FileChange) -> Option<ApplyError> {
    let record = record_path(&file.path);
    let edited = record.exists() && recorded(&file.path, &file.original) == Recorded::No;
    let edited = edited.then(|| ApplyError::ChangedAlready {
        file: file.path.clone(),
        record: record.clone(),
    });
    let all = [file.path.clone(), record, waiting_path(&file.path)];
    let protected = || all.iter().find_map(|path| check_writable(path).err());
    edited.or_else(|| protected().map(ApplyError::from))
}

/// A dry run says what a change in place would be refused for.
pub(super) fn announce(files: &[FileChange], destination: &Destination, notes: &mut Vec<String>) {
    if *destination == Destination::Nowhere {
        let refusals = files.iter().filter_map(refused);
        notes.extend(refusals.map(|why| format!("--in-place would be refused: {why}")));
    }
}

/// The text of a file; empty where it cannot be read.
pub(super) fn text_of(path: &Path) -> String {
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
