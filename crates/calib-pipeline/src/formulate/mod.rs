//! The profile and the recordings as one likelihood problem.

pub mod contacts;
pub mod kinematics;
pub mod ml;
pub mod models;
