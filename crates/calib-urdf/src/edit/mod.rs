//! Edits of the text: what may be changed, how it is written, checked, compared and reverted.

pub mod change;
pub mod decimal;
pub mod diff;
pub mod error;
mod insert;
pub mod patch;
pub mod revert;
pub(crate) mod rotation;
pub mod verify;
