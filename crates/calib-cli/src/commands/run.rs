//! `calib run`.

use std::io::IsTerminal as _;
use std::path::{Path, PathBuf};

use calib_files::{MANIFEST, write_results};
use calib_pipeline::ExitCode;
use calib_pipeline::run::{RunOptions, RunOutput, run as run_profile, select};
use clap::{Args, ValueEnum};

use crate::error::CliError;
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
    /// Choose what to free by how well left-out poses are predicted, starting from what the profile frees
    #[arg(long)]
    pub select: bool,
    /// Only show what --select would choose, and why; writes nothing
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
        let chosen = select(
            &options.profile,
            options.force,
            !options.no_plugins,
            &mut progress,
        )?;
        bar.finish_and_clear();
        emit(&if options.json {
            calib_report::json::selection_json(&chosen)?
        } else {
            calib_report::terminal::selection(&chosen)
        });
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

fn default_folder(profile: &Path) -> PathBuf {
    let name = profile
        .file_stem()
        .map_or_else(|| "profile".into(), std::ffi::OsStr::to_os_string);
    PathBuf::from("results").join(name)
}
