//! `calib drift`.

use std::path::PathBuf;

use calib_pipeline::ExitCode;
use clap::Args;

use crate::error::CliError;
use crate::terminal::{Console, emit, look};

/// Arguments of `calib drift`.
#[derive(Debug, Args)]
pub struct Drift {
    /// Results of the old calibration: a folder or report.json
    old: PathBuf,
    /// Results of the new calibration
    new: PathBuf,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Compares two calibrations.
pub fn run(console: &Console, options: &Drift) -> Result<ExitCode, CliError> {
    let drift = calib_drift::drift(&options.old, &options.new)?;
    emit(&if options.json {
        calib_drift::json(&drift)?
    } else {
        calib_drift::text(&drift, look(console.color).columns)
    })?;
    Ok(match (drift.undecided, drift.changed) {
        (Some(_), _) => ExitCode::NotObservable,
        (None, true) => ExitCode::VerdictFail,
        (None, false) => ExitCode::Accepted,
    })
}
