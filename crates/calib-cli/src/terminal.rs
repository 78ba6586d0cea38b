//! What a command shows: results on standard output, progress on standard error.

use std::io::{IsTerminal as _, Write as _};
use std::path::PathBuf;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};

/// Writes results to standard output; a reader that went away (`| head`) is not an error.
pub fn emit(text: &str) {
    let _ = std::io::stdout().lock().write_all(text.as_bytes());
}

/// Lists files that were written, one per line.
pub fn emit_paths(paths: &[PathBuf]) {
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
