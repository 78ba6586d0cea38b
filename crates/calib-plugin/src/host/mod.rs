//! Finding, loading and calling plugins.
#![allow(unsafe_code)] // It speaks C: libraries are opened and their functions called here and nowhere else.

mod aor;
mod call;
mod cor;
mod describe;
mod effect;
mod error;
mod estimator;
mod load;
mod pin;
mod raw;
mod reader;
mod report;
mod search;

pub use call::{Cancel, Control, Progress};
pub use describe::Description;
pub use error::PluginError;
pub use load::{Host, LoadedPlugin};
pub use search::{Found, SearchPath};
