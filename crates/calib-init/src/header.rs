//! The header of a delimited table, and the first of its numbers.

use calib_recording::{Delimiter, StatedUnit, date_time, unit_row, utf8};

use crate::delimited::cells;
use crate::located::{HeaderPlace, Located, is_comment, locate};
use crate::name::{self, NamedUnit, Unit};

/// Rows that are looked at.
const ROWS: usize = 400;
/// Bytes that are looked at: a header of a thousand columns and its rows.
const BYTES: usize = 8 << 20;

/// A header line and columns of numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct Header {
    /// Column names, without quotes and blanks around them.
    pub names: Vec<String>,
    /// `[column][row]`: the first rows; `None` where a cell is not a number.
    pub columns: Vec<Vec<Option<f64>>>,
    /// Columns whose numbers are dates with a time of day, in seconds since 1970.
    pub dates: Vec<bool>,
    /// The one text of a column, where it is the same in all rows.
    pub texts: Vec<Option<String>>,
    /// Numbers are written `1,5`.
    pub decimal_comma: bool,
    /// The last line above the numbers, from 1: the header, or the row of units below it.
    pub line: u64,
    /// Lines that a reader must be told to skip, of a header that is not the first line or is a comment.
    pub skip: u64,
    /// Where the header stands.
    pub place: HeaderPlace,
    /// Units from a row below the header; empty without such a row.
    pub units: Vec<Option<StatedUnit>>,
    /// What separates the cells.
    pub delimiter: Delimiter,
}

impl Header {
    /// The largest magnitude of a column; 0 without numbers.
    #[must_use]
    pub fn largest(&self, column: usize) -> f64 {
        let numbers = self.columns[column].iter().flatten();
        numbers.fold(0.0, |most, x| f64::max(most, x.abs()))
    }

    /// Largest minus smallest number of a column.
    #[must_use]
    pub fn span(&self, column: usize) -> f64 {
        let numbers = || self.columns[column].iter().flatten().copied();
        let high = numbers().fold(f64::NEG_INFINITY, f64::max);
        let low = numbers().fold(f64::INFINITY, f64::min);
        if high > low { high - low } else { 0.0 }
    }

    /// Whether a column has any number.
    #[must_use]
    pub fn has_numbers(&self, column: usize) -> bool {
        self.columns[column].iter().any(Option::is_some)
    }

    /// The unit of a column: of its name, else of the row of units.
    #[must_use]
    pub fn unit(&self, column: usize) -> Unit<'_> {
        let named = name::unit(&self.names[column]);
        let row = self.units.get(column).copied().flatten();
        match row {
            Some(unit) if named.unit.is_none() => Unit {
                stem: &self.names[column],
                unit: Some(NamedUnit::from(unit)),
                native: true,
            },
            _ => named,
        }
    }

    /// The place of a column.
    #[must_use]
    pub fn position(&self, name: &str) -> Option<usize> {
        self.names.iter().position(|n| n == name)
    }
}

/// Reads the header line (of whatever place), the row of units below it, and the first rows;
/// `None` where there is no such table.
#[must_use]
pub fn header(bytes: &[u8]) -> Option<Header> {
    let bytes = &utf8(&bytes[..bytes.len().min(BYTES)]).ok()?[..];
    if bytes.contains(&0) {
        return None;
    }
    let text = match std::str::from_utf8(bytes) {
        Ok(text) => text,
        Err(e) => std::str::from_utf8(&bytes[..e.valid_up_to()]).ok()?,
    };
    let Located {
        line: mut above,
        names,
        separator,
        place,
    } = locate(text)?;
    // Without a single name that is none of a number it is a table without header.
    if names.len() < 2 || names.iter().all(|n| n.parse::<f64>().is_ok()) {
        return None;
    }
    let lines = text.lines().enumerate().skip(above + 1);
    let lines = lines.filter(|(_, line)| !line.trim().is_empty() && !is_comment(line));
    let skip = match place {
        HeaderPlace::First => 0,
        HeaderPlace::Below => above as u64,
        HeaderPlace::Comment => above as u64 + 1,
    };
    let mut units = Vec::new();
    let mut rows: Vec<&str> = Vec::new();
    for (number, line) in lines.take(ROWS) {
        let stated = match rows.is_empty() && units.is_empty() {
            true => unit_row(&names, cells(line, separator), |_| false).and_then(Result::ok),
            false => None,
        };
        match stated {
            Some(stated) => (above, units) = (number, stated),
            None => rows.push(line),
        }
    }
    let is_number = |cell: &str| cell.parse::<f64>().is_ok();
    // `1,5` where something else than a comma separates.
    let comma = |cell: &str| !is_number(cell) && is_number(&cell.replacen(',', ".", 1));
    let decimal_comma =
        separator != Some(',') && rows.iter().any(|row| cells(row, separator).any(comma));
    let mut columns = vec![Vec::new(); names.len()];
    let mut dates = vec![false; names.len()];
    let mut texts: Vec<Option<String>> = Vec::new();
    for (r, line) in rows.iter().enumerate() {
        let mut row = cells(line, separator);
        for (i, column) in columns.iter_mut().enumerate() {
            let cell = row.next().unwrap_or_default();
            let number = match decimal_comma {
                true => cell.replacen(',', ".", 1).parse::<f64>().ok(),
                false => cell.parse::<f64>().ok(),
            };
            let date = || date_time(cell).map(|date| date.seconds);
            let value = number.or_else(date);
            dates[i] |= number.is_none() && value.is_some();
            column.push(value.filter(|x| x.is_finite()));
            let text = value.is_none() && !cell.is_empty();
            if r == 0 {
                texts.push(text.then(|| cell.to_owned()));
            } else if texts[i].as_deref() != Some(cell) {
                texts[i] = None;
            }
        }
    }
    texts.resize(names.len(), None);
    Some(Header {
        names,
        columns,
        dates,
        texts,
        decimal_comma,
        line: above as u64 + 1,
        skip,
        place,
        units,
        delimiter: match separator {
            Some(';') => Delimiter::Semicolon,
            Some('\t') => Delimiter::Tab,
            Some(_) => Delimiter::Comma,
            None => Delimiter::Space,
        },
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_header_is_found_and_numbers_are_no_header() {
        let found =
            header(b"\xef\xbb\xbf# note\n\nq 1;\"x\" ;y\n1;2.5;\n-3;a;4\n").expect("a table");
        assert_eq!(found.names, ["q 1", "x", "y"]);
        assert_eq!(found.columns[1], [Some(2.5), None]);
        assert_eq!(found.span(0), 4.0);
        assert_eq!((found.line, found.delimiter), (3, Delimiter::Semicolon));
        let comma = header(b"a;b\n1,5;2\n").expect("a table");
        assert!(comma.decimal_comma && comma.largest(0) == 1.5);
        let units = header(b"sep=;\n\na;b;c\n[deg];mm;-\n1,5;2;3\n").expect("units");
        assert_eq!((units.line, units.largest(0)), (4, 1.5));
        assert_eq!(
            units.unit(1).unit,
            Some(NamedUnit::Length(calib_recording::LengthUnit::Mm))
        );
        assert_eq!(units.unit(2).unit, None);
        assert_eq!(header(b"1,2,3\n4,5,6\n"), None);
        assert_eq!(header(b""), None);
        assert_eq!(header(b"one\n"), None);
        assert_eq!(header(b"a b\n1 2\n").expect("blanks").names, ["a", "b"]);
    }
}
