//! A table from its first line to its last, in one pass.

use super::header::{Known, Layout};
use super::rows::Rows;
use super::unit_row;
use crate::column_map::ColumnMap;
use crate::date_time::date_time;
use crate::error::{At, Placed, Problem};
use crate::model::Recording;
use crate::text::{Lines, Separator, cells, is_blank, stated_separator, unquoted};
use calib_finding::{Finding, Subject, catalog};
use std::io::BufRead;

/// The comment that a table carries which is written while it is recorded: such a table may end in the middle of a
/// row, and a row is whole when its line break is there.
pub const WRITTEN_LIVE: &str = "written live: a last line without line break was cut off";

/// Reads a wide or long table. `map` must be resolved (no preset left).
pub(crate) fn read_table(
    input: impl BufRead,
    map: Option<&ColumnMap>,
    known: Known<'_>,
) -> Placed<Recording> {
    let mut lines = Lines::new(input);
    let mut comments = Vec::new();
    let (number, names, separator) = match read_header(&mut lines, map, &mut comments)? {
        Some(found) => found,
        None if lines.number() == 0 => return Err((At::File, Problem::Empty)),
        None => return Err((At::Line(lines.number()), Problem::NoRows)),
    };
    let mut first = first_row(&mut lines, separator)?;
    let units = match first.last() {
        Some((number, line, _)) => unit_row::read(*number, cells(line, separator), &names, map)?,
        None => None,
    };
    if units.is_some() {
        first.pop();
        first.extend(first_row(&mut lines, separator)?);
    }
    let dates = dates(first.last(), separator);
    let words = words(first.last(), separator);
    let known = Known {
        remarks: known.remarks.map(|_| words.as_slice()),
        ..known
    };
    let layout = Layout::new(number, names, (units.as_ref(), &dates), (map, known))?;
    let mut body = Body {
        live: comments.iter().any(|comment| comment == WRITTEN_LIVE),
        rows: Rows::new(layout, separator, map),
        separator,
        comments,
        cut: None,
        blank: Vec::new(),
    };
    for (number, line, whole) in first {
        body.line(number, &line, whole)?;
    }
    while body.cut.is_none() {
        let number = lines.number() + 1;
        let Some((line, whole)) = lines.next_whole()? else {
            break;
        };
        body.line(number, line, whole)?;
    }
    if body.rows.is_empty() && !body.blank.is_empty() {
        let rows = body.blank.len();
        return Err((At::Line(lines.number()), Problem::EmptyRows { rows }));
    }
    if body.rows.is_empty() {
        return Err((At::Line(lines.number()), Problem::NoRows));
    }
    let mut recording = body.rows.finish()?;
    recording.meta.findings.extend(
        body.cut
            .map(|line| Finding::new(catalog::ROW_CUT_OFF, Subject::default()).at_rows([line])),
    );
    recording.meta.comments = body.comments;
    Ok(recording)
}

/// Which columns of the first row hold a date with a time of day.
fn dates(first: Option<&Line>, separator: Separator) -> Vec<bool> {
    let of = |(_, line, _): &Line| {
        let cells = cells(line, separator);
        cells.map(|cell| date_time(cell).is_some()).collect()
    };
    first.map(of).unwrap_or_default()
}

/// Which columns of the first row hold a word.
fn words(first: Option<&Line>, separator: Separator) -> Vec<bool> {
    let of = |(_, line, _): &Line| {
        let cells = cells(line, separator);
        let words = cells.map(|cell| {
            let cell = unquoted(cell);
            cell.contains(char::is_alphabetic) && cell.trim().parse::<f64>().is_err()
        });
        words.collect()
    };
    first.map(of).unwrap_or_default()
}

/// What stands below the header, while it is read.
struct Body<'a> {
    rows: Rows<'a>,
    separator: Separator,
    comments: Vec<String>,
    /// The table was written while it was recorded.
    live: bool,
    /// The line of a row that was cut off.
    cut: Option<u64>,
    /// Rows without anything in them that may be samples.
    blank: Vec<(u64, String)>,
}

impl Body<'_> {
    /// Reads a line; `whole`: it ended with a line break.
    fn line(&mut self, number: u64, line: &str, whole: bool) -> Placed<()> {
        if self.live && !whole {
            self.cut = Some(number);
        } else if let Some(comment) = line.strip_prefix('#') {
            self.comments.push(comment.trim().to_string());
        } else if is_blank(line, self.separator) {
            // At the end of a table nothing follows that such a row could stand before.
            if !line.trim().is_empty() && self.rows.blank_is_a_sample() {
                self.blank.push((number, line.to_owned()));
            }
        } else {
            for (number, line) in self.blank.drain(..) {
                self.rows.read(number, &line)?;
            }
            self.rows.read(number, line)?;
        }
        Ok(())
    }
}

/// A line: its number, its text and whether it ended with a line break.
type Line = (u64, String, bool);

/// The lines up to the first with anything in it that is no comment; it is the last of them.
fn first_row<R: BufRead>(lines: &mut Lines<R>, separator: Separator) -> Placed<Vec<Line>> {
    let mut all = Vec::new();
    while let Some((line, whole)) = lines.next_whole()? {
        let row = !line.starts_with('#') && !is_blank(line, separator);
        // Lines without anything need no room.
        if !line.trim().is_empty() || !whole {
            let line = line.to_owned();
            all.push((lines.number(), line, whole));
        }
        if row {
            break;
        }
    }
    Ok(all)
}

/// Line and names of the header, and the separator; `None` when the file ends before its header.
fn read_header<R: BufRead>(
    lines: &mut Lines<R>,
    map: Option<&ColumnMap>,
    comments: &mut Vec<String>,
) -> Placed<Option<(u64, Vec<String>, Separator)>> {
    let mut given = map.and_then(|map| map.delimiter).map(Separator::from);
    for _ in 0..map.map_or(0, |map| map.skip_lines) {
        if lines.next()?.is_none() {
            return Ok(None);
        }
    }
    if let Some(map) = map
        && !map.names.is_empty()
    {
        let separator = given.unwrap_or(Separator::Byte(b','));
        return Ok(Some((lines.number(), map.names.clone(), separator)));
    }
    loop {
        let number = lines.number() + 1;
        let Some(line) = lines.next()? else {
            return Ok(None);
        };
        if let Some(comment) = line
            .strip_prefix('#')
            .filter(|_| !map_names_start_with_hash(map))
        {
            comments.push(comment.trim().to_string());
            continue;
        }
        if number == 1
            && let Some(stated) = stated_separator(line)
        {
            let found = |found: &str| Problem::SeparatorLine {
                found: found.to_owned(),
            };
            match (given, stated) {
                (Some(_), _) => {}
                (None, Ok(stated)) => given = Some(stated.into()),
                (None, Err(other)) => return Err((At::Line(1), found(other))),
            }
            continue;
        }
        let separator = given.unwrap_or_else(|| Separator::guess(line));
        if !is_blank(line, separator) {
            let names = cells(line, separator).map(unquoted).collect();
            return Ok(Some((number, names, separator)));
        }
    }
}

/// A map that names a column `#…` reads a header line that starts with `#`.
fn map_names_start_with_hash(map: Option<&ColumnMap>) -> bool {
    map.is_some_and(|map| {
        map.time.iter().any(|time| time.column.starts_with('#'))
            || map.joint_columns.iter().any(|c| c.starts_with('#'))
    })
}
