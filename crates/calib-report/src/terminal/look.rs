//! Color, width and paths of a text for a terminal.

use crate::{Report, Verdict, words};
use anstyle::{AnsiColor, Style};

/// Columns of a terminal whose width is not known.
pub const COLUMNS: usize = 80;

/// How a terminal shows text.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Look {
    /// Whether to add ANSI styles; the caller checks what the terminal supports.
    pub color: bool,
    /// Width in characters.
    pub columns: usize,
}

impl Default for Look {
    fn default() -> Self {
        Self {
            color: false,
            columns: COLUMNS,
        }
    }
}

/// Where things are, as a person names them from the working folder; empty where they are not known.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Places<'a> {
    /// The profile as it was given.
    pub profile: &'a str,
    /// The folder of the results.
    pub folder: &'a str,
    /// The report to look at.
    pub page: &'a str,
}

impl Places<'_> {
    /// The command that runs the profile again.
    pub(super) fn again(self, report: &Report) -> String {
        words::diagnosis::again(match self.profile {
            "" => &report.profile,
            profile => profile,
        })
    }

    /// A file that the profile names, from the working folder.
    pub(super) fn of(self, file: &str) -> String {
        let folder = std::path::Path::new(self.profile).parent();
        folder.map_or_else(
            || file.to_owned(),
            |folder| folder.join(file).display().to_string(),
        )
    }
}

/// Text with a style, where color is wanted.
pub(super) fn painted(look: Look, style: Style, text: &str) -> String {
    if look.color {
        format!("{style}{text}{style:#}")
    } else {
        text.to_owned()
    }
}

/// The color of a verdict.
pub(super) fn verdict_style(verdict: Verdict) -> Style {
    match verdict {
        Verdict::Accepted => AnsiColor::Green.on_default().bold(),
        Verdict::AcceptedWithWarnings => AnsiColor::Yellow.on_default().bold(),
        Verdict::Rejected => AnsiColor::Red.on_default().bold(),
        Verdict::NotEvaluated => AnsiColor::Yellow.on_default().bold(),
    }
}
