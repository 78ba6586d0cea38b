//! The hand-eye estimators.

mod judged;
mod solvers;
mod uncertain;
