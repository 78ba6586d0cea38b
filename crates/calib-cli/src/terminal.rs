//! What a command shows: results on standard output, progress on standard error.

use std::io::{IsTerminal as _, Write as _};
use std::path::PathBuf;
use std::time::Duration;

use calib_report::terminal::Look;
use clap::{Args, ValueEnum};
use indicatif::{ProgressBar, ProgressStyle};

/// What every command takes.
#[derive(Debug, Clone, Copy, Args)]
pub struct Console {
    /// Print only results and errors; `run` prints one line
    #[arg(short, long, global = true)]
    pub quiet: bool,
    /// Print JSON; progress and errors are JSON lines on standard error
    #[arg(long, global = true)]
    pub json: bool,
    /// When to color the output; NO_COLOR and CLICOLOR_FORCE decide with `auto`
    #[arg(
        long,
        global = true,
        value_enum,
        value_name = "WHEN",
        default_value_t = When::Auto
    )]
    pub color: When,
    /// Print more on standard error
    #[arg(short, long, global = true)]
    pub verbose: bool,
}

/// When to color.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum When {
    /// On a terminal; NO_COLOR forbids it, CLICOLOR_FORCE forces it
    Auto,
    /// Always
    Always,
    /// Never
    Never,
}

impl When {
    /// Whether standard output is colored.
    #[must_use]
    pub fn colors(self) -> bool {
        let set = |name| std::env::var_os(name).filter(|v| !v.is_empty());
        let demanded = || set("CLICOLOR_FORCE").is_some_and(|v| v != "0");
        match self {
            Self::Always => true,
            Self::Never => false,
            Self::Auto if set("NO_COLOR").is_some() => false,
            Self::Auto => demanded() || std::io::stdout().is_terminal(),
        }
    }
}

/// Columns that a line is still readable with.
const COLUMNS: std::ops::RangeInclusive<usize> = 40..=120;

/// Color and width of standard output: COLUMNS, else the terminal's width, else 80.
#[must_use]
pub fn look(color: When) -> Look {
    let stated = std::env::var("COLUMNS").ok();
    let stated = stated.and_then(|columns| columns.parse().ok());
    let seen = || console::Term::stdout().size_checked();
    let columns = stated.or_else(|| seen().map(|(_, columns)| usize::from(columns)));
    let columns = columns.unwrap_or(Look::default().columns);
    Look {
        color: color.colors(),
        columns: columns.clamp(*COLUMNS.start(), *COLUMNS.end()),
    }
}

/// Writes results to standard output; a reader that went away (`| head`) is not an error.
pub fn emit(text: &str) {
    let _ = std::io::stdout().lock().write_all(text.as_bytes());
}

/// An error as a JSON line on standard error.
pub fn emit_error(said: &str, remedy: Option<&str>, exit_code: u8) {
    let line = serde_json::json!({"error": said, "help": remedy, "exit_code": exit_code});
    eprintln!("{line}");
}

/// The name of a stage as a JSON line on standard error.
pub fn emit_stage(stage: &str) {
    eprintln!("{}", serde_json::json!({"progress": stage}));
}

/// Lists files that were written, one per line, or as JSON.
pub fn emit_paths(json: bool, paths: &[PathBuf]) {
    if json {
        let paths: Vec<String> = paths.iter().map(|p| p.display().to_string()).collect();
        emit(&format!("{}\n", serde_json::json!({"written": paths})));
        return;
    }
    for path in paths {
        emit(&format!("{}\n", path.display()));
    }
}

/// A bar that counts `what`, on a terminal; nothing elsewhere.
pub fn count_bar(quiet: bool, what: &str) -> ProgressBar {
    bar(
        quiet,
        &format!("{{bar:30}} {{pos}}/{{len}} {what}, {{eta}} left"),
    )
}

/// A bar of bytes, on a terminal; nothing elsewhere.
pub fn byte_bar(quiet: bool) -> ProgressBar {
    bar(quiet, "{bar:30} {bytes}/{total_bytes}, {eta} left")
}

/// A spinner, on a terminal; nothing elsewhere.
pub fn spinner(quiet: bool) -> ProgressBar {
    let bar = bar(quiet, "{spinner} {msg} ({elapsed})");
    if !bar.is_hidden() {
        bar.enable_steady_tick(Duration::from_millis(100));
    }
    bar
}

fn bar(quiet: bool, template: &str) -> ProgressBar {
    if quiet || !std::io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::new(0);
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style);
    }
    bar
}
