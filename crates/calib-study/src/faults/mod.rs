//! `calib study faults`: what the program says where something is wrong that it was not told of.
//!
//! Every case is a robot, a recording design, a body and a fault; tables and profile are made as a user would have them, `calib run`
//! works on them in memory, and what it says is compared with the truth at new poses:
//!
//! ```text
//! wrong = accepted, and (rms error > limit, or e' Σ⁻¹ e beyond 99.9 % over 24 postures)
//! Σ = (covariance of the fit) · (expected error / error that the fit states)²,   as the reason `prediction-expected` states them
//! upper limit of a rate with no event in n cases, 95 %:   1 − 0.05^(1/n) ≈ 3/n                        (1)
//! ```
//!
//! Case k of a cell has its own seed, from the study's, the cell and k: the result does not depend on the number of
//! threads, nor on where the study was interrupted.

mod case;
mod design;
mod disturbance;
mod evidence;
mod fault;
mod goals;
mod names;
mod odds;
mod outcome;
mod place;
mod profile;
mod render;
mod robot;
mod run;
mod settings;
mod state;
mod true_error;
mod units;
mod words;

pub use case::Cell;
pub use design::{Body, Design, Validation};
pub use fault::{Class, Fault};
pub use outcome::{CaseResult, Outcome, report_of};
pub use render::{csv, json, markdown};
pub use robot::Errors;
pub use run::{FaultResult, run_faults};
pub use settings::FaultOptions;
pub use units::Units;
