//! The studies.

mod faults;
mod plugins;
mod study;
