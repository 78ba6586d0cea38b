//! Prior widths in use.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::Unit;

/// The prior width that the numbers of one kind share.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PriorWidth {
    /// Its key under `solve.prior`.
    pub key: String,
    /// SI unit of the numbers.
    pub unit: Unit,
    /// Standard deviation in use.
    pub sigma: f64,
    /// Where it is from.
    pub source: WidthSource,
    /// Standard deviation that the profile states, else the default.
    pub declared: f64,
    /// Standard deviation that is likeliest for the data, `declared` where they do not speak against it; null where they were not asked.
    #[serde(default)]
    pub likeliest: Option<f64>,
    /// Standard error of its logarithm.
    #[serde(default)]
    pub relative_error: Option<f64>,
    /// How many numbers have it.
    pub numbers: usize,
}

/// Where a prior width is from.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum WidthSource {
    /// The profile states it.
    Stated,
    /// The default.
    #[default]
    Default,
    /// The data speak against the default, and predict left-out poses better without it.
    Found,
}
