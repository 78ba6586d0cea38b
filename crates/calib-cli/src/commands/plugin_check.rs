//! `calib plugins check`: the tests are made by a second process of the program, because a plugin with a fault ends the one that calls it.
//!
//! The second process prints a JSON line for each step; what the plugin itself prints goes to standard error.

use std::io::{BufRead as _, BufReader};
use std::path::PathBuf;
use std::process::{Command, ExitStatus, Stdio};

use calib_pipeline::ExitCode;
use calib_plugin::check::{Conformance, End, Limits, Outcome, Row, Step, check, check_told};
use calib_plugin::{Host, SearchPath};

use serde_json::{Map, Value, json};

use crate::error::CliError;
use crate::error::place::Place;
use crate::terminal::{emit, emit_raw, say};

/// Prints what the tests of a plugin found.
pub fn run(json: bool, plugin: &str) -> Result<ExitCode, CliError> {
    let conformance = match program() {
        Some(program) => guarded(&program, plugin),
        None => None,
    };
    // Where no second process can be started, the tests are made here.
    let conformance = conformance.unwrap_or_else(|| check(&host(), plugin, &Limits::default()));
    if json {
        let rows: Vec<_> = conformance.rows.iter().map(row_json).collect();
        let mut all = json!({
            "plugin": conformance.plugin,
            "passed": conformance.passed(),
            "tests": rows,
        });
        if let (Some(failed), Some(all)) = (failed(&conformance), all.as_object_mut()) {
            all.extend(failed);
        }
        emit(&format!("{all:#}\n"))?;
    } else {
        emit(&format!("{}\n", conformance.to_string().trim_end()))?;
    }
    if conformance.passed() {
        return Ok(ExitCode::Accepted);
    }
    if !json {
        say(help(&conformance));
    }
    Ok(ExitCode::Plugin)
}

/// The keys of an error; `None` where nothing failed.
fn failed(conformance: &Conformance) -> Option<Map<String, Value>> {
    let rows = &conformance.rows;
    let first = rows.iter().find(|row| row.outcome == Outcome::Failed)?;
    let keys = json!({
        "error": format!("{}: {}: {}", first.subject, first.test, first.detail),
        "id": "plugin",
        "place": Place::of(&conformance.plugin),
        "remedy": help(conformance).trim_start_matches("  help: "),
        "exit_code": ExitCode::Plugin as u8,
    });
    match keys {
        Value::Object(keys) => Some(keys),
        _ => None,
    }
}

/// Makes the tests in this process and prints each step.
pub fn steps(plugin: &str) -> Result<ExitCode, CliError> {
    let mut printed = Ok(());
    // The plugin may have printed half a line.
    let mut print = |step: &Step| {
        if printed.is_ok() {
            printed = emit_raw(&format!("\n{}\n", step_json(step)));
        }
    };
    let conformance = check_told(&host(), plugin, &Limits::default(), &mut print);
    printed?;
    Ok(if conformance.passed() {
        ExitCode::Accepted
    } else {
        ExitCode::Plugin
    })
}

fn host() -> Host {
    Host::new(SearchPath::from_environment(None), true)
}

/// The file of this program; `None` in another one that carries it, such as Python.
fn program() -> Option<PathBuf> {
    let program = std::env::current_exe().ok()?;
    let own = program.file_stem().is_some_and(|stem| stem == "calib");
    own.then_some(program)
}

/// The tests made by a second process; `None` if it cannot be started.
fn guarded(program: &PathBuf, plugin: &str) -> Option<Conformance> {
    let mut child = Command::new(program)
        .args(["plugins", "check", "--steps", "--", plugin])
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .spawn()
        .ok()?;
    let mut conformance = Conformance::new(plugin);
    let mut last = None;
    for line in BufReader::new(child.stdout.take()?).split(b'\n') {
        let Ok(line) = line else { break };
        let line = String::from_utf8_lossy(&line);
        match serde_json::from_str(&line)
            .ok()
            .and_then(|value| step(&value))
        {
            Some(step) => {
                conformance.take(&step);
                last = Some(step);
            }
            None if line.trim().is_empty() => {}
            None => say(&line),
        }
    }
    let status = child.wait().ok()?;
    if last != Some(Step::Done) || signal(status).is_some() {
        let end = signal(status).unwrap_or(End::Code(status.code().unwrap_or_default()));
        conformance.ended(last.as_ref(), end);
    }
    Some(conformance)
}

#[cfg(unix)]
fn signal(status: ExitStatus) -> Option<End> {
    use std::os::unix::process::ExitStatusExt as _;
    status.signal().map(End::Signal)
}

#[cfg(not(unix))]
fn signal(_: ExitStatus) -> Option<End> {
    None
}

/// What to do after a failed check.
fn help(conformance: &Conformance) -> &'static str {
    let loaded = conformance
        .rows
        .iter()
        .any(|row| row.test == "loads" && row.outcome == Outcome::Passed);
    if conformance.ended {
        "  help: look at every pointer that the header says may be NULL; `gdb --args calib plugins check --steps PLUGIN` shows the line of a plugin that was compiled with -g"
    } else if loaded {
        "  help: the contract is `calib plugins header`; what each test asks is in the manual, under `plugins`"
    } else {
        "  help: give the library's file with its folder (`./libname.so`), or a name on CALIB_PLUGIN_PATH; the contract is `calib plugins header`"
    }
}

fn row_json(row: &Row) -> Value {
    json!({
        "subject": row.subject,
        "test": row.test,
        "outcome": row.outcome.word(),
        "detail": row.detail,
    })
}

fn step_json(step: &Step) -> Value {
    match step {
        Step::Named(plugin) => json!({"step": "named", "plugin": plugin}),
        Step::Begun {
            subject,
            test,
            case,
        } => json!({"step": "begun", "subject": subject, "test": test, "case": case}),
        Step::Made(row) => json!({"step": "made", "row": row_json(row)}),
        Step::Done => json!({"step": "done"}),
    }
}

/// The step of a line; `None` if it is something else, which the plugin printed.
fn step(value: &Value) -> Option<Step> {
    let text = |of: &Value, key: &str| of.get(key)?.as_str().map(str::to_owned);
    match value.get("step")?.as_str()? {
        "named" => text(value, "plugin").map(Step::Named),
        "begun" => Some(Step::Begun {
            subject: text(value, "subject")?,
            test: text(value, "test")?,
            case: text(value, "case")?,
        }),
        "made" => {
            let row = value.get("row")?;
            let outcome = text(row, "outcome")?;
            let mut outcomes = Outcome::ALL.into_iter();
            Some(Step::Made(Row {
                subject: text(row, "subject")?,
                test: text(row, "test")?,
                outcome: outcomes.find(|o| o.word() == outcome)?,
                detail: text(row, "detail")?,
            }))
        }
        "done" => Some(Step::Done),
        _ => None,
    }
}
