//! Tests of calib-checks through its public interface.

mod bodies;
mod checks;
mod real_tables;
mod recall;
mod sync;
