#![doc = include_str!("../README.md")]

pub mod ask;
pub mod bodies;
pub mod checked;
pub mod columns;
pub mod computed;
mod conventions;
pub mod correct;
pub mod corrected;
mod delimited;
pub mod edit;
pub mod entry;
mod error;
pub mod fact;
pub mod guess;
pub mod header;
pub mod hold;
mod instead;
pub mod json;
pub mod known;
pub mod labels;
pub mod limits;
pub mod links;
pub mod located;
mod matrix;
mod mirror;
pub mod mistake;
pub mod name;
mod parts;
pub mod proposal;
mod propose;
pub mod robot;
pub mod session;
pub mod signs;
pub mod skeleton;
pub mod source;
pub mod tables;
pub mod terminal;
mod tracked;
mod turns;
mod unfollowed;
mod unread;
mod unrecorded;
pub mod words;
pub mod write;
mod yaml;

pub use error::{InitError, Instead, NoRecording};
pub use fact::{About, Fact, Place};
pub use instead::{HEAD, not_a_urdf};
pub use known::Known;
pub use nalgebra;
pub use proposal::Proposal;
pub use propose::{Request, propose};
pub use source::File;

/// The README's example is a test.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
