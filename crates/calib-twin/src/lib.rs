#![doc = include_str!("../README.md")]

pub mod curve;
mod error;
pub mod fault;
pub mod likeness;
pub mod noise;
mod note;
mod page;
pub mod power;
pub mod quantity;
pub mod replay;
pub mod session;
pub mod slip;
pub mod source;
pub mod state;
pub mod summary;
pub mod terminal;
pub mod trial;
pub mod truth;
mod twin;
mod words;
pub mod write;

pub use error::TwinError;
pub use nalgebra;
pub use note::Note;
pub use session::Session;
pub use source::{Source, profile_of, session};
pub use truth::About;
pub use twin::{Options, Twin, settings_text, twin, twin_of};

/// The README's example is a test.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
