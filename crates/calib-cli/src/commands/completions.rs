//! `calib completions`.

use calib_pipeline::ExitCode;
use clap::{Args, Command};

/// Arguments of `calib completions`.
#[derive(Debug, Args)]
pub struct Completions {
    /// The shell
    shell: clap_complete::Shell,
}

/// Prints the completions of the program's command line.
pub fn run(options: &Completions, command: &mut Command) -> ExitCode {
    clap_complete::generate(options.shell, command, "calib", &mut std::io::stdout());
    ExitCode::Accepted
}
