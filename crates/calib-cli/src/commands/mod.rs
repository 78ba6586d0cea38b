//! One file for each command: its arguments, and what it does with them.

pub mod apply;
pub mod batch;
pub mod check;
pub mod completions;
pub mod convert;
pub mod correct;
pub mod diff;
pub mod drift;
pub mod export;
pub mod fit;
pub mod history;
pub mod init;
mod like;
pub mod man;
pub mod merge;
mod names;
pub mod plan;
mod plan_file;
mod plugin_check;
mod plugin_options;
pub mod plugins;
pub mod predict;
pub mod record;
pub mod revert;
pub mod run;
pub mod schema;
mod shard_options;
pub mod simulate;
pub mod study;
pub mod twin;
pub mod view;

use calib_pipeline::ExitCode;
use clap::CommandFactory as _;

use crate::arguments::{Arguments, Command};
use crate::error::CliError;

/// Runs the command.
pub fn run(arguments: &Arguments) -> Result<ExitCode, CliError> {
    let console = &arguments.console;
    match &arguments.command {
        Command::Run(options) => run::run(console, options),
        Command::Batch(options) => batch::run(console, options),
        Command::Init(options) => init::run(console, options),
        Command::Check(options) => check::run(console.color, options),
        Command::Plan(options) => plan::run(console, options),
        Command::Twin(options) => twin::run(console, options),
        Command::Simulate(options) => simulate::run(console, options),
        Command::Fit(options) => fit::run(options),
        Command::Predict(options) => predict::run(console, options),
        Command::Correct(options) => correct::run(console, options),
        Command::Export(options) => export::run(console, options),
        Command::Apply(options) => apply::run(console, options),
        Command::Diff(options) => diff::run(console, options),
        Command::Drift(options) => drift::run(console, options),
        Command::History(options) => history::run(console, options),
        Command::Revert(options) => revert::run(console, options),
        Command::Study(options) => study::run(console, options),
        Command::Merge(options) => merge::run(console, options),
        Command::Record(options) => record::run(console, options),
        Command::Convert(options) => convert::run(console, options),
        Command::Plugins(options) => plugins::run(console, options),
        Command::Schema(options) => schema::run(options),
        Command::Completions(options) => {
            completions::run(console, options, &mut Arguments::command())
        }
        Command::Man(options) => man::run(console, options, Arguments::command()),
        Command::View(options) => view::run(console, options),
    }
}
