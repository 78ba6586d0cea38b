#![doc = include_str!("../README.md")]
//!
//! # What is computed
//!
//! Poses, covariances and commands are those of [`calib_model`]. A format without joint effects holds the geometry alone, or one that
//! was refitted to predict best alone; what that costs is measured against the model itself:
//!
//! ```text
//! cost = rms over postures of |t_format(q) − t_model(q)|                                          (1)
//! urdf-best: argmin over origins of Σ |log(tool_model(q)⁻¹ tool_urdf(q))|² + small ridge           (2)
//! opw: the same over the numbers of an arm with a spherical wrist                                   (3)
//! ```
//!
//! with postures drawn from the fitted range of every joint (fixed seed), or those of a table; the cost of (2) and (3) is of postures
//! that were not fitted.

mod best;
mod commands;
mod correct;
mod cost;
mod dh;
mod error;
mod export;
mod geometric;
mod names;
mod opw;
mod poe;
mod predict;
mod read;
mod starts;
mod table;
mod target;
mod ur;
mod xml;
mod yaml;

pub use commands::CorrectOptions;
pub use correct::{Corrected, correct};
pub use cost::Cost;
pub use error::ExportError;
pub use export::{Exported, export};
pub use predict::{Frame, PredictOptions, Predicted, predict};
pub use read::{Robot, robot, robot_with};
pub use table::{Region, WrittenLike, region};
pub use target::Target;
