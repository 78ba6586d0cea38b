//! `calib revert`.

use std::path::PathBuf;

use calib_pipeline::ExitCode;
use clap::Args;

use crate::error::CliError;
use crate::terminal::{Console, emit_paths, say, say_note};

/// Arguments of `calib revert`.
#[derive(Debug, Args)]
pub struct Revert {
    /// The changed file, with its change record `<file>.changes.json` beside it
    file: PathBuf,
    /// Where to write the original
    #[arg(short, long, required_unless_present = "in_place")]
    out: Option<PathBuf>,
    /// Overwrite the changed file and remove the record
    #[arg(long, conflicts_with = "out")]
    in_place: bool,
}

/// Restores the original.
pub fn run(console: &Console, options: &Revert) -> Result<ExitCode, CliError> {
    let written = match &options.out {
        Some(out) => calib_apply::revert(&options.file, out)?,
        None => calib_apply::revert_in_place(&options.file)?,
    };
    for note in calib_apply::not_reverted(&options.file) {
        match console.json {
            true => say_note(console, &note),
            false => say(&format!("note: {note}")),
        }
    }
    emit_paths(console.json, &[written])?;
    Ok(ExitCode::Accepted)
}
