//! Cells of a line, and what separates them.

use calib_recording::Delimiter;

/// The character of a delimiter; `None`: blanks.
pub(crate) fn of_delimiter(delimiter: Delimiter) -> Option<char> {
    match delimiter {
        Delimiter::Comma => Some(','),
        Delimiter::Semicolon => Some(';'),
        Delimiter::Tab => Some('\t'),
        Delimiter::Space => None,
    }
}

/// What separates the cells of a line; `None`: blanks.
pub(crate) fn separator(line: &str) -> Option<char> {
    let count = |c: char| line.matches(c).count();
    let most = [',', ';', '\t'].into_iter().max_by_key(|c| count(*c));
    most.filter(|c| count(*c) > 0)
}

/// The cells, without quotes and blanks around them.
pub(crate) fn cells(line: &str, separator: Option<char>) -> Box<dyn Iterator<Item = &str> + '_> {
    fn clean(cell: &str) -> &str {
        cell.trim().trim_matches('"').trim()
    }
    match separator {
        Some(separator) => Box::new(line.split(separator).map(clean)),
        None => Box::new(line.split_whitespace().map(clean)),
    }
}
