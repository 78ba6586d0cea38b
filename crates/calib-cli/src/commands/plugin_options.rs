//! Which plugins a command may load: those of a profile, or those that its flags name.

use calib_pipeline::options::Plugins;
use clap::Args;

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
