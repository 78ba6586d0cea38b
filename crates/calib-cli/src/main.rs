//! `calib`: finds where a robot's joints are relative to the bodies that an optical tracker sees.

mod arguments;
mod commands;
mod error;
mod terminal;

use std::error::Error;
use std::process::ExitCode;

use clap::Parser;

fn main() -> ExitCode {
    let arguments = match arguments::Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(error) => return misused(&error),
    };
    match commands::run(&arguments) {
        Ok(code) => ExitCode::from(code as u8),
        Err(error) => {
            let (said, code) = (with_causes(&error), error.exit_code() as u8);
            if arguments.console.json {
                terminal::emit_error(&said, error.remedy(), code);
                return ExitCode::from(code);
            }
            eprintln!("error: {said}");
            if let (Some(remedy), false) = (error.remedy(), said.contains("\n  help: ")) {
                eprintln!("  help: {remedy}");
            }
            ExitCode::from(code)
        }
    }
}

/// Help, the version, or a wrong call.
fn misused(error: &clap::Error) -> ExitCode {
    let json = std::env::args_os().any(|argument| argument == "--json");
    if !(json && error.use_stderr()) {
        error.exit();
    }
    let text = error.render().to_string();
    let said = text.trim().trim_start_matches("error: ");
    terminal::emit_error(said, None, calib_pipeline::ExitCode::Usage as u8);
    ExitCode::from(calib_pipeline::ExitCode::Usage as u8)
}

/// The error and what caused it, each thing said once.
fn with_causes(error: &dyn Error) -> String {
    let mut said = error.to_string();
    let mut cause = error.source();
    while let Some(inner) = cause {
        let text = inner.to_string();
        if !said.contains(&text) {
            said = format!("{said}\n  cause: {text}");
        }
        cause = inner.source();
    }
    said
}
