//! Tests of calib-checks through its public interface.

mod bodies;
mod checks;
mod flips;
mod jumps;
mod likelihood;
mod real_tables;
mod recall;
mod robots;
mod sizes;
mod structural;
mod sync;
mod templates;
mod zeros;
