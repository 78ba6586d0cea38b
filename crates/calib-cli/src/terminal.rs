//! What a command shows: results on standard output, progress on standard error.

use std::io::{ErrorKind, IsTerminal as _, Write as _};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use calib_finding::{printable, printable_in_color};
use calib_report::terminal::{Look, wrapped};
use clap::{Args, ValueEnum};
use indicatif::{ProgressBar, ProgressStyle};

use crate::error::CliError;

/// What every command takes.
#[derive(Debug, Clone, Copy, Args)]
pub struct Console {
    /// Print only results and errors; `run` prints one line
    #[arg(short, long, global = true)]
    pub quiet: bool,
    /// Print JSON, errors too; progress is JSON lines on standard error
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

/// Columns of a stream that a reader sees: COLUMNS, else its terminal's width; `None` where it goes to no terminal.
fn columns(terminal: &console::Term) -> Option<usize> {
    let stated = std::env::var("COLUMNS").ok();
    let stated = stated.and_then(|columns| columns.parse::<usize>().ok());
    let seen = || terminal.size_checked();
    let columns = stated.or_else(|| seen().map(|(_, columns)| usize::from(columns)));
    columns.map(|columns| columns.clamp(*COLUMNS.start(), *COLUMNS.end()))
}

/// Color and width of standard output; [`Look::default`]'s width where nothing states one.
#[must_use]
pub fn look(color: When) -> Look {
    Look {
        color: color.colors(),
        columns: columns(&console::Term::stdout()).unwrap_or(Look::default().columns),
    }
}

/// A message on standard error as wide as that terminal: long lines are wrapped, quoted lines of a file stay. Elsewhere it is unchanged, unless COLUMNS
/// says how wide a reader shows it.
#[must_use]
pub fn folded(text: &str) -> String {
    match columns(&console::Term::stderr()) {
        Some(columns) => folded_to(text, columns),
        None => text.to_owned(),
    }
}

fn folded_to(text: &str, columns: usize) -> String {
    let fold = |line: &str| {
        let inner = line.trim_start();
        // `14 |     rom_degg: [0, 120]`: the mark below it points into the line.
        let number = inner.trim_start_matches(|c: char| c.is_ascii_digit());
        let is_quoted = number.starts_with(" |") || inner.starts_with('|');
        if line.chars().count() <= columns || is_quoted {
            return line.to_owned();
        }
        let indent = " ".repeat(line.len() - inner.len());
        let folded = wrapped(inner, columns, &indent, &format!("{indent}  "));
        folded.trim_end().to_owned()
    };
    text.split('\n').map(fold).collect::<Vec<_>>().join("\n")
}

/// Writes results to standard output, with no control characters but those of colors.
///
/// # Errors
/// [`CliError::Stdout`] where they are lost; a reader that went away (`| head`) has what it wanted.
pub fn emit(text: &str) -> Result<(), CliError> {
    emit_bytes(printable_in_color(text).as_bytes())
}

/// [`emit`] for what programs read byte by byte: unchanged where it does not go to a terminal.
///
/// # Errors
/// As [`emit`].
pub fn emit_raw(text: &str) -> Result<(), CliError> {
    match std::io::stdout().is_terminal() {
        true => emit(text),
        false => emit_bytes(text.as_bytes()),
    }
}

fn emit_bytes(bytes: &[u8]) -> Result<(), CliError> {
    let mut out = std::io::stdout().lock();
    match out.write_all(bytes).and_then(|()| out.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => Err(CliError::Stdout(error)),
        _ => Ok(()),
    }
}

/// A line on standard error. Where that is closed or full, the exit code still tells.
pub fn say(text: &str) {
    let line = format!("{}\n", printable(text));
    let _ = std::io::stderr().lock().write_all(line.as_bytes());
}

/// A remark of a command on standard error: a line, or a JSON line.
pub fn say_note(console: &Console, note: &str) {
    match console.json {
        true => say(&serde_json::json!({"note": note}).to_string()),
        false => say(&folded(&format!("calib: {note}"))),
    }
}

/// The name of a stage as a JSON line on standard error.
pub fn say_stage(stage: &str) {
    say(&serde_json::json!({"progress": stage}).to_string());
}

/// A file that was written, on standard error, where results go to standard output.
pub fn emit_written(console: &Console, path: &Path) {
    if console.json {
        say(&serde_json::json!({"written": [path.display().to_string()]}).to_string());
    } else {
        say(&format!("wrote {}", path.display()));
    }
}

/// How far a long computation is: a bar on a terminal, JSON lines with `--json`, nothing elsewhere.
#[derive(Debug)]
pub struct Counted {
    bar: ProgressBar,
    what: &'static str,
    /// Whole percents of which a line was written, where lines are.
    lines: Option<AtomicU64>,
}

impl Counted {
    /// Counts `what`.
    pub fn new(console: &Console, what: &'static str) -> Self {
        let lines = console.json && !console.quiet;
        Self {
            bar: count_bar(console.quiet || lines, what),
            what,
            lines: lines.then(|| AtomicU64::new(0)),
        }
    }

    /// `done` of `total`; a JSON line for each percent at the most.
    pub fn at(&self, done: u64, total: u64) {
        self.bar.set_length(total);
        self.bar.set_position(done);
        let percent = 100 * done / total.max(1);
        let news = |lines: &AtomicU64| lines.fetch_max(percent, Ordering::SeqCst) < percent;
        if self.lines.as_ref().is_some_and(news) {
            let line = serde_json::json!({"progress": self.what, "done": done, "of": total});
            say(&line.to_string());
        }
    }

    /// Clears the bar.
    pub fn end(&self) {
        self.bar.finish_and_clear();
    }
}

/// Lists files that were written, one per line, or as JSON.
///
/// # Errors
/// As [`emit`].
pub fn emit_paths(json: bool, paths: &[PathBuf]) -> Result<(), CliError> {
    if json {
        let paths: Vec<String> = paths.iter().map(|p| p.display().to_string()).collect();
        return emit(&format!("{}\n", serde_json::json!({"written": paths})));
    }
    let lines = paths.iter().map(|path| format!("{}\n", path.display()));
    emit(&lines.collect::<String>())
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_keeps_to_the_width_and_its_quoted_lines_stay() {
        let quoted =
            "14 |     rom_degg: [0, 120], and a line of the file that is far longer than that";
        let text = format!(
            "error: robots/arm.yaml:14:5: unknown field `rom_degg`, expected one of name, rom_deg\n{quoted}\n  help: a remedy of more words than a line of forty columns has room for"
        );
        let folded = folded_to(&text, 40);
        let lines = folded.lines().filter(|line| *line != quoted);
        let lines: Vec<&str> = lines.collect();
        assert!(lines.iter().all(|l| l.chars().count() <= 40), "{folded}");
        assert!(folded.contains(quoted), "{folded}");
        assert!(
            lines.contains(&"    line of forty columns has room for"),
            "{folded}"
        );
    }
}
