//! Delimited tables: one row per pose or sample (wide), or one row per body or marker and frame (long).

mod header;
mod read;
mod rows;
mod stated_unit;
mod unit_row;
mod write;
mod write_mapped;

pub(crate) use header::{Known, is_canonical, length_unit};
pub use read::WRITTEN_LIVE;
pub(crate) use read::read_table;
pub use stated_unit::{StatedUnit, UnitRow};
pub use unit_row::unit_row;
pub use write::{NotWritten, WriteOptions, joint_column, write_poses, write_recording};
pub use write_mapped::write_mapped;
