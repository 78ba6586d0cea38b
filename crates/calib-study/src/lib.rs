//! Simulation studies of the estimators: how far from the statistical limit, with the paper's counts and noise.
//!
//! ```text
//! cell = scene × method × quantity;   e_k = estimate − truth in trial k, k = 1..N
//! rms = √(mean |e|²),   bias = |mean e|,   efficiency = bound / mean |e|²                      (1)
//! ```
//!
//! The bound is Cramér and Rao's, of the data that the method uses, at the truth. Every number carries its Monte-Carlo standard
//! error; where the scene is smooth enough, the efficient linear estimator on the same noise serves as a control variate,
//! which makes that error up to ten times smaller (`tally.rs`). `mean |e|` and `|mean e|` stand side by side because the paper's
//! 0.2–0.27 mm can only be the second.
//!
//! ```
//! use calib_study::{Study, StudyOptions, markdown, run};
//!
//! let options = StudyOptions { trials: 2, ..StudyOptions::default() };
//! let result = run(Study::Aor, &options, &|_done, _total| {})?;
//! assert!(markdown(&result).contains("Cramér–Rao"));
//! # Ok::<(), calib_study::StudyError>(())
//! ```
//!
//! Every trial has its own seed, from the study's, the scene's name and its number, and sums are joined in a fixed order: the result
//! does not depend on the number of threads, nor on where a study was interrupted. It holds no clock.
//! What a study does not say: how a real tracker errs. Its noise is normal, independent and as stated.

mod aor;
pub mod cases;
mod cell;
mod claims;
mod cor;
mod experiment;
pub mod faults;
mod held;
mod linear;
mod motion;
mod noise;
mod pieces;
mod render;
mod run;
mod settings;
mod state;
mod tally;
mod tried;
mod units;

pub use cell::{Cell, Part, Quantity, Scene};
pub use claims::{Claim, Measured};
pub use held::{Standard, Standing, Worst};
pub use pieces::Sums;
pub use render::{Figure, csv, json, long_tables, markdown, svg, write};
pub use run::{StudyResult, run, run_with};
pub use settings::{Study, StudyError, StudyOptions};
pub use tried::Tried;
pub use units::Units;
