//! `calib predict`.

use std::path::PathBuf;

use calib_export::{Frame, PredictOptions, predict};
use calib_files::{OutputFile, folder_of, write_new};
use calib_model::file::RobotModelFile;
use calib_pipeline::ExitCode;
use clap::{Args, ValueEnum};
use serde_json::json;

use super::like::Like;
use super::plugin_options::Evaluated;
use crate::error::CliError;
use crate::terminal::{Console, emit, emit_paths, emit_written, say_note};

/// The verdict in a model file that is no pass.
const REJECTED: &str = "rejected";

/// Arguments of `calib predict`.
#[derive(Debug, Args)]
pub struct Predict {
    /// `<robot>.calibrated.model.json`
    model: PathBuf,
    /// Table of joint positions, in any format that `calib` reads
    table: PathBuf,
    /// Links, bodies or points [default: all bodies and points]
    #[arg(long, value_delimiter = ',')]
    of: Vec<String>,
    /// Frame that the poses are given in
    #[arg(long = "in", value_enum, default_value_t = In::Root)]
    frame: In,
    /// The rows are no sequence: every joint stands in the middle of its backlash
    #[arg(long)]
    unordered: bool,
    /// The torques of the table load the joints, in place of gravity
    #[arg(long)]
    torques: bool,
    /// Column map of the table
    #[command(flatten)]
    like: Like,
    /// Plugin that computes an effect of the robot, by name or path; can be given several times
    #[arg(long, value_name = "PLUGIN")]
    plugin: Vec<String>,
    /// The CSV to write; it must not exist [default: standard output]
    #[arg(short, long, value_name = "FILE.csv")]
    out: Option<PathBuf>,
}

/// Frames of poses.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum In {
    /// The robot's root link
    Root,
    /// The tracker
    Tracker,
}

/// Predicts the poses of a table.
pub fn run(console: &Console, options: &Predict) -> Result<ExitCode, CliError> {
    let robot = Evaluated::read(&options.model, &options.plugin)?;
    let with = PredictOptions {
        of: options.of.clone(),
        frame: match options.frame {
            In::Root => Frame::Root,
            In::Tracker => Frame::Tracker,
        },
        unordered: options.unordered,
        torques: options.torques,
        like: options.like.written(&options.table, true)?,
    };
    let done = predict(&robot.robot, &options.table, &with)?;
    robot.evaluated()?;
    if !console.quiet {
        say_absent(console, &done.absent);
        say_assumed(console, done.assumed_temperature_c);
        say_rejected(console, &robot.robot.file);
        for (link, own) in &done.renamed {
            let note = format!(
                "`{link}` is the link; the body or point of the same name is `{own}`, as in the scene"
            );
            say_note(console, &note);
        }
        if done.outside > 0 {
            let note = format!(
                "{} of {} rows are outside of the range that was fitted: nothing was verified there",
                done.outside, done.rows
            );
            say_note(console, &note);
        }
        if !done.not_covered.is_empty() {
            let note = format!(
                "no recording moved {}: where one of these joints stands elsewhere, the uncertainty is not known, and the cells of σ are empty",
                done.not_covered.join(", ")
            );
            say_note(console, &note);
        }
    }
    write(console, options.out.as_ref(), &done.csv)
}

/// Whether the calibration that a model is of was rejected.
pub(super) fn say_rejected(console: &Console, file: &RobotModelFile) {
    let rejected = file
        .validity
        .as_ref()
        .is_some_and(|v| v.verdict == REJECTED);
    if rejected {
        say_note(
            console,
            "the calibration that this model is of was rejected: its report says why",
        );
    }
}

/// The temperature that the robot was taken to have.
pub(super) fn say_assumed(console: &Console, celsius: Option<f64>) {
    if let Some(celsius) = celsius {
        let note = format!(
            "the table has no temperature (`temperature_c`), and lengths of this robot follow it: they are those at {celsius} °C"
        );
        say_note(console, &note);
    }
}

/// Joints without a column.
pub(super) fn say_absent(console: &Console, absent: &[String]) {
    if !absent.is_empty() {
        let absent = absent.join(", ");
        let note = format!("joints without a column count as 0: {absent}");
        say_note(console, &note);
    }
}

/// A result to its file, or to standard output: as it is, or as the text in JSON.
pub(super) fn write(
    console: &Console,
    out: Option<&PathBuf>,
    text: &str,
) -> Result<ExitCode, CliError> {
    match out {
        None if console.json => emit(&format!("{}\n", json!({"text": text})))?,
        None => emit(text)?,
        Some(path) => {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            write_new(folder_of(path), &[OutputFile::text(name, text)])?;
            match console.json {
                true => emit_paths(true, std::slice::from_ref(path))?,
                false => emit_written(console, path),
            }
        }
    }
    Ok(ExitCode::Accepted)
}
