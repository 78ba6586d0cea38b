//! Text tables with aligned columns, for Markdown and the terminal.

use calib_finding::printable;

/// Alignment of a column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Align {
    Left,
    Right,
}

/// A table of text: a heading and an alignment per column, one list of cells per row.
#[derive(Debug, Clone)]
pub(crate) struct Table {
    heads: Vec<(String, Align)>,
    rows: Vec<Vec<String>>,
}

impl Table {
    /// `"<name"` is a left column, `">name"` a right one.
    pub(crate) fn new(heads: &[&str]) -> Self {
        let head = |text: &&str| match text.strip_prefix('>') {
            Some(text) => (text.to_owned(), Align::Right),
            None => (text.trim_start_matches('<').to_owned(), Align::Left),
        };
        Self {
            heads: heads.iter().map(head).collect(),
            rows: Vec::new(),
        }
    }

    pub(crate) fn row(&mut self, cells: impl IntoIterator<Item = String>) {
        let mut cells: Vec<String> = cells.into_iter().collect();
        cells.resize(self.heads.len(), String::new());
        self.rows.push(cells);
    }

    /// The same without columns whose cells are all empty.
    pub(crate) fn without_empty_columns(self) -> Self {
        let says: Vec<bool> = (0..self.heads.len())
            .map(|i| self.rows.iter().any(|row| !row[i].is_empty()))
            .collect();
        fn keep<T>(cells: Vec<T>, says: &[bool]) -> Vec<T> {
            cells
                .into_iter()
                .zip(says)
                .filter_map(|(cell, says)| says.then_some(cell))
                .collect()
        }
        Self {
            heads: keep(self.heads, &says),
            rows: self.rows.into_iter().map(|row| keep(row, &says)).collect(),
        }
    }

    pub(crate) fn heads(&self) -> &[(String, Align)] {
        &self.heads
    }

