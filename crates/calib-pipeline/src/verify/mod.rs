//! What a solution is worth: held-out errors, loops, residuals, accuracy over the workspace.

pub(crate) mod accuracy;
pub mod changes;
pub mod closure;
pub mod deviations;
pub mod held_out;
pub mod information;
pub mod invariants;
pub mod known;
pub mod left_out;
pub(crate) mod motions;
pub mod residuals;
