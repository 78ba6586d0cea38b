//! The stages of a calibration, in order. The only crate that knows them all.
//!
//! ```text
//! profile ─ load ─► Inputs ─ tracks ─► BodyTracks ─┬─ paper ─► OriginEstimate[]      closed forms, each origin alone
//!                                                  └─ ml ────► MlFit                 all loops at once
//! estimates ─ kinematics ─► Calibration (corrected robot, mounts, where the robot stands)
//! Calibration + validation ─ verify, closure ─► held-out errors, loops
//! Calibration ─ export ─► patched URDF, scene        everything ─ assemble ─► Report
//! ```
//!
//! Stages are functions of plain values. Only [`prepare::load`] reads files, and no stage writes any: a run returns the files
//! to write.

pub mod check;
pub mod error;
pub mod estimate;
pub mod estimated;
pub mod formulate;
pub mod options;
pub mod output;
pub mod prepare;
pub mod run;
pub mod select;
pub mod verify;

pub use error::{ExitCode, PipelineError};
