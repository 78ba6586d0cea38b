//! `calib schema`.

use std::path::PathBuf;

use calib_pipeline::ExitCode;
use calib_pipeline::prepare::estimators::Estimators;
use calib_pipeline::prepare::load::load_robot;
use clap::{Args, ValueEnum};

use super::plugin_options::PluginOptions;
use crate::error::CliError;
use crate::terminal::emit;

/// Arguments of `calib schema`.
#[derive(Debug, Args)]
pub struct Schema {
    /// What the schema describes
    #[arg(value_enum, default_value_t = SchemaOf::Profile)]
    of: SchemaOf,
    /// Include the plugins that this profile names (only for `parameters`)
    #[arg(long)]
    profile: Option<PathBuf>,
    /// Which plugins are loaded
    #[command(flatten)]
    plugins: PluginOptions,
}

/// What has a schema.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum SchemaOf {
    /// The profile
    Profile,
    /// report.json
    Report,
    /// The scene
    Scene,
    /// The robot's model
    Model,
    /// twin.json
    Twin,
    /// Parameters of estimators, readers, report writers and joint effects, by kind and name
    Parameters,
}

/// Prints a JSON Schema.
pub fn run(options: &Schema) -> Result<ExitCode, CliError> {
    let schema = match options.of {
        SchemaOf::Profile => {
            emit(&calib_profile::json_schema())?;
            return Ok(ExitCode::Accepted);
        }
        SchemaOf::Report => calib_report::report_schema(),
        SchemaOf::Scene => calib_report::scene_schema(),
        SchemaOf::Model => calib_report::model_schema(),
        SchemaOf::Twin => calib_twin::write::json_schema(),
        SchemaOf::Parameters => estimators(options)?.parameter_schemas(),
    };
    emit(&(calib_report::json::pretty(&schema) + "\n"))?;
    Ok(ExitCode::Accepted)
}

/// The built-in estimators, or those that a profile can name.
fn estimators(options: &Schema) -> Result<Estimators, CliError> {
    let Some(profile) = &options.profile else {
        return Ok(Estimators::built_in()?);
    };
    let robot = load_robot(profile)?;
    Ok(Estimators::of_profile(
        &robot.profile,
        &robot.folder,
        options.plugins.plugins(),
    )?)
}
