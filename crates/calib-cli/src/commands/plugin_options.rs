//! Which plugins a command that reads a profile may load.

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
