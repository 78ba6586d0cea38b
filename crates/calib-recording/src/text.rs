//! Lines, cells and numbers of text files: streamed, counted, and checked as they come.

use crate::column_map::Delimiter;
use crate::error::{At, Placed, Problem, excerpt};
use calib_finding::from_cell;
use std::io::{BufRead, Read};

/// Longest line that is still a table: a Nexus row with a thousand markers has about 30 kB.
const MAX_LINE: usize = 64 << 20;

/// Lines of a text file, from 1; without their ends (LF or CRLF) and without a byte order mark.
pub(crate) struct Lines<R> {
    input: R,
    buffer: Vec<u8>,
    number: u64,
}

impl<R: BufRead> Lines<R> {
    pub(crate) fn new(input: R) -> Self {
        Lines {
            input,
            buffer: Vec::new(),
            number: 0,
        }
    }

    /// Number of the line that [`next`](Self::next) returned last.
    pub(crate) fn number(&self) -> u64 {
        self.number
    }

    /// The next line, or `None` at the end.
    pub(crate) fn next(&mut self) -> Placed<Option<&str>> {
        Ok(self.next_whole()?.map(|(line, _)| line))
    }

    /// The next line and whether it ended with a line break, or `None` at the end.
    pub(crate) fn next_whole(&mut self) -> Placed<Option<(&str, bool)>> {
        self.buffer.clear();
        let at = At::Line(self.number + 1);
        let read = (&mut self.input)
            .take(MAX_LINE as u64 + 1)
            .read_until(b'\n', &mut self.buffer)
            .map_err(|source| (at.clone(), Problem::Io(source)))?;
        if read == 0 {
            return Ok(None);
        }
        if read > MAX_LINE {
            return Err((at, Problem::LineTooLong { limit: MAX_LINE }));
        }
        self.number += 1;
        let mut line: &[u8] = &self.buffer;
        let whole = line.ends_with(b"\n");
        line = line.strip_suffix(b"\n").unwrap_or(line);
        line = line.strip_suffix(b"\r").unwrap_or(line);
        if self.number == 1 {
            line = line.strip_prefix(b"\xef\xbb\xbf").unwrap_or(line);
        }
        match std::str::from_utf8(line) {
            Ok(text) => Ok(Some((text, whole))),
            Err(error) => Err((
                at,
                Problem::NotUtf8 {
                    byte: error.valid_up_to(),
                },
            )),
        }
    }
}

/// What separates cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Separator {
    Byte(u8),
    /// Any run of blanks and tabs; leading and trailing ones do not count.
    Blanks,
}

impl Separator {
    /// The one that occurs in a header line: `;` and tab win over `,`, which also occurs inside names.
    pub(crate) fn guess(header: &str) -> Self {
        for byte in [b';', b'\t', b','] {
            if header.bytes().any(|b| b == byte) {
                return Separator::Byte(byte);
            }
        }
        if header.trim().contains(' ') {
            Separator::Blanks
        } else {
            Separator::Byte(b',')
        }
    }
}

/// The separator that a first line `sep=;` states, as spreadsheets write it; an error is what it states and no table has.
pub fn stated_separator(line: &str) -> Option<Result<Delimiter, &str>> {
    let line = line.trim_end_matches(['\r', '\n', ' ']);
    let line = line.strip_prefix('"').unwrap_or(line);
    let (key, stated) = line.split_at_checked(4)?;
    if !key.eq_ignore_ascii_case("sep=") {
        return None;
    }
    let mut rest = stated.trim_end_matches('"');
    // The line of a table of `;` may be padded with them.
    if let Some(first) = rest.chars().next() {
        rest = match rest.chars().all(|c| c == first) {
            true => &rest[..first.len_utf8()],
            false => rest,
        };
    }
    Some(match rest {
        "," => Ok(Delimiter::Comma),
        ";" => Ok(Delimiter::Semicolon),
        "\t" | "\\t" => Ok(Delimiter::Tab),
        // A blank at the end of the line may be gone.
        "" => Ok(Delimiter::Space),
        other => Err(other),
    })
}

impl From<Delimiter> for Separator {
    fn from(delimiter: Delimiter) -> Self {
        match delimiter {
            Delimiter::Comma => Separator::Byte(b','),
            Delimiter::Semicolon => Separator::Byte(b';'),
            Delimiter::Tab => Separator::Byte(b'\t'),
            Delimiter::Space => Separator::Blanks,
        }
    }
}

