//! `calib completions`.

use calib_pipeline::ExitCode;
use clap::{Args, Command};

use crate::error::CliError;
use crate::terminal::emit_raw;

/// Arguments of `calib completions`.
#[derive(Debug, Args)]
pub struct Completions {
    /// The shell
    shell: clap_complete::Shell,
}

/// Prints the completions of the program's command line.
pub fn run(options: &Completions, command: &mut Command) -> Result<ExitCode, CliError> {
    let mut script = Vec::new();
    clap_complete::generate(options.shell, command, "calib", &mut script);
    emit_raw(&String::from_utf8_lossy(&script))?;
    Ok(ExitCode::Accepted)
}
