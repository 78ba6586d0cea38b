//! Tests of the public interface, one program.

mod merging;
#[cfg(feature = "object-store")]
mod stores;
mod tables;
mod works;