/// The header line of a text, the first that is neither blank nor a comment nor states the separator, and its separator.
pub(crate) fn header_line(text: &str) -> Option<(&str, Separator)> {
    let mut stated = None;
    for (i, line) in text.lines().enumerate() {
        if i == 0
            && let Some(separator) = stated_separator(line)
        {
            stated = separator.ok().map(Separator::from);
            continue;
        }
        let separator = stated.unwrap_or_else(|| Separator::guess(line));
        if !is_blank(line, separator) && !line.starts_with('#') {
            return Some((line, separator));
        }
    }
    None
}

/// The cells of a line, trimmed, quotes removed.
pub(crate) fn cells(line: &str, separator: Separator) -> Cells<'_> {
    let rest = if separator == Separator::Blanks {
        line.trim()
    } else {
        line
    };
    Cells {
        rest: Some(rest),
        separator,
    }
}

/// Whether no cell of a line holds anything: blanks and separators only.
#[inline]
pub(crate) fn is_blank(line: &str, separator: Separator) -> bool {
    let separates = |b: u8| separator == Separator::Byte(b);
    line.bytes()
        .all(|b| b.is_ascii_whitespace() || separates(b))
}

/// The problem of a row that has another number of cells than the header.
pub(crate) fn ragged(line: &str, separator: Separator, expected: usize) -> Problem {
    let cells: Vec<&str> = cells(line, separator).collect();
    let found = cells.len();
    let digits = |cell: &str| !cell.is_empty() && cell.bytes().all(|b| b.is_ascii_digit());
    let whole = |cell: &str| digits(cell.strip_prefix(['-', '+']).unwrap_or(cell));
    // From the end: a counter may stand before the first number.
    let (mut pairs, mut example, mut end) = (0, None, found);
    while end >= 2 {
        let (before, after) = (cells[end - 2], cells[end - 1]);
        let is_pair = whole(before) && digits(after);
        if is_pair {
            pairs += 1;
            example.get_or_insert_with(|| format!("{before},{after}"));
        }
        end -= if is_pair { 2 } else { 1 };
    }
    let split = separator == Separator::Byte(b',') && found > expected;
    Problem::Ragged {
        found,
        expected,
        decimal_comma: example.filter(|_| split && pairs >= found - expected),
    }
}

/// The name in a cell: a doubled quote is one, and a `'` before a formula is none of it.
pub(crate) fn unquoted(cell: &str) -> String {
    from_cell(&cell.replace("\"\"", "\"")).to_owned()
}

#[derive(Clone)]
pub(crate) struct Cells<'a> {
    rest: Option<&'a str>,
    separator: Separator,
}

impl Cells<'_> {
    /// Whether all cells were given.
    pub(crate) fn is_at_end(&self) -> bool {
        self.rest.is_none()
    }

    /// The next cell when it is a plain decimal number, read in one pass; else `None`, and the cell is still there.
    #[inline]
    pub(crate) fn decimal(&mut self) -> Option<f64> {
        let Separator::Byte(separator) = self.separator else {
            return None;
        };
        let rest = self.rest?;
        let (value, used) = leading_decimal(rest.as_bytes(), separator)?;
        // Digits and separator are ASCII, so the cut is a character border.
        self.rest = (used < rest.len()).then(|| &rest[used + 1..]);
        Some(value)
    }
}

impl<'a> Iterator for Cells<'a> {
    type Item = &'a str;

    #[inline]
    fn next(&mut self) -> Option<&'a str> {
        let rest = self.rest?;
        let bytes = rest.as_bytes();
        let (end, next) = match self.separator {
            Separator::Byte(separator) => {
                let from = if bytes.first() == Some(&b'"') {
                    // A quoted cell ends at the next quote that is not doubled.
                    let mut i = 1;
                    while i < bytes.len() && (bytes[i] != b'"' || bytes.get(i + 1) == Some(&b'"')) {
                        i += if bytes[i] == b'"' { 2 } else { 1 };
                    }
                    i
                } else {
                    0
                };
                let from = from.min(bytes.len());
                match bytes[from..].iter().position(|&b| b == separator) {
                    Some(offset) => (from + offset, Some(from + offset + 1)),
                    None => (bytes.len(), None),
                }
            }
            Separator::Blanks => match bytes.iter().position(u8::is_ascii_whitespace) {
                Some(end) => {
                    let blanks = bytes[end..]
                        .iter()
                        .take_while(|b| b.is_ascii_whitespace())
                        .count();
                    (end, Some(end + blanks))
                }
                None => (bytes.len(), None),
            },
        };
        // Separators are ASCII, so both cuts are character borders.
        let cell = &rest[..end];
        self.rest = next.map(|next| &rest[next..]);
        Some(trimmed(cell))
    }
}

