//! `calib export`.

use std::path::PathBuf;

use calib_export::{Target, export, region, robot};
use calib_pipeline::ExitCode;
use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};

use super::like::Like;
use super::predict::{say_absent, say_rejected, write};
use crate::error::CliError;
use crate::terminal::{Console, say_note};

/// Arguments of `calib export`.
#[derive(Debug, Args)]
pub struct Export {
    /// `<robot>.calibrated.model.json`
    model: PathBuf,
    /// Format
    #[arg(long, value_parser = formats())]
    to: Target,
    /// Link or point at the end of the chain, whose error is stated; a point becomes a link of what is written [default: the last link]
    #[arg(long)]
    tool: Option<String>,
    /// Table of joint positions where the robot is used: `urdf-best` and `opw` are fitted to every second row, and errors are of the
    /// others [default: the fitted range of every joint]
    #[arg(long, value_name = "TABLE")]
    region: Option<PathBuf>,
    /// Column map of the region's table
    #[command(flatten)]
    like: Like,
    /// The file to write; it must not exist [default: standard output]
    #[arg(short, long, value_name = "FILE")]
    out: Option<PathBuf>,
}

/// The names of the formats.
fn formats() -> impl TypedValueParser<Value = Target> {
    let names = Target::ALL.map(|t| PossibleValue::new(t.name()).help(t.about()));
    // A name that is not possible does not come here.
    PossibleValuesParser::new(names).try_map(|name| Target::named(&name).ok_or("not a format"))
}

/// Writes the robot in another format.
pub fn run(console: &Console, options: &Export) -> Result<ExitCode, CliError> {
    let robot = robot(&options.model)?;
    let region = match &options.region {
        Some(table) => {
            let like = options.like.written(table, true)?;
            Some(region(table, &robot, &like)?)
        }
        None => None,
    };
    let rows = region.as_ref().map(|region| region.postures.as_slice());
    let done = export(&robot, options.to, options.tool.as_deref(), rows)?;
    if !console.quiet {
        say_rejected(console, &robot.file);
    }
    if let Some(region) = region.as_ref().filter(|_| !console.quiet) {
        say_absent(console, &region.absent);
    }
    if !console.quiet && !done.lost.is_empty() {
        let note = format!(
            "{} cannot hold {}: {} is off by {:.3} mm rms, {:.3} mm at most, at {} postures",
            options.to.name(),
            done.lost.join(", "),
            done.tool,
            1e3 * done.cost.rms_m,
            1e3 * done.cost.largest_m,
            done.cost.postures
        );
        say_note(console, &note);
    }
    if !console.quiet {
        for renamed in &done.renamed {
            say_note(console, renamed);
        }
    }
    write(console, options.out.as_ref(), &done.text)
}
