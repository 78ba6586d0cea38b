//! How the program ends when a command failed: on standard error for people, with `--json` on standard output for programs.

use std::error::Error;
use std::ffi::OsString;

use calib_pipeline::ExitCode;

use crate::arguments::Arguments;
use crate::error::place::Place;
use crate::error::{CliError, HELP};
use crate::terminal::{emit, folded, say};

/// Says why a command failed; returns the exit code.
pub fn failed(arguments: &Arguments, error: &CliError) -> u8 {
    let code = error.exit_code() as u8;
    if arguments.console.json && !matches!(error, CliError::Stdout(_)) {
        let said = with_causes(error);
        let remedy = error.remedy_of(&said);
        return emit_error((error.id(), &said), error.place(), remedy.as_deref(), code);
    }
    say(&folded(&format!("error: {}", self::said(error))));
    code
}

/// An error as the program says it: what failed, what caused it, and the remedy on a line of its own.
#[must_use]
pub fn said(error: &CliError) -> String {
    let said = with_causes(error);
    match error.remedy() {
        Some(remedy) if !said.contains("\n  help: ") => format!("{said}\n  help: {remedy}"),
        _ => said,
    }
}

/// Help, the version, or a wrong call; returns the exit code.
pub fn misused(error: &clap::Error, arguments: &[OsString]) -> u8 {
    let text = error.render();
    let usage = ExitCode::Usage as u8;
    if !error.use_stderr() {
        let colors = crate::terminal::When::Auto.colors();
        let page = match colors {
            true => text.ansi().to_string(),
            false => text.to_string(),
        };
        return match emit(&page) {
            Ok(()) => 0,
            Err(error) => {
                say(&folded(&format!("error: {error}")));
                error.exit_code() as u8
            }
        };
    }
    if arguments.iter().any(|argument| argument == "--json") {
        let plain = text.to_string();
        let said = plain.trim().trim_start_matches("error: ");
        return emit_error(("usage", said), None, Some(HELP), usage);
    }
    say(&folded(text.to_string().trim_end()));
    usage
}

/// An error as a line of JSON on standard output; where that is lost too, on standard error.
fn emit_error(
    (id, said): (&str, &str),
    place: Option<Place>,
    remedy: Option<&str>,
    code: u8,
) -> u8 {
    let line = serde_json::json!({
        "error": said, "id": id, "place": place, "remedy": remedy, "exit_code": code,
    });
    if emit(&format!("{line}\n")).is_err() {
        say(&line.to_string());
    }
    code
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
