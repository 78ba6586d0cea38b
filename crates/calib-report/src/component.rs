//! Estimators, readers, report writers and joint effects of plugins that a run used: whose code gave the numbers.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// An estimator, a reader, a report writer or a joint effect that a run used, and where its code is from.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Component {
    /// Its kind: `calib.cor/1` (center), `calib.aor/1` (axis), `calib.reader/1`, `calib.report/1`, `calib.effect/1`.
    pub kind: String,
    /// How the profile names it.
    pub name: String,
    /// What used it: origins, recordings, joints, or outputs of the profile.
    pub used_for: Vec<String>,
    /// The plugin that it is from; null: part of the program.
    pub plugin: Option<PluginFile>,
}

/// A plugin that a run used.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct PluginFile {
    /// What it calls itself.
    pub name: String,
    /// Its own version.
    pub version: String,
    /// Of its file, 64 hexadecimal digits; null: linked into the program.
    pub sha256: Option<String>,
}
