//! Checks of recordings: what is wrong with the data, found before anything is fitted.
//!
//! - [`checks`] looks at one table of poses, against what is known beforehand ([`Expectations`]).
//! - [`held_out_in_training`] compares validation rows with those of the fit.
//! - [`model`] compares a body's motion with that of its link, whose poses come as plain arrays, and names the single
//!   mistake that would explain a disagreement.
//! - [`rigid_body`] learns the arrangement of a body's markers and computes its pose in every row.
//! - [`structural`] finds the mistake that would explain a whole data set, with one marker or many, at registration level.
//! - [`sync`] finds holds, and the offset between two clocks.
//!
//! A check returns [`Finding`](calib_finding::Finding)s: ids and values, no sentences. It stays silent on clean data
//! with Gaussian noise (thresholds are 8σ and more), and its limits are named constants. Lengths are in m, angles in
//! rad, times in s.
//!
//! ```
//! use calib_checks::{Expectations, checks};
//! use calib_finding::catalog;
//! use calib_recording::{Filled, ReadOptions, read_bytes};
//!
//! // A joint that the sweep is about stays where it is.
//! let text = "elbow_deg,tip.x_mm,tip.y_mm,tip.z_mm\n45,100,200,300\n45,100,200,301\n45,101,200,300\n";
//! let poses = read_bytes("sweep.csv", text.as_bytes(), &ReadOptions::default())?.poses(Filled::Exclude)?;
//! let mut expected = Expectations::default();
//! expected.asked.insert("elbow".to_owned(), (0.0, 1.5));
//! let found = checks(&poses, &expected);
//! assert_eq!(found[0].id, catalog::JOINT_NEVER_MOVED);
//! assert_eq!(found[0].text(), "The joint stays at 45° in all rows.");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod model;
mod recording;
pub mod rigid_body;
mod statistics;
pub mod structural;
pub mod sync;

pub use recording::{
    Copied, Expectations, checks, copied_rows, held_out_in_training, other_scales, other_shapes,
    out_of_place, repeated_rows,
};
