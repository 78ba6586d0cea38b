#![doc = include_str!("../README.md")]

pub mod basis;
mod bound;
pub mod candidates;
pub mod compose;
pub mod design;
mod error;
pub mod follow;
pub mod joints;
pub mod known;
pub mod linear;
pub mod list;
mod note;
pub mod order;
mod page;
pub mod places;
pub mod plan;
pub mod prepare;
pub mod scene;
pub mod shape;
pub mod sight;
mod smallest;
pub mod terminal;
mod unchecked;
pub mod view;
mod words;
pub mod write;

pub use error::PlanError;
pub use follow::Follow;
pub use known::Known;
pub use list::{Goal, Plan};
pub use nalgebra;
pub use note::{JointNoiseOf, Note};
pub use plan::plan;
pub use prepare::Options;

/// The README's example is a test.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
