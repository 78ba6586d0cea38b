//! Tests of the public interface, one program.

mod designs;
mod dialects;
mod edit;
mod faulty;
mod hidden;
mod lab;
mod refused;
mod units;
