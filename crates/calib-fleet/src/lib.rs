#![doc = include_str!("../README.md")]

pub mod batch;
mod error;
pub mod merge;
pub mod shard;
pub mod shard_file;
pub mod store;
pub mod table;
pub mod work;

pub use error::{FleetError, ShardError, ShardFault};

/// The README's example is a test.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
