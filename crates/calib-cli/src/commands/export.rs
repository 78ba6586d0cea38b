//! `calib export`.

use std::path::PathBuf;

use calib_export::{Target, export, region, robot};
use calib_pipeline::ExitCode;
use clap::{Args, ValueEnum};

use super::predict::write;
use crate::error::CliError;
use crate::terminal::{Console, say};

/// Arguments of `calib export`.
#[derive(Debug, Args)]
pub struct Export {
    /// `<robot>.calibrated.model.json`
    model: PathBuf,
    /// Format
    #[arg(long, value_enum)]
    to: To,
    /// Link at the end of the chain of `dh`, `hayati` and `poe`, whose error is stated [default: the last one]
    #[arg(long)]
    tool: Option<String>,
    /// Table of joint positions where the robot is used: `urdf-best` is fitted to every second row, and errors are of the others [default: the
    /// fitted range of every joint]
    #[arg(long, value_name = "TABLE")]
    region: Option<PathBuf>,
    /// The file to write; it must not exist [default: standard output]
    #[arg(short, long, value_name = "FILE")]
    out: Option<PathBuf>,
}

/// Formats.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum To {
    /// URDF of the calibrated geometry, without shapes
    Urdf,
    /// URDF refitted to predict best without joint effects
    UrdfBest,
    /// Denavit–Hartenberg parameters, YAML
    Dh,
    /// Denavit–Hartenberg parameters with Hayati's for nearly parallel axes, YAML
    Hayati,
    /// Product of exponentials: screws and home, YAML
    Poe,
    /// MuJoCo's MJCF, kinematics and masses
    Mjcf,
    /// SDFormat 1.9, kinematics and masses
    Sdf,
}

/// Writes the robot in another format.
pub fn run(console: &Console, options: &Export) -> Result<ExitCode, CliError> {
    let robot = robot(&options.model)?;
    let rows = match &options.region {
        Some(table) => Some(region(table, &robot)?),
        None => None,
    };
    let target = match options.to {
        To::Urdf => Target::Urdf,
        To::UrdfBest => Target::UrdfBest,
        To::Dh => Target::Dh,
        To::Hayati => Target::Hayati,
        To::Poe => Target::Poe,
        To::Mjcf => Target::Mjcf,
        To::Sdf => Target::Sdf,
    };
    let done = export(&robot, target, options.tool.as_deref(), rows.as_deref())?;
    if !console.quiet && !done.lost.is_empty() {
        say(&format!(
            "calib: {} cannot hold {}: {} is off by {:.3} mm rms, {:.3} mm at most, at {} postures",
            target.name(),
            done.lost.join(", "),
            done.tool,
            1e3 * done.cost.rms_m,
            1e3 * done.cost.largest_m,
            done.cost.postures
        ));
    }
    write(console, options.out.as_ref(), &done.text)
}
