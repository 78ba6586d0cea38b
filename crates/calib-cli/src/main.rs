//! `calib`: finds where a robot's joints are relative to the bodies that an optical tracker sees.

mod arguments;
mod commands;
mod error;
mod terminal;

use std::error::Error;
use std::process::ExitCode;

use clap::Parser;

fn main() -> ExitCode {
    let arguments = arguments::Arguments::parse();
    match commands::run(&arguments) {
        Ok(code) => ExitCode::from(code as u8),
        Err(error) => {
            let said = with_causes(&error);
            eprintln!("error: {said}");
            if let (Some(remedy), false) = (error.remedy(), said.contains("\n  help: ")) {
                eprintln!("  help: {remedy}");
            }
            ExitCode::from(error.exit_code() as u8)
        }
    }
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
