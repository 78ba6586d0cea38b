//! The command line of `calib` as a library: what the program does, and how it says why something failed.
//!
//! The program is [`run`] and nothing else, so another host (a Python wheel) can carry it without a second binary.

// These end the program where a stream is closed: see `terminal`.
#![deny(clippy::print_stdout, clippy::print_stderr)]

mod arguments;
mod commands;
mod error;
mod failure;
mod terminal;

use std::ffi::OsString;

use clap::Parser;

pub use error::CliError;
pub use failure::said;

/// Runs the program with these arguments, the first of which is its own name; returns its exit code.
#[must_use]
pub fn run(arguments: &[OsString]) -> u8 {
    let read = match arguments::Arguments::try_parse_from(arguments) {
        Ok(read) => read,
        Err(error) => return failure::misused(&error, arguments),
    };
    match commands::run(&read) {
        Ok(code) => code as u8,
        Err(error) => failure::failed(&read, &error),
    }
}
