//! Delimited tables: one row per pose or sample (wide), or one row per body or marker and frame (long).

mod header;
mod rows;
mod write;

pub(crate) use header::is_canonical;
pub use rows::WRITTEN_LIVE;
pub(crate) use rows::{UNIT_TOLERANCE, read_table};
pub use write::{NotWritten, WriteOptions, write_poses, write_recording};
