//! Tests of calib-recording through its public interface.

mod bad_tables;
mod bodies;
mod real_tables;
mod tables;
