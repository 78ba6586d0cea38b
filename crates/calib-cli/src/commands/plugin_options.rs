//! Which plugins a command may load: those of a profile, or those that its flags name.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::path::Path;

use calib_export::{Robot, robot_with};
use calib_model::file::{ModelEffect, ModelJoint, ModelMotion, ModelPlugin};
use calib_pipeline::PipelineError;
use calib_pipeline::options::Plugins;
use calib_pipeline::prepare::plugin_effect::PluginEffect;
use calib_plugin::{Origin, Tables, Value};
use clap::Args;

use crate::error::CliError;

/// Which plugins are loaded.
#[derive(Debug, Clone, Copy, Args)]
pub struct PluginOptions {
    /// Load no plugins; CALIB_NO_PLUGINS does the same
    #[arg(long)]
    no_plugins: bool,
    /// Load plugins of the profile that are neither pinned nor beside it
    #[arg(long, conflicts_with = "no_plugins")]
    allow_plugins: bool,
}

impl PluginOptions {
    /// The same as the library has it.
    #[must_use]
    pub fn plugins(self) -> Plugins {
        match (self.no_plugins, self.allow_plugins) {
            (true, _) => Plugins::Refused,
            (false, true) => Plugins::Allowed,
            (false, false) => Plugins::Placed,
        }
    }
}

/// Plugins of a command that reads no profile.
#[derive(Debug, Clone, Args)]
pub struct NamedPlugins {
    /// Plugin to load, by name or path; can be given several times
    #[arg(long, value_name = "PLUGIN")]
    pub plugin: Vec<String>,
    /// Parameter of the plugin's estimator or reader; can be given several times
    #[arg(long, value_name = "NAME=VALUE", value_parser = pair, requires = "plugin")]
    pub parameter: Vec<(String, String)>,
}

/// A name and its value.
fn pair(text: &str) -> Result<(String, String), String> {
    let parts = text.split_once('=');
    parts
        .map(|(name, value)| (name.trim().to_owned(), value.to_owned()))
        .ok_or_else(|| "write a name and a value, like `iterations=20`".to_owned())
}

/// A robot of a model file, whose effects may be computed by plugins.
pub struct Evaluated {
    /// The robot.
    pub robot: Robot,
    effects: Vec<PluginEffect>,
}

impl Evaluated {
    /// Reads a model file; the plugins of these names or paths compute its effects that are not the program's own.
    pub fn read(path: &Path, plugins: &[String]) -> Result<Self, CliError> {
        let mut tables = Tables::default();
        tables.add_named(plugins).map_err(PipelineError::from)?;
        let made: RefCell<Vec<PluginEffect>> = RefCell::default();
        let failed = RefCell::new(None);
        let find = |joint: &ModelJoint, effect: &ModelEffect| {
            let found = plugin_effect(&tables, joint, effect);
            let found = found.map_err(|error| failed.replace(Some(error))).ok()??;
            let outside = found.outside;
            made.borrow_mut().push(found);
            Some(outside)
        };
        let robot = robot_with(path, &find);
        match failed.into_inner() {
            Some(error) => Err(error),
            None => Ok(Self {
                robot: robot?,
                effects: made.into_inner(),
            }),
        }
    }

    /// Whether the plugins gave every regressor that they were asked for.
    pub fn evaluated(&self) -> Result<(), CliError> {
        let mut effects = self.effects.iter();
        Ok(effects
            .try_for_each(PluginEffect::evaluated)
            .map_err(PipelineError::from)?)
    }
}

/// The effect of a joint by the plugin that the run used; `None` where no plugin that is loaded offers it.
fn plugin_effect(
    tables: &Tables,
    joint: &ModelJoint,
    effect: &ModelEffect,
) -> Result<Option<PluginEffect>, CliError> {
    let Some(needed) = &effect.plugin else {
        return Ok(None);
    };
    let Some(entry) = tables.effect.iter().find(|e| e.offer().name == effect.kind) else {
        return Ok(None);
    };
    if let Origin::Plugin {
        plugin,
        version,
        sha256,
        ..
    } = entry.origin()
        && *sha256 != needed.sha256
    {
        let said = |name: &str, version: &str, sha256: &Option<String>| {
            let digest = sha256.as_deref().unwrap_or("none");
            format!("`{name}` {version} (sha256 {digest})")
        };
        return Err(CliError::OtherPlugin {
            effect: effect.kind.clone(),
            joint: joint.name.clone(),
            needed: said(&needed.name, &needed.version, &needed.sha256),
            found: said(plugin, version, sha256),
        });
    }
    let slides = joint.motion == ModelMotion::Prismatic;
    let made = PluginEffect::new(entry, &parameters(needed), slides);
    Ok(Some(made.map_err(PipelineError::from)?))
}

/// Parameters as a plugin takes them.
fn parameters(of: &ModelPlugin) -> BTreeMap<String, Value> {
    let value = |value: &serde_json::Value| match value {
        serde_json::Value::Bool(flag) => Some(Value::Bool(*flag)),
        serde_json::Value::String(text) => Some(Value::Text(text.clone())),
        serde_json::Value::Number(n) => match n.as_i64() {
            Some(whole) => Some(Value::Integer(whole)),
            None => n.as_f64().map(Value::Number),
        },
        _ => None,
    };
    let given = of.parameters.iter();
    given
        .filter_map(|(name, given)| Some((name.clone(), value(given)?)))
        .collect()
}
