//! The statement of a problem: frames, edges, unknowns, measurements and their noise.

pub(crate) mod baseline;
pub(crate) mod chart;
pub(crate) mod check;
pub(crate) mod edge;
pub(crate) mod error;
pub(crate) mod ids;
pub mod measurement;
pub(crate) mod parameter;
pub(crate) mod problem;

pub(crate) use calib_model::{axis, effect, unit};
