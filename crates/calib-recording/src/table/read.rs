//! A table from its first line to its last, in one pass.

use super::header::{Known, Layout};
use super::rows::Rows;
use crate::column_map::{ColumnMap, Delimiter};
use crate::error::{At, Placed, Problem};
use crate::model::Recording;
use crate::text::{Lines, Separator, cells, is_blank, unquoted};
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
    let (layout, separator) = match read_header(&mut lines, (map, known), &mut comments)? {
        Some(found) => found,
        None if lines.number() == 0 => return Err((At::File, Problem::Empty)),
        None => return Err((At::Line(lines.number()), Problem::NoRows)),
    };
    let mut rows = Rows::new(layout, separator, map);
    let live = comments.iter().any(|comment| comment == WRITTEN_LIVE);
    let (mut cut, mut blank) = (None, Vec::new());
    loop {
        let number = lines.number() + 1;
        let Some((line, whole)) = lines.next_whole()? else {
            break;
        };
        if live && !whole {
            cut = Some(number);
            break;
        }
        if let Some(comment) = line.strip_prefix('#') {
            comments.push(comment.trim().to_string());
        } else if is_blank(line, separator) {
            // At the end of a table nothing follows that such a row could stand before.
            if !line.trim().is_empty() && rows.blank_is_a_sample() {
                blank.push((number, line.to_owned()));
            }
        } else {
            for (number, line) in blank.drain(..) {
                rows.read(number, &line)?;
            }
            rows.read(number, line)?;
        }
    }
    if rows.is_empty() {
        return Err((At::Line(lines.number()), Problem::NoRows));
    }
    let mut recording = rows.finish()?;
    recording.meta.findings.extend(
        cut.map(|line| Finding::new(catalog::ROW_CUT_OFF, Subject::default()).at_rows([line])),
    );
    recording.meta.comments = comments;
    Ok(recording)
}

/// Layout and separator; `None` when the file ends before its header.
fn read_header<R: BufRead>(
    lines: &mut Lines<R>,
    (map, known): (Option<&ColumnMap>, Known<'_>),
    comments: &mut Vec<String>,
) -> Placed<Option<(Layout, Separator)>> {
    let given = map
        .and_then(|map| map.delimiter)
        .map(|delimiter| match delimiter {
            Delimiter::Comma => Separator::Byte(b','),
            Delimiter::Semicolon => Separator::Byte(b';'),
            Delimiter::Tab => Separator::Byte(b'\t'),
            Delimiter::Space => Separator::Blanks,
        });
    for _ in 0..map.map_or(0, |map| map.skip_lines) {
        if lines.next()?.is_none() {
            return Ok(None);
        }
    }
    if let Some(map) = map
        && !map.names.is_empty()
    {
        let separator = given.unwrap_or(Separator::Byte(b','));
        return Ok(Some((
            Layout::new(lines.number(), map.names.clone(), (Some(map), known))?,
            separator,
        )));
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
        let separator = given.unwrap_or_else(|| Separator::guess(line));
        if !is_blank(line, separator) {
            let names = cells(line, separator).map(unquoted).collect();
            return Ok(Some((Layout::new(number, names, (map, known))?, separator)));
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
