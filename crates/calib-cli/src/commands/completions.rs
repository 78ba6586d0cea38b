//! `calib completions`.

use calib_pipeline::ExitCode;
use clap::{Args, Command};

use crate::error::CliError;
use crate::terminal::{Console, emit, emit_raw};

/// Arguments of `calib completions`.
#[derive(Debug, Args)]
pub struct Completions {
    /// The shell
    shell: clap_complete::Shell,
}

/// Prints the completions of the program's command line.
pub fn run(
    console: &Console,
    options: &Completions,
    command: &mut Command,
) -> Result<ExitCode, CliError> {
    let mut script = Vec::new();
    clap_complete::generate(options.shell, command, "calib", &mut script);
    let script = String::from_utf8_lossy(&script);
    if console.json {
        let shell = options.shell.to_string();
        let of = serde_json::json!({"shell": shell, "script": script});
        emit(&format!("{of}\n"))?;
    } else {
        emit_raw(&script)?;
    }
    Ok(ExitCode::Accepted)
}
