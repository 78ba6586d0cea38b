//! `calib check`.

use std::path::PathBuf;

use calib_pipeline::ExitCode;
use calib_pipeline::check;
use clap::Args;

use crate::error::CliError;
use crate::terminal::emit;

/// Arguments of `calib check`.
#[derive(Debug, Args)]
pub struct Check {
    /// The robot's profile
    profile: PathBuf,
    /// Print findings as JSON
    #[arg(long)]
    json: bool,
}

/// Prints what the checks found.
pub fn run(options: &Check) -> Result<ExitCode, CliError> {
    let checked = check::check(&options.profile)?;
    emit(&if options.json {
        checked.json()?
    } else {
        checked.text()
    });
    Ok(checked.exit_code())
}
