//! `calib correct`.

use std::path::PathBuf;

use calib_export::{CorrectOptions, Corrected, correct};
use calib_model::file::RobotModelFile;
use calib_pipeline::ExitCode;
use clap::Args;

use super::like::Like;
use super::plugin_options::Evaluated;
use super::predict::{say_absent, say_assumed, say_rejected, write};
use crate::error::CliError;
use crate::terminal::{Console, say_note};

/// Arguments of `calib correct`.
#[derive(Debug, Args)]
pub struct Correct {
    /// `<robot>.calibrated.model.json`
    model: PathBuf,
    /// Table of joint positions, or of poses of the tool in the root's frame (`<tool>.x_m` …)
    program: PathBuf,
    /// Link or point that is to stand where the nominal model has it [default: the last link]
    #[arg(long)]
    tool: Option<String>,
    /// Only the position of the tool is to be right: for arms of fewer than six joints
    #[arg(long)]
    position_only: bool,
    /// Largest change of a turning joint, deg [default: 5.73; 90 for poses]
    #[arg(long, value_name = "DEG")]
    largest_deg: Option<f64>,
    /// Largest change of a sliding joint, mm [default: 50; 1000 for poses]
    #[arg(long, value_name = "MM")]
    largest_mm: Option<f64>,
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

/// Corrects a program.
pub fn run(console: &Console, options: &Correct) -> Result<ExitCode, CliError> {
    for bound in [options.largest_deg, options.largest_mm]
        .into_iter()
        .flatten()
    {
        if !(bound > 0.0 && bound.is_finite()) {
            return Err(CliError::NotABound { bound });
        }
    }
    let with_plugins = Evaluated::read(&options.model, &options.plugin)?;
    let robot = &with_plugins.robot;
    let with = CorrectOptions {
        tool: options.tool.clone(),
        position_only: options.position_only,
        largest_rad: options.largest_deg.map(f64::to_radians),
        largest_m: options.largest_mm.map(|mm| 1e-3 * mm),
        like: options.like.written(&options.program, true)?,
    };
    let done = correct(robot, &options.program, &with)?;
    with_plugins.evaluated()?;
    if !console.quiet {
        if !done.cartesian || done.absent.len() < robot.model.joints().len() {
            say_absent(console, &done.absent);
        }
        say_assumed(console, done.assumed_temperature_c);
        if let Some(note) = unused(&done) {
            say_note(console, &note);
        }
        say_note(console, &summary(&done));
        say_rejected(console, &robot.file);
        if let Some(note) = known(&done, &robot.file) {
            say_note(console, &note);
        }
    }
    write(console, options.out.as_ref(), &done.csv)?;
    Ok(match done.refused {
        0 => ExitCode::Accepted,
        _ => ExitCode::VerdictFail,
    })
}

/// Positions in the table that may have been meant as targets.
fn unused(done: &Corrected) -> Option<String> {
    let first = done.unused.first()?;
    let more = match done.unused.len() - 1 {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    Some(format!(
        "the positions of `{first}`{more} are not used: the calibration does not know the name, and the tool is `{}`; the joint positions of the table are corrected",
        done.tool
    ))
}

/// What the error of the verdict leaves out: it is of bodies in the tracker's frame, and the program is in that of the root.
fn known(done: &Corrected, file: &RobotModelFile) -> Option<String> {
    /// Below twice that error nothing is left out that matters.
    const MORE: f64 = 2.0;
    let known = done.known_m?;
    let stated = file.validity.as_ref()?.position_error_m?;
    (known > MORE * stated).then(|| {
        format!(
            "where `{}` stands in `{}` is known to {:.3} mm rms (σ); the {:.3} mm of the verdict are of the bodies in the tracker's frame. State the `mount` of a body on the root and of one on the last link, or measure points of the cell with the corrected robot and place the program on them",
            done.tool,
            file.root,
            1e3 * known,
            1e3 * stated
        )
    })
}

/// One line of what became of the program.
fn summary(done: &Corrected) -> String {
    let mm = |m: f64| format!("{:.3}", 1e3 * m);
    let mut text = format!(
        "{} of {} rows reached; tool error by the model {} mm rms before, {} mm after",
        done.reached,
        done.rows,
        mm(done.before_m[0]),
        mm(done.after_m[0])
    );
    for (count, what) in [
        (done.outside, "outside of the fitted range"),
        (
            done.elsewhere,
            "by another posture than the row before: the robot does not get there by a small motion",
        ),
        (done.nearer, "nearer only"),
        (done.refused, "refused: they keep their position"),
    ] {
        if count > 0 {
            text.push_str(&format!("; {count} {what}"));
        }
    }
    text
}
