//! Tests of the public interface, one program.

mod merging;
mod tables;
mod works;
