//! Where the header of a table stands: in its first line, below a title, or in a comment above the numbers.

use calib_recording::{date_time, stated_separator};

use crate::delimited::{cells, of_delimiter, separator};

/// Lines above a header that are looked at.
const TITLES: usize = 40;
/// Cells that make a header, below a title or in a comment.
const LEAST: usize = 3;

/// The header of a table.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Located {
    /// Its line, from 0; of a commented header the line before the first numbers.
    pub line: usize,
    /// What it says.
    pub names: Vec<String>,
    /// What separates its cells; `None`: blanks.
    pub separator: Option<char>,
    /// Where it was found.
    pub place: HeaderPlace,
}

/// Where a header stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HeaderPlace {
    /// In the first line that is no comment.
    First,
    /// Below lines of another form.
    Below,
    /// In a comment, as `numpy.savetxt` and MATLAB write it.
    Comment,
}

/// Finds the header; `None` in a text without a line, and with a separator that no table has.
pub(crate) fn locate(text: &str) -> Option<Located> {
    let mut lines = text
        .lines()
        .enumerate()
        .filter(|(_, line)| !line.trim().is_empty());
    let mut all: Vec<(usize, &str)> = lines.by_ref().take(2 * TITLES).collect();
    let stated = all.first().filter(|(number, _)| *number == 0);
    let stated = stated.and_then(|(_, line)| stated_separator(line));
    let given = match stated {
        Some(stated) => {
            all.remove(0);
            Some(of_delimiter(stated.ok()?))
        }
        None => None,
    };
    all.extend(lines.find(|(_, line)| !is_comment(line)));
    let of = |line: &str| given.unwrap_or_else(|| separator(line));
    let plain: Vec<usize> = (0..all.len()).filter(|i| !is_comment(all[*i].1)).collect();
    let found = |line: usize, header: &str, by: Option<char>, place: HeaderPlace| Located {
        line,
        names: cells(header, by).map(str::to_owned).collect(),
        separator: by,
        place,
    };
    let first = *plain.first()?;
    let (number, line) = all[first];
    let by = of(line);
    let count = cells(line, by).count();
    if count >= LEAST && is_data(line, by, count) {
        let comments = all[..first].iter().rev();
        let header = comments.map(|(_, line)| line.trim_start_matches(['#', '%', ' ']));
        let separators = |header: &str| [separator(header), by, None];
        let of_names = header.flat_map(|header| separators(header).map(|by| (header, by)));
        let mut of_names = of_names.filter(|(header, by)| is_names(header, *by, count));
        if let Some((header, by_header)) = of_names.next() {
            let names = cells(header, by_header).map(str::to_owned).collect();
            let line = number.saturating_sub(1);
            return Some(Located {
                line,
                names,
                separator: by,
                place: HeaderPlace::Comment,
            });
        }
    }
    // Below a header stand numbers, or a row of units and then numbers.
    let heads = |k: &usize| {
        let header = all[plain[*k]].1;
        let by = of(header);
        let count = cells(header, by).count();
        let below = plain[k + 1..].iter().take(2);
        let mut below = below.map(|i| all[*i].1);
        is_names(header, by, count) && below.any(|line| is_data(line, by, count))
    };
    let all_heads: Vec<usize> = (0..plain.len().min(TITLES)).filter(heads).collect();
    Some(match all_heads.first() {
        Some(k) if *k > 0 => {
            let (number, header) = all[plain[*k]];
            found(number, header, of(header), HeaderPlace::Below)
        }
        _ => found(number, line, by, HeaderPlace::First),
    })
}

/// Whether a line holds no cells of a table. ROS writes `%time` at the beginning of a header that is none.
pub(crate) fn is_comment(line: &str) -> bool {
    line.starts_with('#') || line.starts_with("% ")
}

fn is_names(line: &str, separator: Option<char>, count: usize) -> bool {
    let mut of_line = cells(line, separator);
    let names = of_line.by_ref().filter(|cell| !cell.is_empty());
    let (mut some, mut plain) = (0, true);
    for name in names {
        some += 1;
        plain &= !is_number(name);
    }
    plain && some >= LEAST && cells(line, separator).count() == count
}

/// Whether this many cells stand in a line, and more of them are numbers than texts.
fn is_data(line: &str, separator: Option<char>, count: usize) -> bool {
    let (mut all, mut numbers, mut texts) = (0, 0, 0);
    for cell in cells(line, separator) {
        all += 1;
        match is_number(cell) || date_time(cell).is_some() {
            true => numbers += 1,
            false if cell.is_empty() => {}
            false => texts += 1,
        }
    }
    all == count && numbers > texts
}

/// A number, whatever marks its decimals.
fn is_number(cell: &str) -> bool {
    cell.replacen(',', ".", 1).parse::<f64>().is_ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_header_is_found_below_titles_and_in_comments() {
        let at = |text: &str| {
            let found = locate(text).expect("a line");
            (found.line, found.names.join("|"), found.place)
        };
        let first = |line: usize, names: &str| (line, names.to_owned(), HeaderPlace::First);
        assert_eq!(at("a,b,c\n1,2,3\n"), first(0, "a|b|c"));
        assert_eq!(
            at("# note\n\na;b;c\n[deg];mm;-\n1,5;2;3\n"),
            first(2, "a|b|c")
        );
        assert_eq!(at("sep=;\na;b;c\n1;2;3\n"), first(1, "a|b|c"));
        let below = |line: usize, names: &str| (line, names.to_owned(), HeaderPlace::Below);
        for title in [
            "Measurement 3 of robot R12;;;;\n\n",
            "Robot;R12\nDate;2024-05-01\n",
            "Log of three robots, in Ulm\n\n",
        ] {
            let lines = title.lines().count();
            assert_eq!(
                at(&format!("{title}a;b;c;d;e\n1;2;3;4;5\n")),
                below(lines, "a|b|c|d|e")
            );
            assert_eq!(
                at(&format!("{title}a;b;c;d;e\nrad;m;m;m;\n1;;3;4;\n")),
                below(lines, "a|b|c|d|e")
            );
        }
        let comment = |line: usize, names: &str| (line, names.to_owned(), HeaderPlace::Comment);
        assert_eq!(at("# a b c\n1 2 3\n"), comment(0, "a|b|c"));
        assert_eq!(at("# by me\n# a,b,c\n1.0 2.0 3.0\n"), comment(1, "a|b|c"));
        assert_eq!(at("% a, b, c\n% 2024\n1, 2, 3\n"), comment(1, "a|b|c"));
        // Numbers without names have no header.
        assert_eq!(at("# by me\n1,2,3\n"), first(1, "1|2|3"));
    }
}
