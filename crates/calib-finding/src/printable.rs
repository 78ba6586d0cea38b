//! Text of files and networks as a terminal or a spreadsheet may have it.

use std::borrow::Cow;

/// The text without control characters: line breaks and tabs stay, any other is written as `\u001b`, so that no name in a
/// file can move the cursor, set a title or reverse the direction of the text. JSON keeps its meaning.
#[must_use]
pub fn printable(text: &str) -> Cow<'_, str> {
    escaped(text, false)
}

/// [`printable`] for a text with colors of our own: `ESC [ numbers m` stays too.
#[must_use]
pub fn printable_in_color(text: &str) -> Cow<'_, str> {
    escaped(text, true)
}

fn escaped(text: &str, colors: bool) -> Cow<'_, str> {
    let harmless = |c: char| matches!(c, '\n' | '\t') || !(c.is_control() || redirects(c));
    if text.chars().all(harmless) {
        return Cow::Borrowed(text);
    }
    let mut out = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(c) = rest.chars().next() {
        let length = match color(rest) {
            Some(length) if colors => {
                out.push_str(&rest[..length]);
                length
            }
            _ if harmless(c) => {
                out.push(c);
                c.len_utf8()
            }
            _ => {
                out.push_str(&format!("\\u{:04x}", u32::from(c)));
                c.len_utf8()
            }
        };
        rest = &rest[length..];
    }
    Cow::Owned(out)
}

/// Marks that change the direction of the text after them.
fn redirects(c: char) -> bool {
    matches!(c, '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

/// Length of the color that the text begins with.
fn color(text: &str) -> Option<usize> {
    let numbers = text.strip_prefix("\u{1b}[")?;
    let end = numbers.find(|c: char| !(c.is_ascii_digit() || c == ';'))?;
    numbers[end..].starts_with('m').then_some(2 + end + 1)
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
    use super::{cell, from_cell, printable, printable_in_color};

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
            printable_in_color("\u{1b}[1;31mred\u{1b}[0m"),
            "\u{1b}[1;31mred\u{1b}[0m"
        );
        assert_eq!(printable("\u{1b}[1mbold"), "\\u001b[1mbold");
    }
}
