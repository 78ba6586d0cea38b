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
//! Stages are functions of plain values. Only [`prepare::load`] reads files and only [`mod@output::write`] writes them; [`apply`],
//! [`take_back`] begin where a run has ended.

pub mod apply;
pub mod cases;
pub mod convert;
pub mod drift;
pub mod error;
pub mod estimate;
pub mod formulate;
pub mod output;
pub mod prepare;
pub mod run;
pub mod simulate;
pub mod take_back;
pub mod verify;

pub use error::{ExitCode, PipelineError};
