//! `calib completions`.

use calib_pipeline::ExitCode;
use clap::{Args, CommandFactory as _};

use crate::arguments::Arguments;

/// Arguments of `calib completions`.
#[derive(Debug, Args)]
pub struct Completions {
    /// The shell
    shell: clap_complete::Shell,
}

/// Prints the completions.
pub fn run(options: &Completions) -> ExitCode {
    let command = &mut Arguments::command();
    clap_complete::generate(options.shell, command, "calib", &mut std::io::stdout());
    ExitCode::Accepted
}
