//! What a person and a program read of an application.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use calib_urdf::ModelDiff;
use serde::Serialize;

use crate::apply::Applied;
use crate::change::{Destination, FileChange};
use crate::error::ApplyError;
use crate::revert::record_path;

fn unified(file: &FileChange) -> String {
    let name = file.path.display().to_string();
    let new = file
        .written
        .as_ref()
        .map_or_else(|| name.clone(), |p| p.display().to_string());
    calib_urdf::unified(&file.original, &name, &file.patched.text, &new)
}

fn undo(file: &FileChange, destination: &Destination) -> Option<String> {
    let written = file.written.as_ref()?.display().to_string();
    let written = calib_report::shell_path(&written);
    Some(match destination {
        Destination::InPlace => format!("calib revert {written} --in-place"),
        _ => format!("calib revert {written} --out ORIGINAL"),
    })
}

/// For a terminal of so many columns: what moved, which lines change, what was written, how to undo it.
#[must_use]
pub fn text(applied: &Applied, columns: usize) -> String {
    let mut out = String::new();
    // Writing to a String does not fail.
    let _ = writeln!(
        out,
        "{} → {} ({})\n",
        applied.from.display(),
        applied.target.display(),
        applied.kind.word()
    );
    out += &applied.moved.to_string();
    if applied.files.is_empty() {
        let _ = writeln!(out, "\nnothing to do: the target holds this result already");
    }
    if !applied.files.is_empty() {
        out.push('\n');
    }
    for file in &applied.files {
        let lines: BTreeSet<usize> = file.patched.changes.iter().map(|c| c.line).collect();
        let line = format!(
            "{}: {} changed, line{} {}",
            file.path.display(),
            match file.patched.changes.len() {
                1 => "1 value".to_owned(),
                n => format!("{n} values"),
            },
            if lines.len() == 1 { "" } else { "s" },
            ranges(&lines)
        );
        out += &calib_report::terminal::wrapped(&line, columns, "", "  ");
    }
    if applied.destination == Destination::Nowhere {
        for file in &applied.files {
            out.push('\n');
            out += &unified(file);
        }
        out += "\ndry run: nothing was written\n";
    }
    for file in &applied.files {
        if let Some(written) = &file.written {
            let _ = writeln!(
                out,
                "wrote {}\nwrote {}",
                written.display(),
                record_path(written).display()
            );
        }
    }
    for file in &applied.files {
        if let Some(undo) = undo(file, &applied.destination) {
            let _ = writeln!(out, "undo: {undo}");
        }
    }
    for note in &applied.notes {
        out += &calib_report::terminal::wrapped(note, columns, "note: ", "      ");
    }
    out
}

/// `4-9, 11` of 4, 5, … 9, 11.
fn ranges(lines: &BTreeSet<usize>) -> String {
    let mut spans: Vec<(usize, usize)> = Vec::new();
    for &line in lines {
        match spans.last_mut() {
            Some((_, last)) if *last + 1 == line => *last = line,
            _ => spans.push((line, line)),
        }
    }
    let shown = spans.iter().map(|(first, last)| match last - first {
        0 => first.to_string(),
        1 => format!("{first}, {last}"),
        _ => format!("{first}-{last}"),
    });
    shown.collect::<Vec<_>>().join(", ")
}

/// The keys of `calib apply --json`.
#[derive(Debug, Serialize)]
struct Json<'a> {
    calib_apply: u32,
    result: String,
    target: String,
    kind: &'static str,
    written: bool,
    moved: &'a ModelDiff,
    files: Vec<JsonFile<'a>>,
    notes: &'a [String],
    undo: Vec<String>,
}

#[derive(Debug, Serialize)]
struct JsonFile<'a> {
    path: String,
    written: Option<String>,
    record: Option<String>,
    original_sha256: &'a str,
    patched_sha256: &'a str,
    changes: &'a [calib_urdf::Change],
    diff: String,
}

/// For a program.
///
/// # Errors
/// [`ApplyError::Unwritable`] when it has no JSON form.
pub fn json(applied: &Applied) -> Result<String, ApplyError> {
    let shown = Json {
        calib_apply: 1,
        result: applied.from.display().to_string(),
        target: applied.target.display().to_string(),
        kind: applied.kind.word(),
        written: applied.files.iter().any(|f| f.written.is_some()),
        moved: &applied.moved,
        files: applied
            .files
            .iter()
            .map(|f| JsonFile {
                path: f.path.display().to_string(),
                written: f.written.as_ref().map(|p| p.display().to_string()),
                record: f
                    .written
                    .as_ref()
                    .map(|p| record_path(p).display().to_string()),
                original_sha256: &f.record.original_sha256,
                patched_sha256: &f.record.patched_sha256,
                changes: &f.patched.changes,
                diff: unified(f),
            })
            .collect(),
        notes: &applied.notes,
        undo: applied
            .files
            .iter()
            .filter_map(|f| undo(f, &applied.destination))
            .collect(),
    };
    Ok(calib_report::json::exact_json(&shown)?)
}
