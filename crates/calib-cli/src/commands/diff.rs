//! `calib diff`.

use std::path::PathBuf;

use calib_apply::{diff_json, diff_table, diff_unified};
use calib_pipeline::ExitCode;
use clap::{Args, ValueEnum};

use crate::error::CliError;
use crate::terminal::{Console, emit, emit_raw};

/// Arguments of `calib diff`.
#[derive(Debug, Args)]
pub struct Diff {
    /// First file
    a: PathBuf,
    /// Second file
    b: PathBuf,
    /// Output format [default: table, with --json json]
    #[arg(long, value_enum)]
    format: Option<DiffFormat>,
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
pub fn run(console: &Console, options: &Diff) -> Result<ExitCode, CliError> {
    let format = options.format.unwrap_or(match console.json {
        true => DiffFormat::Json,
        false => DiffFormat::Table,
    });
    let text = match format {
        DiffFormat::Table => diff_table(&options.a, &options.b)?,
        DiffFormat::Json => diff_json(&options.a, &options.b)?,
        DiffFormat::Unified => diff_unified(&options.a, &options.b)?,
    };
    match format {
        DiffFormat::Json => emit(&text)?,
        _ if console.json => emit(&format!("{}\n", serde_json::json!({"text": text})))?,
        // A patch has to have the bytes of its files.
        DiffFormat::Unified => emit_raw(&text)?,
        _ => emit(&text)?,
    }
    Ok(ExitCode::Accepted)
}
