//! Closed forms: each origin alone, and start values for the solver.

pub mod paper;
pub mod start;
