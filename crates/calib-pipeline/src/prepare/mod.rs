//! From a profile to checked inputs: robot, recordings, clocks, tracks of bodies.

pub mod align;
pub mod aligned;
pub mod checks;
pub mod conditions;
pub(crate) mod effects;
pub mod estimators;
pub mod excluded;
pub mod inputs;
pub mod load;
pub mod loads;
pub(crate) mod named;
pub mod plugin_effect;
pub mod readers;
pub mod relabel;
pub mod repeats;
pub mod robot;
pub mod rows;
pub mod settled;
mod speeds;
pub mod split;
pub mod stopped;
pub mod streams;
pub mod timelines;
pub mod tracks;
mod unknown;
mod untracked;
