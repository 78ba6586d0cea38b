//! `calib merge`.

use std::path::PathBuf;

use calib_fleet::merge::merge;
use calib_pipeline::ExitCode;
use clap::Args;

use crate::error::CliError;
use crate::terminal::{Console, Counted, emit_paths};

/// Arguments of `calib merge`.
#[derive(Debug, Args)]
pub struct Merge {
    /// Files of all shards, in any order
    #[arg(required = true, value_name = "SHARD")]
    shards: Vec<PathBuf>,
    /// File to write, which must not exist
    #[arg(short, long, value_name = "FILE")]
    out: PathBuf,
}

/// Merges shards.
pub fn run(console: &Console, options: &Merge) -> Result<ExitCode, CliError> {
    let bar = Counted::new(console, "results");
    merge(&options.shards, &options.out, &|done, total| {
        bar.at(done, total);
    })?;
    bar.end();
    emit_paths(console.json, std::slice::from_ref(&options.out))?;
    Ok(ExitCode::Accepted)
}
