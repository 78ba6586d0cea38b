//! The command line: its commands and the options that all of them take. The arguments of a command stand in its file.

use clap::{Parser, Subcommand};

use crate::commands::{
    apply, batch, check, completions, convert, correct, diff, drift, export, fit, history, init,
    man, merge, plan, plugins, predict, record, revert, run, schema, simulate, study, twin, view,
};
use crate::terminal::Console;

/// Calibrates the kinematic model of a robot: finds where its joints are relative to the bodies that an optical tracker
/// sees.
///
/// Exit codes: 0 accepted · 1 finished, but the result is not accepted · 2 usage or profile error · 3 data error ·
/// 4 a requested quantity is not observable · 5 did not converge · 6 plugin error · 7 output not written.
#[derive(Debug, Parser)]
#[command(name = "calib", version, about)]
pub struct Arguments {
    /// The command
    #[command(subcommand)]
    pub command: Command,
    /// What every command takes
    #[command(flatten)]
    pub console: Console,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Calibrate: from recordings to a patched URDF, a scene and a report
    Run(run::Run),
    /// Calibrate many robots: a row for each, and which joint drifts in which series
    Batch(batch::BatchArguments),
    /// Show the report of a folder of results
    View(view::View),
    /// Write the first profile of a robot: from its URDF and any recordings, with the evidence for every guess
    Init(init::Init),
    /// Check a profile and its recordings without solving
    Check(check::Check),
    /// Choose the postures to record next, and say what they will tell
    Plan(plan::PlanPostures),
    /// Repeat a session with known truth: what it promises, what it reaches, what it would not notice
    Twin(twin::TwinArguments),
    /// Simulate recordings with known truth for a profile
    Simulate(simulate::Simulate),
    /// Run one estimator on one table, without a profile
    Fit(fit::FitCommand),
    /// Predict poses of a table of joint positions by a calibrated model, with their uncertainty
    Predict(predict::Predict),
    /// Correct a program of joint positions or poses, so that the tool stands where the nominal model has it
    Correct(correct::Correct),
    /// Write a calibrated model in the format of another program, and say what that costs
    Export(export::Export),
    /// Write a calibration into your own URDF, xacro or kinematics YAML
    Apply(apply::Apply),
    /// Compare two robots: URDFs, xacros or kinematics YAMLs
    Diff(diff::Diff),
    /// Test whether a robot changed between two calibrations (false-alarm rate 1 %); exit code 1 if it did, 4 if they
    /// cannot be compared
    Drift(drift::Drift),
    /// Show a robot's quantities over its calibrations
    History(history::History),
    /// Restore the original of a changed URDF, xacro or YAML
    Revert(revert::Revert),
    /// Simulation studies of the estimators, with the Cramér–Rao bound in every cell
    Study(study::StudyRun),
    /// Merge the shards of a study, a twin or a batch into one file
    Merge(merge::Merge),
    /// Record a sweep from a live tracker, guided from pose to pose
    Record(record::Record),
    /// Convert a recording to calib's CSV
    Convert(convert::Convert),
    /// List estimators, readers and plugins; check or create a plugin
    Plugins(plugins::PluginsCommand),
    /// Print a JSON Schema
    Schema(schema::Schema),
    /// Print completions for a shell
    Completions(completions::Completions),
    /// Print the manual page, or write those of all commands
    Man(man::ManPages),
}
