//! What stands in the text where the YAML reader stops: values that a person writes and YAML reads as something else.

use crate::locate::Place;

/// The line of a place up to it, and from it on.
fn around(text: &str, place: Place) -> Option<(&str, &str)> {
    let line = text.lines().nth(place.line.checked_sub(1)?)?;
    let (at, _) = line.char_indices().nth(place.column.checked_sub(1)?)?;
    Some(line.split_at(at))
}

/// Digits at the start.
fn leading_digits(text: &str) -> &str {
    let end = text.find(|c: char| !c.is_ascii_digit());
    &text[..end.unwrap_or(text.len())]
}

/// A number with a decimal comma that begins at the place, or whose digits behind the comma do: as it is written, and with a point.
pub(crate) fn decimal_comma(text: &str, place: Place) -> Option<(String, String)> {
    let (before, from) = around(text, place)?;
    let number = |whole: &str, decimals: &str| {
        let given =
            !leading_digits(whole.trim_start_matches('-')).is_empty() && !decimals.is_empty();
        given.then(|| (format!("{whole},{decimals}"), format!("{whole}.{decimals}")))
    };
    if let Some(value) = before.strip_suffix(',') {
        let digits = value.trim_end_matches(|c: char| c.is_ascii_digit());
        let begins = digits.trim_end_matches('-');
        let whole = value.get(begins.len()..)?;
        // `0.2,7` is a number and a key.
        begins.ends_with([' ', ':', '[']).then_some(())?;
        return number(whole, leading_digits(from));
    }
    let quoted = from.trim_start_matches(['"', '\'']);
    let (whole, decimals) = quoted.split_once(',')?;
    let digits = whole.trim_start_matches('-');
    (leading_digits(digits) == digits).then_some(())?;
    number(whole, leading_digits(decimals))
}

/// The plain text that begins at the place, without quotes.
pub(crate) fn plain(text: &str, place: Place) -> Option<&str> {
    let (_, from) = around(text, place)?;
    let end = from.find([',', '}', ']', '#']).unwrap_or(from.len());
    let plain = from[..end].trim().trim_matches(['"', '\'']);
    (!plain.is_empty()).then_some(plain)
}

/// The map of a column of time, with the unit by its name.
pub(crate) fn time_column(column: &str) -> String {
    let unit = column
        .rsplit(['_', '.', '[', '('])
        .next()
        .unwrap_or_default();
    let unit = unit.trim_end_matches([']', ')']);
    let unit = ["ms", "us", "ns"].into_iter().find(|known| *known == unit);
    format!("time: {{column: {column}, unit: {}}}", unit.unwrap_or("s"))
}

/// The text in double quotes that begins at the place, with a backslash in it.
fn with_backslashes(text: &str, place: Place) -> Option<&str> {
    let (_, from) = around(text, place)?;
    let quoted = from.strip_prefix('"')?;
    let written = &quoted[..quoted.find('"')?];
    written.contains('\\').then_some(written)
}

/// The text in double quotes that begins at the place, with a backslash in it: as a person means a path of Windows, with `/`.
pub(crate) fn backslashes(text: &str, place: Place) -> Option<String> {
    let written = with_backslashes(text, place)?;
    Some(written.replace("\\\\", "/").replace('\\', "/"))
}

/// Whether that text is a path of Windows rather than one with escapes: it begins with a drive, or ends as a file does, and has no character by its number.
pub(crate) fn is_path(text: &str, place: Place) -> bool {
    let Some(written) = with_backslashes(text, place) else {
        return false;
    };
    let has_drive = written.chars().nth(1) == Some(':');
    let is_ending = |e: &str| (2..=5).contains(&e.len()) && e.chars().all(char::is_alphanumeric);
    let ends_as_file = written.rsplit_once('.').is_some_and(|(_, e)| is_ending(e));
    let by_number = ["\\u00", "\\x"].iter().any(|n| written.contains(n));
    (has_drive || ends_as_file) && !by_number
}

/// Whether the line of a place is indented by a tab.
pub(crate) fn tab(text: &str, place: Place) -> bool {
    let line = place.line.checked_sub(1).and_then(|i| text.lines().nth(i));
    line.is_some_and(|line| {
        let indent = line.len() - line.trim_start().len();
        line[..indent].contains('\t')
    })
}
