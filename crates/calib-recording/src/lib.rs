//! Recordings: what trackers and robots write, brought into one form.
//!
//! A recording is a set of streams, each sampled at instants `t_i` of its own clock:
//!
//! ```text
//! joints   q_i ∈ R (rad, m)              torques  τ_i (N·m), temperatures (°C)
//! markers  p_i ∈ R³ (m)                  bodies   tracker_from_body_i ∈ SE(3)
//! ```
//!
//! Every sample may be lost, and lost is a state of its own: no zeros, no NaN. Files of static poses have one row
//! per pose and no useful time; [`Poses`] is that table.
//!
//! ```
//! use calib_recording::{Filled, ReadOptions, read_bytes};
//!
//! let text = "elbow_deg,tip.x_mm,tip.y_mm,tip.z_mm\n90,100,200,300\n45,,,\n";
//! let poses = read_bytes("poses.csv", text.as_bytes(), &ReadOptions::default())?.poses(Filled::Exclude)?;
//! assert_eq!(poses.joints["elbow"][0], Some(std::f64::consts::FRAC_PI_2));
//! assert_eq!(poses.markers["tip"][1], None);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Readers ([`readers`]) convert to SI and list what they converted; errors name file, line and column. What a reader
//! notices without failing is a [`Finding`](calib_finding::Finding) in [`Meta`]. Whether the data make sense is
//! checked by `calib-checks`.

mod column_map;
mod date_time;
mod encoding;
mod error;
mod euler;
mod growth;
mod map_fault;
mod model;
mod placeholder;
mod poses;
pub mod readers;
mod remedy;
mod rename;
mod rotation;
mod table;
mod text;
mod units;

pub use column_map::{
    BodyColumns, ColumnMap, Delimiter, EulerColumns, LongColumns, PRESETS, RotationColumns,
    TimeColumn,
};
pub use date_time::{DateTime, date_time};
pub use encoding::utf8;
pub use error::{Against, At, Error, Problem};
pub use euler::EulerAxes;
pub use map_fault::{MapFault, StatedUnits};
pub use model::{
    BodyStream, Filled, JointColumn, JointStream, JointUnit, MarkerSample, MarkerStream, Meta,
    Recording, TemperatureStream, Timeline, TorqueStream, WHOLE_ROBOT,
};
pub use poses::{NotOneTable, Poses};
pub use readers::{ReadOptions, RotationForm, read_bytes, read_path, read_path_with};
pub use rename::renamed_comment;
pub use table::{
    NotWritten, StatedUnit, UnitRow, WRITTEN_LIVE, WriteOptions, joint_column, unit_row,
    write_mapped, write_poses, write_recording,
};
pub use text::stated_separator;
pub use units::{AngleUnit, LengthUnit, TimeUnit};
