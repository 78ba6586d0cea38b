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
//! Stages are functions of plain values. Only [`load`] reads files and only [`mod@write`] writes them; [`apply`],
//! [`take_back`] begin where a run has ended.

mod accuracy;
pub mod align;
pub mod apply;
pub mod assemble;
pub mod cases;
pub mod checks;
pub mod clock;
pub mod closure;
pub mod conditions;
pub mod contacts;
pub mod convert;
pub mod drift;
pub mod error;
pub mod estimators;
pub mod export;
pub mod fit;
pub mod information;
pub mod inspect;
pub mod invariants;
pub mod kinematics;
pub mod known;
pub mod load;
pub mod loads;
pub mod ml;
pub mod model_checks;
pub mod models;
pub mod paper;
mod paths;
pub mod readers;
pub mod relabel;
pub mod residuals;
pub mod run;
pub mod shapes;
pub mod simulate;
pub mod start;
pub mod streams;
pub mod take_back;
pub mod tracks;
pub mod verify;
pub mod view;
pub mod write;

pub use error::{ExitCode, PipelineError};
