//! `calib run`.

use std::path::{Path, PathBuf};

use calib_files::ResultsFolder;
use calib_pipeline::ExitCode;
use calib_pipeline::run::{RunOptions, RunOutput, run as run_profile};
use calib_pipeline::select::select;
use calib_report::terminal::{self, Places};
use clap::{Args, ValueEnum};

use super::plugin_options::PluginOptions;
use crate::error::CliError;
use crate::terminal::{Console, emit, look, say, say_stage, spinner};

/// Arguments of `calib run`.
#[derive(Debug, Args)]
pub struct Run {
    /// The robot's profile
    pub profile: PathBuf,
    /// Folder to write to [default: results/PROFILE]
    #[arg(short, long)]
    pub out: Option<PathBuf>,
    /// Method to use instead of the profile's
    #[arg(long, value_enum)]
    pub method: Option<MethodName>,
    /// Continue although the data checks found errors
    #[arg(long)]
    pub force: bool,
    /// Exit with 1 where the result is accepted with warnings
    #[arg(long)]
    pub strict: bool,
    /// Select what to free by cross-validation, starting from what the profile frees
    #[arg(long)]
    pub select: bool,
    /// Only show what --select would choose, and why; writes nothing
    #[arg(long)]
    pub compare_models: bool,
    /// Which plugins are loaded
    #[command(flatten)]
    pub plugins: PluginOptions,
    /// Print all tables, not only the summary
    #[arg(long)]
    pub full: bool,
    /// Print the report as JSON instead of the summary
    #[arg(long, conflicts_with = "full")]
    pub json: bool,
}

/// Estimation methods.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum MethodName {
    /// Closed forms of the paper, each origin by itself
    Paper,
    /// Maximum likelihood over all loops at once
    Ml,
}

/// Calibrates, or compares models.
pub fn run(console: &Console, options: &Run) -> Result<ExitCode, CliError> {
    let bar = spinner(console.quiet);
    let mut progress = |stage: &str| {
        bar.set_message(stage.to_owned());
        if console.json && !console.quiet {
            say_stage(stage);
        } else if console.verbose {
            say(&format!("calib: {stage}"));
        }
    };
    if options.compare_models {
        let chosen = select(
            &options.profile,
            options.force,
            options.plugins.plugins(),
            &mut progress,
        )?;
        bar.finish_and_clear();
        emit(&if options.json {
            calib_report::json::selection_json(&chosen)?
        } else {
            calib_report::terminal::selection(&chosen, look(console.color).columns)
        })?;
        return Ok(ExitCode::Accepted);
    }
    let run_options = RunOptions {
        method: options.method.map(|m| match m {
            MethodName::Paper => calib_profile::Method::Paper,
            MethodName::Ml => calib_profile::Method::Ml,
        }),
        force: options.force,
        strict: options.strict,
        select: options.select,
        plugins: options.plugins.plugins(),
        ..RunOptions::default()
    };
    let out = options
        .out
        .clone()
        .unwrap_or_else(|| default_folder(&options.profile));
    // Before the fit: a second run into the same folder would wait for nothing.
    let folder = ResultsFolder::open(&out)?;
    let output = run_profile(&options.profile, &run_options, &mut progress)?;
    progress("write results");
    folder.write(&output.files)?;
    bar.finish_and_clear();
    show(console, options, (&output, &out))?;
    Ok(output.exit)
}

/// The report as JSON, one line of it, its summary, or all of it.
fn show(
    console: &Console,
    options: &Run,
    (output, out): (&RunOutput, &Path),
) -> Result<(), CliError> {
    if options.json {
        return emit(&calib_report::json::report_json(&output.report)?);
    }
    let (folder, page) = (out.display().to_string(), out.join("report.html"));
    let (profile, page) = (
        options.profile.display().to_string(),
        page.display().to_string(),
    );
    let places = Places {
        profile: &profile,
        folder: &folder,
        page: &page,
    };
    let render = match (console.quiet, options.full) {
        (true, _) => terminal::line,
        (false, true) => terminal::full,
        (false, false) => terminal::summary,
    };
    emit(&render(&output.report, look(console.color), places))
}

fn default_folder(profile: &Path) -> PathBuf {
    let name = profile
        .file_stem()
        .map_or_else(|| "profile".into(), std::ffi::OsStr::to_os_string);
    PathBuf::from("results").join(name)
}
