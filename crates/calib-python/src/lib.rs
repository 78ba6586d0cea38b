//! The native half of the Python package `calib`: numbers in and out of numpy arrays, and everything else as plain values.
//!
//! ```text
//! python/calib/*.py   shapes, names, dataclasses, documentation        what people import
//! calib._native       this crate: no text of its own, no computation   arrays ⇄ slices, one call of a library each
//! ```
//!
//! Arrays are C-contiguous `float64`, SI (m, rad, s); a lost sample is a row of NaN. The interpreter is released while a library computes.
//! A long computation runs in a thread of its own and the caller's thread asks for signals meanwhile (`background.rs`). Errors are one
//! exception, `calib.CalibError`, with the text that the program prints (`error.rs`).
//!
//! It does **not** know: what a result means, and how it is shown. Python code that is registered as an estimator or reader (`plugins.rs`) runs
//! in this process with the user's rights.

// The macros of pyo3 write functions of the C border; nothing here does.
#![allow(unsafe_code)]

mod arrays;
mod background;
mod error;
mod fit;
mod jobs;
mod model;
mod plugins;
mod recording;
mod run;
mod table;

/// The module `calib._native`.
#[pyo3::pymodule]
mod _native {
    #[pymodule_export]
    use crate::error::CalibError;
    #[pymodule_export]
    use crate::fit::fit;
    #[pymodule_export]
    use crate::jobs::{plan, simulate, twin};
    #[pymodule_export]
    use crate::model::Model;
    #[pymodule_export]
    use crate::recording::read;
    #[pymodule_export]
    use crate::run::{figures, main, run};
}
