//! `calib diff`.

use std::path::PathBuf;

use calib_apply::{diff_json, diff_table, diff_unified};
use calib_pipeline::ExitCode;
use clap::{Args, ValueEnum};

use crate::error::CliError;
use crate::terminal::{emit, emit_raw};

/// Arguments of `calib diff`.
#[derive(Debug, Args)]
pub struct Diff {
    /// First file
    a: PathBuf,
    /// Second file
    b: PathBuf,
    /// Output format
    #[arg(long, value_enum, default_value_t = DiffFormat::Table)]
    format: DiffFormat,
}

/// Renderings of a difference.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum DiffFormat {
    /// A table
    Table,
    /// JSON
    Json,
    /// Unified text difference
    Unified,
}

/// Prints the difference.
pub fn run(options: &Diff) -> Result<ExitCode, CliError> {
    let text = match options.format {
        DiffFormat::Table => diff_table(&options.a, &options.b)?,
        DiffFormat::Json => diff_json(&options.a, &options.b)?,
        DiffFormat::Unified => diff_unified(&options.a, &options.b)?,
    };
    match options.format {
        // A patch has to have the bytes of its files.
        DiffFormat::Unified => emit_raw(&text)?,
        _ => emit(&text)?,
    }
    Ok(ExitCode::Accepted)
}
