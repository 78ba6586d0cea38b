//! Closed forms: each origin alone, and start values for the solver.

pub mod estimators;
pub mod paper;
pub mod start;
