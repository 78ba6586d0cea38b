//! The studies.

mod faults;
mod study;
