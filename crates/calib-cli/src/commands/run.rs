//! `calib run`.

use std::io::IsTerminal as _;
use std::path::{Path, PathBuf};
use std::time::Instant;

use calib_files::{MANIFEST, write_results};
use calib_pipeline::ExitCode;
use calib_pipeline::formulate::models;
use calib_pipeline::run::{RunOptions, RunOutput, run as run_profile};
use clap::{Args, ValueEnum};

use crate::error::CliError;
use crate::remaining::with_remaining;
use crate::terminal::{emit, spinner};

/// Arguments of `calib run`.
#[derive(Debug, Args)]
pub struct Run {
    /// The robot's profile
    pub profile: PathBuf,
    /// Folder to write to [default: results/PROFILE]
    #[arg(long)]
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
    /// Rank models by how well they predict each fitted pose from the others; writes nothing
    #[arg(long)]
    pub compare_models: bool,
    /// Load no plugins
    #[arg(long)]
    pub no_plugins: bool,
    /// Print the report as JSON instead of the summary
    #[arg(long)]
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
pub fn run(quiet: bool, verbose: bool, options: &Run) -> Result<ExitCode, CliError> {
    let bar = spinner(quiet);
    let mut progress = |stage: &str| {
        bar.set_message(stage.to_owned());
        if verbose {
            eprintln!("calib: {stage}");
        }
    };
    if options.compare_models {
        let ranked = compare_models(options, &mut progress)?;
        bar.finish_and_clear();
        emit(&ranked);
        return Ok(ExitCode::Accepted);
    }
    let run_options = RunOptions {
        method: options.method.map(|m| match m {
            MethodName::Paper => calib_profile::Method::Paper,
            MethodName::Ml => calib_profile::Method::Ml,
        }),
        force: options.force,
        strict: options.strict,
        no_plugins: options.no_plugins,
    };
    let output = run_profile(&options.profile, &run_options, &mut progress)?;
    progress("write results");
    let out = options
        .out
        .clone()
        .unwrap_or_else(|| default_folder(&options.profile));
    let written = write_results(&out, &output.files)?;
    bar.finish_and_clear();
    show(&output, options.json)?;
    if !options.json && !quiet {
        // Their names stand in the summary.
        let results = written
            .iter()
            .filter(|p| p.file_name().is_some_and(|n| n != MANIFEST));
        emit(&format!(
            "wrote {} files to {}\n",
            results.count(),
            out.display()
        ));
    }
    Ok(output.exit)
}

/// The report as JSON, or its summary.
fn show(output: &RunOutput, json: bool) -> Result<(), CliError> {
    if json {
        emit(&calib_report::json::report_json(&output.report)?);
        return Ok(());
    }
    let color = std::io::stdout().is_terminal() && std::env::var_os("NO_COLOR").is_none();
    emit(&calib_report::terminal::summary(&output.report, color));
    Ok(())
}

/// The ranking of models as text.
fn compare_models(options: &Run, progress: &mut dyn FnMut(&str)) -> Result<String, CliError> {
    let mut began = Instant::now();
    let mut report = |stage: &str, done: usize, all: usize| {
        if done == 0 {
            began = Instant::now();
        }
        progress(&with_remaining(stage, done, all, began.elapsed()));
    };
    let ranked = models::compare_models(&options.profile, options.force, &mut report)?;
    Ok(if options.json {
        models::json(&ranked)
    } else {
        models::table(&ranked)
    })
}

fn default_folder(profile: &Path) -> PathBuf {
    let name = profile
        .file_stem()
        .map_or_else(|| "profile".into(), std::ffi::OsStr::to_os_string);
    PathBuf::from("results").join(name)
}
