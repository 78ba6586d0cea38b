//! The Rust blocks of the book, compiled and run by `cargo test --doc`. There is nothing else here.

#[cfg(doctest)]
#[doc = include_str!("src/library.md")]
pub mod library {}

#[cfg(doctest)]
#[doc = include_str!("src/not-observable.md")]
pub mod not_observable {}