    pub(crate) fn rows(&self) -> &[Vec<String>] {
        &self.rows
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    fn widths(&self, least: usize) -> Vec<usize> {
        let cell = |row: &Vec<String>, i: usize| row[i].chars().count();
        let width = |i: usize| {
            self.rows
                .iter()
                .map(|row| cell(row, i))
                .chain([self.heads[i].0.chars().count(), least])
                .max()
                .unwrap_or(0)
        };
        (0..self.heads.len()).map(width).collect()
    }

    /// A GitHub table, padded so that it can be read as text.
    pub(crate) fn markdown(&self) -> String {
        let escaped = Self {
            heads: self
                .heads
                .iter()
                .map(|(text, align)| (cell(text), *align))
                .collect(),
            rows: self
                .rows
                .iter()
                .map(|row| row.iter().map(|text| cell(text)).collect())
                .collect(),
        };
        let widths = escaped.widths(3);
        let line = |cells: Vec<String>| format!("| {} |\n", cells.join(" | "));
        let pad_all = |texts: Vec<&str>| {
            texts
                .iter()
                .zip(&escaped.heads)
                .zip(&widths)
                .map(|((text, head), width)| pad(text, *width, head.1))
                .collect()
        };
        let mut text = line(pad_all(
            escaped.heads.iter().map(|head| head.0.as_str()).collect(),
        ));
        text += &line(
            widths
                .iter()
                .zip(&escaped.heads)
                .map(|(width, head)| {
                    if head.1 == Align::Right {
                        format!("{}:", "-".repeat(width - 1))
                    } else {
                        "-".repeat(*width)
                    }
                })
                .collect(),
        );
        for row in &escaped.rows {
            text += &line(pad_all(row.iter().map(String::as_str).collect()));
        }
        text
    }

    /// Plain columns, two spaces apart, indented by two; the widest left column gives way until the line fits `columns`.
    pub(crate) fn plain(&self, columns: usize) -> String {
        let mut widths = self.widths(1);
        let total = |widths: &[usize]| {
            2 + widths.iter().sum::<usize>() + 2 * widths.len().saturating_sub(1)
        };
        while total(&widths) > columns {
            // Numbers are worth more than names: shrink a left column first, whichever is widest.
            let widest = |align: Align| {
                (0..widths.len())
                    .filter(|&i| self.heads[i].1 == align && widths[i] > 4)
                    .max_by_key(|&i| widths[i])
            };
            let Some(i) = widest(Align::Left).or_else(|| widest(Align::Right)) else {
                break;
            };
            widths[i] -= 1;
        }
        let mut text = String::new();
        let heads: Vec<&str> = self.heads.iter().map(|head| head.0.as_str()).collect();
        let has_heads = heads.iter().any(|head| !head.is_empty());
        let rows = self
            .rows
            .iter()
            .map(|row| row.iter().map(String::as_str).collect::<Vec<_>>());
        for row in has_heads.then_some(heads).into_iter().chain(rows) {
            text += &self.plain_row(&row, &widths);
        }
        text
    }

    /// A row of [`Self::plain`]: a text that is wider than its column goes on in the lines below.
    fn plain_row(&self, row: &[&str], widths: &[usize]) -> String {
        let cells: Vec<Vec<String>> = row
            .iter()
            .zip(widths)
            .map(|(text, width)| match text.chars().count() > *width {
                true => wrap(text, *width, "", "")
                    .lines()
                    .map(str::to_owned)
                    .collect(),
                false => vec![(*text).to_owned()],
            })
            .collect();
        let mut text = String::new();
        for k in 0..cells.iter().map(Vec::len).max().unwrap_or(0) {
            let line = cells.iter().zip(&self.heads).zip(widths);
            let line: Vec<String> = line
                .map(|((cell, head), width)| {
                    let part = cell.get(k).map_or("", String::as_str);
                    pad(part, *width, head.1)
                })
                .collect();
            text += format!("  {}", line.join("  ")).trim_end();
            text.push('\n');
        }
        text
    }
}

fn pad(text: &str, width: usize, align: Align) -> String {
    let space = " ".repeat(width.saturating_sub(text.chars().count()));
    match align {
        Align::Left => format!("{text}{space}"),
        Align::Right => format!("{space}{text}"),
    }
}

/// At most `width` characters; what was cut is an ellipsis.
pub(crate) fn clip(text: &str, width: usize) -> String {
    if text.chars().count() <= width {
        return text.to_owned();
    }
    text.chars()
        .take(width.saturating_sub(1))
        .chain(['…'])
        .collect()
}

/// Text that cannot leave its table cell or become markup.
fn cell(text: &str) -> String {
    markup_free(text).replace('|', "\\|")
}

/// One line without HTML, links, images and control characters; text of names and files stands as it is.
pub(crate) fn markup_free(text: &str) -> String {
    let line = text.split_whitespace().collect::<Vec<_>>().join(" ");
    // A viewer would fetch an image, which tells its sender who reads; our own texts have neither.
    let line = printable(&line).replace("](", "]\\(");
    // Only `<` before a letter, `/`, `!` or `?` begins markup; "< 1 %" reads better as it is.
    let mut out = String::with_capacity(line.len());
    let mut letters = line.chars().peekable();
    while let Some(c) = letters.next() {
        let begins = letters
            .peek()
            .is_some_and(|next| next.is_ascii_alphabetic() || matches!(next, '/' | '!' | '?'));
        if c == '<' && begins {
            out.push_str("&lt;");
        } else {
            out.push(c);
        }
    }
    out
}

/// Words over lines of at most `columns` characters, the first with `first`, the others with `rest` before them.
pub(crate) fn wrap(text: &str, columns: usize, first: &str, rest: &str) -> String {
    let mut lines = String::new();
    let mut line = first.to_owned();
    let mut is_empty = true;
    for word in text.split_whitespace() {
        let mut word: Vec<char> = word.chars().collect();
        if !is_empty && line.chars().count() + 1 + word.len() > columns {
            lines += line.trim_end();
            lines.push('\n');
            line = rest.to_owned();
            is_empty = true;
        }
        if !is_empty {
            line.push(' ');
        }
        // A word that is longer than a line (a path) is broken where it must.
        loop {
            let room = columns.saturating_sub(line.chars().count()).max(1);
            if word.len() <= room {
                break;
            }
            line.extend(word.drain(..room));
            lines += &line;
            lines.push('\n');
            line = rest.to_owned();
        }
        line.extend(word);
        is_empty = false;
    }
    lines += line.trim_end();
    lines.push('\n');
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cell_cannot_leave_its_table() {
        let mut table = Table::new(&["<name", ">n"]);
        table.row(["a|b\n<script>".to_owned(), "1".to_owned()]);
        let expected = "| name             |   n |\n\
                        | ---------------- | --: |\n\
                        | a\\|b &lt;script> |   1 |\n";
        assert_eq!(table.markdown(), expected);
    }

    #[test]
    fn a_name_is_no_link_no_image_and_no_sequence_of_the_terminal() {
        let name = "![x](http://example.org/a.png) [y](z) \u{1b}[2J\u{202e}";
        let shown = "![x]\\(http://example.org/a.png) [y]\\(z) \\u001b[2J\\u202e";
        assert_eq!(markup_free(name), shown);
    }

    #[test]
    fn names_give_way_before_numbers() {
        let mut table = Table::new(&["<name", ">mm"]);
        table.row([
            "a_very_long_name_of_a_marker".to_owned(),
            "1234.567".to_owned(),
        ]);
        let text = table.plain(20);
        assert!(
            text.lines().all(|line| line.chars().count() <= 20),
            "{text}"
        );
        assert!(text.contains("1234.567"), "{text}");
        // Nothing is cut: what does not fit stands in the line below.
        let lines = text.lines().skip(1);
        let names: String = lines
            .flat_map(|line| line.chars().skip(2).take(8))
            .collect();
        assert!(
            names
                .replace(' ', "")
                .contains("a_very_long_name_of_a_marker"),
            "{text}"
        );
    }

    #[test]
    fn words_wrap_and_long_words_break() {
        assert_eq!(
            wrap("one two three", 8, "- ", "  "),
            "- one\n  two\n  three\n"
        );
        let long = wrap(&format!("see {}", "x".repeat(30)), 10, "", "  ");
        assert!(
            long.lines().all(|line| line.chars().count() <= 10),
            "{long}"
        );
        assert_eq!(long.matches('x').count(), 30);
    }
}
