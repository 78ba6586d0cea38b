//! What a twin assumes, and what it leaves out: facts; [`crate::words`] makes the sentences.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Where the noise of planned postures is taken from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum NoiseOf {
    /// Recordings that exist show it.
    Recordings,
    /// The profile states it.
    Profile,
    /// The profile's `simulate` section states it.
    Simulation,
    /// Nothing tells it: what the program takes for a tracker.
    Program,
}

/// One assumption or limit of a twin.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "id", rename_all = "snake_case")]
pub enum Note {
    /// Rows of motions are taken as postures: that the clocks go together is not tried again.
    StreamsAsRows {
        /// Their recordings.
        recordings: Vec<String>,
    },
    /// Measurements that the fit rejected are gaps.
    RejectedAreGaps {
        /// How many.
        count: usize,
    },
    /// Nothing is recorded: one draw of the profile's `simulate` section stands for the recordings.
    FromSimulation,
    /// The postures are those of a plan.
    FromPlan {
        /// How many are fitted.
        postures: usize,
        /// Rows of recordings that exist, and are fitted with them.
        beside: usize,
        /// Whose noise they have.
        noise: NoiseOf,
        /// σ of a joint's reading, rad.
        joint_sigma: f64,
        /// Where it is taken from.
        joint_noise: NoiseOf,
    },
    /// Origins whose sweeps are not recorded are left out.
    OriginsWithoutSweep {
        /// Their names.
        origins: Vec<String>,
    },
    /// The noise is not that of the session.
    NoiseScaled {
        /// Percent of what was found.
        percent: u32,
    },
}
