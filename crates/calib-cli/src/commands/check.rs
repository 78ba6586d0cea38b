//! `calib check`.

use std::path::PathBuf;

use calib_pipeline::ExitCode;
use calib_pipeline::check;
use clap::Args;

use super::plugin_options::PluginOptions;
use crate::error::CliError;
use crate::terminal::{When, emit, look};

/// Arguments of `calib check`.
#[derive(Debug, Args)]
pub struct Check {
    /// The robot's profile
    profile: PathBuf,
    /// Which plugins are loaded
    #[command(flatten)]
    plugins: PluginOptions,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Prints what the checks found.
pub fn run(color: When, options: &Check) -> Result<ExitCode, CliError> {
    let checked = check::check(&options.profile, options.plugins.plugins())?;
    emit(&if options.json {
        calib_report::json::checks_json(&checked)?
    } else {
        calib_report::terminal::data_checks(&checked, look(color))
    })?;
    Ok(check::exit_code(&checked))
}