#[inline]
fn trimmed(cell: &str) -> &str {
    let bytes = cell.as_bytes();
    let plain = |b: Option<&u8>| b.is_some_and(|&b| b > b' ' && b != b'"');
    if plain(bytes.first()) && plain(bytes.last()) {
        return cell;
    }
    let cell = cell.trim();
    match cell
        .strip_prefix('"')
        .and_then(|inner| inner.strip_suffix('"'))
    {
        Some(inner) => inner.trim(),
        None => cell,
    }
}

/// A cell that should be a number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Number {
    Value(f64),
    Empty,
    /// The text says that there is not a finite number: `nan`, `NA`, `NULL`.
    Nan,
    /// Infinite, or beyond what a double can hold.
    Infinite,
    /// Something else.
    Text,
}

/// Reads a number; accepts a leading `+`, rejects hexadecimal and thousands separators.
#[inline]
pub(crate) fn number(cell: &str) -> Number {
    if cell.is_empty() {
        return Number::Empty;
    }
    if let Some(value) = short_decimal(cell.as_bytes()) {
        return Number::Value(value);
    }
    match cell.parse::<f64>() {
        Ok(value) if value.is_finite() => Number::Value(value),
        Ok(value) if value.is_nan() => Number::Nan,
        Ok(_) => Number::Infinite,
        Err(_) => match cell.to_ascii_lowercase().as_str() {
            "na" | "n/a" | "null" | "none" | "-nan" | "nan(ind)" | "-nan(ind)" | "--" => {
                Number::Nan
            }
            _ => Number::Text,
        },
    }
}

/// A decimal number of at most 15 digits without exponent, exactly as `str::parse` gives it: both the digits
/// (< 2⁵³) and the power of ten (≤ 10²²) are exact doubles, and one division rounds once.
#[inline]
fn short_decimal(bytes: &[u8]) -> Option<f64> {
    // A comma is in no number: all bytes must belong to it.
    let (value, used) = leading_decimal(bytes, b',')?;
    (used == bytes.len()).then_some(value)
}

/// A short decimal number that ends at the separator or at the end, and how many bytes it has.
#[inline]
fn leading_decimal(bytes: &[u8], separator: u8) -> Option<(f64, usize)> {
    const POWERS: [f64; 16] = [
        1.0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15,
    ];
    let negative = bytes.first() == Some(&b'-');
    let start = usize::from(negative);
    let mut at = start;
    let mut mantissa = 0u64;
    // Sixteen digits cannot overflow the mantissa; more than fifteen are refused below.
    let digits = |at: &mut usize, mantissa: &mut u64| {
        let end = bytes.len().min(start + 17);
        while *at < end {
            let digit = bytes[*at].wrapping_sub(b'0');
            if digit > 9 {
                break;
            }
            *mantissa = *mantissa * 10 + u64::from(digit);
            *at += 1;
        }
    };
    digits(&mut at, &mut mantissa);
    let (mut count, mut decimals) = (at - start, 0);
    if bytes.get(at) == Some(&b'.') {
        at += 1;
        let point = at;
        digits(&mut at, &mut mantissa);
        decimals = at - point;
        count += decimals;
    }
    let ends = bytes.get(at).is_none_or(|&b| b == separator);
    if !ends || count == 0 || count > 15 {
        return None;
    }
    let value = mantissa as f64 / POWERS[decimals];
    Some((if negative { -value } else { value }, at))
}

