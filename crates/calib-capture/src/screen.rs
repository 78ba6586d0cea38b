//! What the operator reads while recording: permanent lines and one status line.

use std::io::Write;

use calib_finding::printable;

/// Maximum length of a line.
pub const WIDTH: usize = 80;

/// Shows lines and a status.
pub trait Screen {
    /// Shows a permanent line.
    fn line(&mut self, text: &str);
    /// Shows the status at this time, s; it replaces the previous status.
    fn status(&mut self, text: &str, now: f64);
}

/// A terminal: the status is in the last line and is overwritten.
#[derive(Debug)]
pub struct Terminal<W: Write> {
    out: W,
    shown: bool,
    last: Option<f64>,
}

impl<W: Write> Terminal<W> {
    /// Writes to `out`.
    pub fn new(out: W) -> Self {
        Terminal {
            out,
            shown: false,
            last: None,
        }
    }
}

impl<W: Write> Screen for Terminal<W> {
    fn line(&mut self, text: &str) {
        if std::mem::take(&mut self.shown) {
            let _ = write!(self.out, "\r\x1b[K");
        }
        for line in folded(text) {
            let _ = writeln!(self.out, "{line}");
        }
        self.last = None;
    }

    fn status(&mut self, text: &str, now: f64) {
        // Faster than ten times a second is not readable.
        if self
            .last
            .is_some_and(|last| (0.0..0.1).contains(&(now - last)))
        {
            return;
        }
        self.last = Some(now);
        self.shown = true;
        let short: String = printable(text)
            .replace('\n', " ")
            .chars()
            .take(WIDTH - 1)
            .collect();
        let _ = write!(self.out, "\r\x1b[K{short}");
        let _ = self.out.flush();
    }
}

/// Anything else: plain lines, and the status every few seconds when it has changed.
#[derive(Debug)]
pub struct Lines<W: Write> {
    out: W,
    last: Option<(f64, String)>,
}

impl<W: Write> Lines<W> {
    /// Writes to `out`.
    pub fn new(out: W) -> Self {
        Lines { out, last: None }
    }
}

/// Time between two status lines in a file, s.
const SELDOM: f64 = 5.0;

impl<W: Write> Screen for Lines<W> {
    fn line(&mut self, text: &str) {
        for line in folded(text) {
            let _ = writeln!(self.out, "{line}");
        }
        let _ = self.out.flush();
    }

    fn status(&mut self, text: &str, now: f64) {
        match &self.last {
            Some((at, shown)) if now - at < SELDOM || shown == text => {}
            None => self.last = Some((now, String::new())),
            Some(_) => {
                self.line(text);
                self.last = Some((now, text.to_string()));
            }
        }
    }
}

/// The text in lines of at most [`WIDTH`] characters, broken at spaces, continuation lines indented by two spaces.
fn folded(text: &str) -> Vec<String> {
    let mut lines = Vec::new();
    // Names of trackers and bodies come from the network.
    for part in printable(text).lines() {
        let indent = part
            .chars()
            .take_while(|c| *c == ' ')
            .count()
            .min(WIDTH / 2);
        let mut line = " ".repeat(indent);
        let mut empty = true;
        for word in part.split_whitespace() {
            if !empty && line.chars().count() + 1 + word.chars().count() > WIDTH {
                lines.push(std::mem::replace(&mut line, " ".repeat(indent + 2)));
                empty = true;
            }
            if !empty {
                line.push(' ');
            }
            line.push_str(word);
            empty = false;
        }
        lines.push(line);
    }
    lines
}
