//! `calib apply`.

use std::path::PathBuf;

use calib_apply::{ApplyRequest, Destination};
use calib_pipeline::ExitCode;
use clap::Args;

use crate::error::CliError;
use crate::terminal::{Console, emit, look};

/// Arguments of `calib apply`.
#[derive(Debug, Args)]
#[command(group(clap::ArgGroup::new("destination").required(true).args(["out", "in_place", "diff"])))]
pub struct Apply {
    /// Result of `calib run`: its folder, report.json, or the calibrated URDF
    result: PathBuf,
    /// File to change: a URDF, a xacro, or a kinematics YAML
    target: PathBuf,
    /// Write to this file, or to this folder if the xacro's YAML changes too
    #[arg(short, long)]
    out: Option<PathBuf>,
    /// Overwrite the target and write the change record for `calib revert` beside it
    #[arg(long)]
    in_place: bool,
    /// Write nothing; show the line-by-line difference
    #[arg(long)]
    diff: bool,
    /// The YAML that the xacro loads, if its path cannot be resolved
    #[arg(long, value_name = "FILE")]
    yaml: Option<PathBuf>,
    /// Apply the result even if it was not accepted
    #[arg(long)]
    force: bool,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Applies a result to a target.
pub fn run(console: &Console, options: &Apply) -> Result<ExitCode, CliError> {
    let destination = match &options.out {
        Some(out) => Destination::To(out.clone()),
        None if options.in_place => Destination::InPlace,
        None => Destination::Nowhere,
    };
    let applied = calib_apply::apply(&ApplyRequest {
        result: options.result.clone(),
        target: options.target.clone(),
        yaml: options.yaml.clone(),
        destination,
        force: options.force,
    })?;
    emit(&if options.json {
        calib_apply::json(&applied)?
    } else {
        calib_apply::text(&applied, look(console.color).columns)
    })?;
    Ok(ExitCode::Accepted)
}
