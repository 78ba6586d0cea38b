//! `calib`: finds where a robot's joints are relative to the bodies that an optical tracker sees.

use std::process::ExitCode;

// That of musl takes most of a run's time where threads allocate.
#[cfg(target_env = "musl")]
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> ExitCode {
    let arguments: Vec<_> = std::env::args_os().collect();
    ExitCode::from(calib_cli::run(&arguments))
}
