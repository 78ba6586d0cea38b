//! `calib`: finds where a robot's joints are relative to the bodies that an optical tracker sees.

use std::process::ExitCode;

// A seventh of a run's time less than with the allocator of glibc; that of musl takes most of it where threads allocate.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> ExitCode {
    let arguments: Vec<_> = std::env::args_os().collect();
    ExitCode::from(calib_cli::run(&arguments))
}
