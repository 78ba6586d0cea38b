//! Tests of the public interface, one program.

mod designs;
mod lab;
mod refused;
mod units;
