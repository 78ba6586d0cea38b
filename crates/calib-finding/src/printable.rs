//! Text of files and networks as a terminal or a spreadsheet may have it.

use std::borrow::Cow;

/// The text without control characters: line breaks and tabs stay, any other is written as `\u001b`, so that no name in a
/// file can move the cursor, set a title or reverse the direction of the text. JSON keeps its meaning.
#[must_use]
pub fn printable(text: &str) -> Cow<'_, str> {
    escaped(text, is_harmless, |_| None)
}

/// [`printable`] for a name, which is one line: line breaks and tabs do not stay either.
#[must_use]
pub fn printable_line(text: &str) -> Cow<'_, str> {
    escaped(text, |c| !hides(c), |_| None)
}

/// [`printable`] for a text with colors of our own: [`STYLES`] stay too.
#[must_use]
pub fn printable_in_color(text: &str) -> Cow<'_, str> {
    escaped(text, is_harmless, style)
}

/// The sequences that this program styles a text with: the end of a style, bold, and its colors. None of them hides a text.
pub const STYLES: [&str; 7] = [
    "\u{1b}[0m",
    "\u{1b}[1m",
    "\u{1b}[4m",
    "\u{1b}[31m",
    "\u{1b}[32m",
    "\u{1b}[33m",
    "\u{1b}[36m",
];

/// The text with what is not `harmless` escaped; what `kept` finds at the beginning of a rest of it stays.
fn escaped<'t>(
    text: &'t str,
    harmless: impl Fn(char) -> bool,
    kept: impl Fn(&str) -> Option<&'static str>,
) -> Cow<'t, str> {
    if text.chars().all(&harmless) {
        return Cow::Borrowed(text);
    }
    let mut out = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(c) = rest.chars().next() {
        let length = match kept(rest) {
            Some(style) => {
                out.push_str(style);
                style.len()
            }
            None if harmless(c) => {
                out.push(c);
                c.len_utf8()
            }
            None => {
                out.push_str(&format!("\\u{:04x}", u32::from(c)));
                c.len_utf8()
            }
        };
        rest = &rest[length..];
    }
    Cow::Owned(out)
}

fn is_harmless(c: char) -> bool {
    matches!(c, '\n' | '\t') || !hides(c)
}

/// Control characters, separators of lines, and marks that change the direction of the text after them.
fn hides(c: char) -> bool {
    c.is_control()
        || matches!(c, '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

/// The style of ours that the text begins with.
fn style(text: &str) -> Option<&'static str> {
    STYLES.into_iter().find(|style| text.starts_with(style))
}

/// What a spreadsheet takes for a formula begins with one of these.
const FORMULA: [char; 4] = ['=', '+', '-', '@'];

/// A name as the cell of a table: a `'` in front keeps a spreadsheet from computing it. [`from_cell`] takes it away again.
#[must_use]
pub fn cell(text: &str) -> Cow<'_, str> {
    let quoted = text.strip_prefix('\'').unwrap_or(text);
    match quoted.starts_with(FORMULA) {
        true => Cow::Owned(format!("'{text}")),
        false => Cow::Borrowed(text),
    }
}

/// The name behind a cell that [`cell`] made.
#[must_use]
pub fn from_cell(text: &str) -> &str {
    let inner = text.strip_prefix('\'');
    inner
        .filter(|inner| {
            let quoted = inner.strip_prefix('\'').unwrap_or(inner);
            quoted.starts_with(FORMULA)
        })
        .unwrap_or(text)
}

#[cfg(test)]
mod tests {
    use super::{cell, from_cell, printable, printable_in_color, printable_line};

    #[test]
    fn a_cell_is_no_formula_and_gives_its_name_back() {
        for name in [
            "=1+1", "-head", "+x", "@sum", "'=1", "a=b", "'quoted", "", "'",
        ] {
            let written = cell(name);
            assert!(!written.starts_with(super::FORMULA), "{written}");
            assert_eq!(from_cell(&written), name);
        }
        assert_eq!(cell("-head"), "'-head");
        assert_eq!(cell("head"), "head");
    }

    #[test]
    fn nothing_reaches_the_terminal_but_text_and_our_colors() {
        assert_eq!(printable("a\tb\nµ −"), "a\tb\nµ −");
        let hostile = "\u{1b}]0;title\u{7}\u{1b}[2J\r\u{9b}31m\u{202e}";
        let shown = "\\u001b]0;title\\u0007\\u001b[2J\\u000d\\u009b31m\\u202e";
        assert_eq!(printable(hostile), shown);
        assert_eq!(printable_in_color(hostile), shown);
        assert_eq!(
            printable_in_color("\u{1b}[1m\u{1b}[31mred\u{1b}[0m"),
            "\u{1b}[1m\u{1b}[31mred\u{1b}[0m"
        );
        assert_eq!(printable("\u{1b}[1mbold"), "\\u001b[1mbold");
        assert_eq!(printable_in_color("\u{1b}[8mhidden"), "\\u001b[8mhidden");
        assert_eq!(
            printable_line("a\nb\t\u{2028}c µ"),
            "a\\u000ab\\u0009\\u2028c µ"
        );
    }
}