/// The problem of a cell that is not a finite number.
pub(crate) fn not_a_number(cell: &str, kind: Number, expected: &str) -> Problem {
    match kind {
        Number::Infinite | Number::Nan => Problem::NotFinite {
            found: excerpt(cell, 40),
        },
        _ => Problem::Unexpected {
            found: excerpt(cell, 40),
            expected: expected.to_string(),
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn split(line: &str, separator: Separator) -> Vec<&str> {
        cells(line, separator).collect()
    }

    #[test]
    fn cells_are_trimmed_and_unquoted() {
        let comma = Separator::Byte(b',');
        assert_eq!(split("a, b ,,\"x,y\",", comma), ["a", "b", "", "x,y", ""]);
        assert_eq!(split("", comma), [""]);
        assert_eq!(split("\"open,a", comma), ["\"open,a"]);
        assert_eq!(split("  a \t b  ", Separator::Blanks), ["a", "b"]);
        assert_eq!(split("\"\"\"", comma), ["\""]);
    }

    #[test]
    fn plain_numbers_are_taken_in_one_pass_and_others_are_left() {
        let mut row = cells(
            "1.5,-2,,x,+3,123456789012345,1234567890123456,.5,5.",
            Separator::Byte(b','),
        );
        assert_eq!(row.decimal(), Some(1.5));
        assert_eq!(row.decimal(), Some(-2.0));
        for left in ["", "x", "+3"] {
            assert_eq!(row.decimal(), None);
            assert_eq!(row.next(), Some(left));
        }
        assert_eq!(row.decimal(), Some(123_456_789_012_345.0));
        assert_eq!(row.decimal(), None);
        assert_eq!(row.next(), Some("1234567890123456"));
        assert_eq!(row.decimal(), Some(0.5));
        assert_eq!(row.decimal(), Some(5.0));
        assert_eq!((row.decimal(), row.next()), (None, None));
        // A separator at the end is one more cell; other separators and blanks are not taken for it.
        let mut row = cells("1,", Separator::Byte(b','));
        assert_eq!(
            (row.decimal(), row.decimal(), row.next(), row.next()),
            (Some(1.0), None, Some(""), None)
        );
        assert_eq!(cells("1;2", Separator::Byte(b',')).decimal(), None);
        assert_eq!(cells("1 ,2", Separator::Byte(b',')).decimal(), None);
        assert_eq!(cells("1 2", Separator::Blanks).decimal(), None);
        assert_eq!(cells("1\t2", Separator::Byte(b'\t')).decimal(), Some(1.0));
    }

    #[test]
    fn lines_have_no_ends_and_no_bom() {
        let mut lines = Lines::new(&b"\xef\xbb\xbfa\r\nb\n\nc"[..]);
        let mut all = Vec::new();
        while let Some(line) = lines.next().expect("valid text") {
            all.push(line.to_string());
        }
        assert_eq!(all, ["a", "b", "", "c"]);
        let mut bad = Lines::new(&b"ok\na\xffb"[..]);
        assert!(bad.next().is_ok());
        assert!(matches!(
            bad.next(),
            Err((At::Line(2), Problem::NotUtf8 { byte: 1 }))
        ));
    }

    #[test]
    fn what_is_not_finite_is_distinguished() {
        assert_eq!(number("-1.5e-3"), Number::Value(-1.5e-3));
        assert_eq!(number(""), Number::Empty);
        assert_eq!(number("NaN"), Number::Nan);
        assert_eq!(number("NULL"), Number::Nan);
        assert_eq!(number("-inf"), Number::Infinite);
        assert_eq!(number("1e999"), Number::Infinite);
        for text in ["1,5", "0x10", "1.2.3", "-", ".", "1 2", "--5"] {
            assert_eq!(number(text), Number::Text, "{text}");
        }
    }

    proptest! {
        #![proptest_config(proptest::test_runner::Config { rng_seed: proptest::test_runner::RngSeed::Fixed(1), failure_persistence: None, ..Default::default() })]
        #[test]
        fn short_decimals_are_what_the_standard_library_reads(whole in -999_999i64..999_999, part in 0u32..999_999_999, digits in 0usize..10) {
            let text = format!("{whole}.{part:09}");
            let text = &text[..text.len() - digits];
            let expected: f64 = text.parse().unwrap();
            prop_assert_eq!(number(text), Number::Value(expected));
            prop_assert_eq!(short_decimal(text.as_bytes()).map(f64::to_bits).unwrap_or(expected.to_bits()), expected.to_bits());
        }
    }
}
