#![doc = include_str!("../README.md")]

mod error;
mod output;
mod state;

pub use error::{FileError, cannot_write};
pub use output::{MANIFEST, OutputFile, replace, write_new, write_results};
pub use state::StateFile;
