//! `calib`: finds where a robot's joints are relative to the bodies that an optical tracker sees.

// These end the program where a stream is closed: see `terminal`.
#![deny(clippy::print_stdout, clippy::print_stderr)]

mod arguments;
mod commands;
mod error;
mod failure;
mod terminal;

use std::process::ExitCode;

use clap::Parser;

// That of musl takes most of a run's time where threads allocate.
#[cfg(target_env = "musl")]
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> ExitCode {
    let arguments = match arguments::Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(error) => return ExitCode::from(failure::misused(&error)),
    };
    match commands::run(&arguments) {
        Ok(code) => ExitCode::from(code as u8),
        Err(error) => ExitCode::from(failure::failed(&arguments, &error)),
    }
}
