//! `calib batch`.

use std::path::PathBuf;

use calib_fleet::batch::{Batch, How, Keep, members, text};
use calib_pipeline::ExitCode;
use calib_pipeline::run::RunOptions;
use clap::{Args, ValueEnum};

use super::plugin_options::PluginOptions;
use super::shard_options::ShardOptions;
use crate::error::CliError;
use crate::error::place::of_pipeline;
use crate::terminal::{Console, Counted, emit, emit_paths, emit_written};

/// Arguments of `calib batch`.
#[derive(Debug, Args)]
pub struct BatchArguments {
    /// List of robots in YAML, or a quoted pattern of profiles: 'fleet/*.yaml'
    #[arg(value_name = "FLEET")]
    fleet: String,
    /// Folder to write to; an interrupted batch continues there
    #[arg(short, long)]
    out: PathBuf,
    /// Folder of the last batch, to compare each robot with its last calibration
    #[arg(long, value_name = "FOLDER")]
    earlier: Option<PathBuf>,
    /// Number of robots calibrated at a time [default: one for each processor]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    jobs: Option<u16>,
    /// Which files of each robot are kept
    #[arg(long, value_enum, default_value_t = KeepName::Report)]
    keep: KeepName,
    /// Continue although the data checks found errors
    #[arg(long)]
    force: bool,
    /// Start over instead of continuing
    #[arg(long)]
    restart: bool,
    /// Which part of the work is done here
    #[command(flatten)]
    shards: ShardOptions,
    /// Which plugins are loaded
    #[command(flatten)]
    plugins: PluginOptions,
}

/// Which files of each robot are kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum KeepName {
    /// The report as data, which the next batch compares with
    Report,
    /// Everything that `calib run` writes
    All,
}

/// Calibrates a fleet.
pub fn run(console: &Console, options: &BatchArguments) -> Result<ExitCode, CliError> {
    let robots = members(&options.fleet, options.earlier.as_deref())?;
    let batch = Batch {
        members: &robots,
        how: How {
            run: RunOptions {
                force: options.force,
                plugins: options.plugins.plugins(),
                ..RunOptions::default()
            },
            keep: match options.keep {
                KeepName::Report => Keep::Report,
                KeepName::All => Keep::All,
            },
            restart: options.restart,
            id: &of_pipeline,
        },
        out: &options.out,
        jobs: options.jobs.map(usize::from),
    };
    let bar = Counted::new(console, "robots");
    let progress = |done, total| bar.at(done, total);
    if let Some(shard) = options.shards.shard {
        let store = options.shards.store()?;
        let path = batch.shard(shard, store.as_ref(), &progress)?;
        bar.end();
        emit_paths(console.json, &[path])?;
        return Ok(ExitCode::Accepted);
    }
    let files = match &options.shards.from {
        Some(merged) => batch.from(merged)?,
        None => batch.run(&progress)?,
    };
    bar.end();
    emit(&match console.json {
        true => files.json,
        false => text(&files.summary),
    })?;
    if !console.quiet {
        for path in &files.written {
            emit_written(console, path);
        }
    }
    Ok(ExitCode::Accepted)
}
