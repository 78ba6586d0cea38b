//! A profile's text with a key more, and everything else as it stands: comments, order, styles and line ends.

use crate::locate::Places;
use crate::parse;
use crate::raw::RawProfile;

/// A value in YAML.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Value {
    /// A scalar, list or mapping in flow style, an alias among them: one line.
    Flow(String),
    /// A mapping.
    Map {
        /// Name that aliases repeat it by, in block style.
        anchor: Option<String>,
        /// Its keys, quoted where YAML asks for it, and their values.
        entries: Vec<(String, Value)>,
    },
}

/// A key with its value, and the comments above it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Entry {
    /// Lines of comments, each from its `#` on.
    pub comments: Vec<String>,
    /// The key, quoted where YAML asks for it.
    pub key: String,
    /// Its value.
    pub value: Value,
}

impl Value {
    /// In flow style, on one line.
    #[must_use]
    pub fn flow(&self) -> String {
        match self {
            Self::Flow(text) => text.clone(),
            Self::Map { entries, .. } => {
                let of = |(key, value): &(String, Self)| format!("{key}: {}", value.flow());
                let all: Vec<String> = entries.iter().map(of).collect();
                format!("{{{}}}", all.join(", "))
            }
        }
    }

    /// `key: value` in block style, each line after `indent`.
    fn push_lines(&self, key: &str, indent: &str, lines: &mut Vec<String>) {
        match self {
            Self::Flow(text) => lines.push(format!("{indent}{key}: {text}")),
            Self::Map { entries, .. } if entries.is_empty() => {
                lines.push(format!("{indent}{key}: {{}}"));
            }
            Self::Map { anchor, entries } => {
                let anchor = anchor
                    .as_ref()
                    .map_or_else(String::new, |a| format!(" &{a}"));
                lines.push(format!("{indent}{key}:{anchor}"));
                let deeper = format!("{indent}  ");
                for (key, value) in entries {
                    value.push_lines(key, &deeper, lines);
                }
            }
        }
    }
}

impl Entry {
    /// Comments, key and value in block style, each line after `indent`.
    #[must_use]
    pub fn lines(&self, indent: &str) -> Vec<String> {
        let comments = self.comments.iter().map(|c| format!("{indent}{c}"));
        let mut lines: Vec<String> = comments.collect();
        self.value.push_lines(&self.key, indent, &mut lines);
        lines
    }
}

/// The text with an entry more, at the end of the mapping at `path`; every other byte is that of `text`. `None`: no text was found that reads as
/// `expected`, for example because the mapping is an alias.
#[must_use]
pub fn with_entry(
    text: &str,
    path: &[&str],
    entry: &Entry,
    expected: &RawProfile,
) -> Option<String> {
    let places = Places::of(text);
    let (key, value) = (places.key(path)?, places.value(path)?);
    let lines: Vec<&str> = text.split_inclusive('\n').collect();
    let at = Section {
        lines: &lines,
        key: key.line.checked_sub(1)?,
        indent: key.column.checked_sub(1)?,
        new_line: new_line(text),
    };
    let reads = |text: &String| parse(text, "").is_ok_and(|raw| raw == *expected);
    if at.is_flow(value.line.checked_sub(1)?, value.column.checked_sub(1)?) {
        return at.in_flow(entry).find(reads);
    }
    // A section without a value yet has its keys two characters further in.
    let indent = match value.line > key.line {
        true => value.column - 1,
        false => key.column + 1,
    };
    Some(at.in_block(entry, &" ".repeat(indent))).filter(reads)
}

/// The text with comments above the line of the key at `path`. `None`: it would not read as before.
#[must_use]
pub fn with_comments(text: &str, path: &[&str], comments: &[String]) -> Option<String> {
    let before = parse(text, "").ok()?;
    let key = Places::of(text).key(path)?;
    let lines: Vec<&str> = text.split_inclusive('\n').collect();
    let at = key.line.checked_sub(1)?;
    let indent = " ".repeat(indent_of(lines.get(at)?));
    let new_line = new_line(text);
    let comments = comments.iter().map(|c| format!("{indent}{c}{new_line}"));
    let comments: String = comments.collect();
    let text = format!("{}{comments}{}", lines[..at].concat(), lines[at..].concat());
    parse(&text, "")
        .is_ok_and(|raw| raw == before)
        .then_some(text)
}

/// The text with another scalar in the place of `old` at `path`; every other byte is that of `text`. `None`: no text was found that reads as
/// `expected`.
#[must_use]
pub fn with_value(
    text: &str,
    path: &[&str],
    old: &str,
    new: &str,
    expected: &RawProfile,
) -> Option<String> {
    let place = Places::of(text).value(path)?;
    let lines = text.split_inclusive('\n');
    let before: usize = lines.take(place.line.checked_sub(1)?).map(str::len).sum();
    let line = text[before..].chars().take(place.column.checked_sub(1)?);
    let at = before + line.map(char::len_utf8).sum::<usize>();
    let (before, after) = text.split_at(at);
    let plain = after.strip_prefix(old);
    let quoted = ['"', '\''].into_iter().filter_map(|quote| {
        let inside = after.strip_prefix(quote)?;
        inside.split_once(quote).map(|(_, rest)| rest)
    });
    let texts = plain.into_iter().chain(quoted);
    let mut texts = texts.map(|rest| format!("{before}{new}{rest}"));
    texts.find(|text| parse(text, "").is_ok_and(|raw| raw == *expected))
}

/// A mapping in the text.
struct Section<'t> {
    lines: &'t [&'t str],
    /// Line of its key, from 0.
    key: usize,
    /// Characters before its key.
    indent: usize,
    new_line: &'static str,
}

/// What ends the lines of a text.
fn new_line(text: &str) -> &'static str {
    match text.contains("\r\n") {
        true => "\r\n",
        false => "\n",
    }
}

/// Characters before the first that is no space.
fn indent_of(line: &str) -> usize {
    line.chars().take_while(|c| *c == ' ').count()
}

fn is_empty_or_comment(line: &str) -> bool {
    let line = line.trim_start();
    line.is_empty() || line.starts_with('#')
}

impl Section<'_> {
    fn is_flow(&self, line: usize, column: usize) -> bool {
        let line = self.lines.get(line);
        line.is_some_and(|l| l.chars().nth(column) == Some('{'))
    }

    /// The first line that does not belong to it, from 0: comments that are indented as its keys do.
    fn end(&self, indent: usize) -> usize {
        let mut end = self.key + 1;
        for (i, line) in self.lines.iter().enumerate().skip(self.key + 1) {
            let belongs = if is_empty_or_comment(line) {
                line.trim_start().starts_with('#') && indent_of(line) >= indent && i == end
            } else {
                if indent_of(line) <= self.indent {
                    break;
                }
                true
            };
            if belongs {
                end = i + 1;
            }
        }
        end
    }

    fn joined(&self, lines: impl IntoIterator<Item = String>) -> String {
        let ended = |line: String| line + self.new_line;
        lines.into_iter().map(ended).collect()
    }

    fn in_block(&self, entry: &Entry, indent: &str) -> String {
        let end = self.end(indent.len());
        let mut text = self.lines[..end].concat();
        if !text.ends_with('\n') {
            text += self.new_line;
        }
        text += &self.joined(entry.lines(indent));
        text + &self.lines[end..].concat()
    }

    /// The texts with the entry before each brace that could close the mapping, its comments above the line of its key.
    fn in_flow(&self, entry: &Entry) -> impl Iterator<Item = String> {
        let above = self.lines[..self.key].concat();
        let rest = self.lines[self.key..].concat();
        let indent = " ".repeat(self.lines.get(self.key).map_or(0, |line| indent_of(line)));
        // The line is that of the whole mapping: they say which entry they are about.
        let of = (!entry.comments.is_empty()).then(|| format!("# {}:", entry.key));
        let comments = of.iter().chain(&entry.comments);
        let above = above + &self.joined(comments.map(|c| format!("{indent}{c}")));
        let braces: Vec<usize> = rest.match_indices('}').map(|(at, _)| at).collect();
        let added = format!("{}: {}", entry.key, entry.value.flow());
        // The last entry may end with a comma, or there may be none: only one way reads as expected.
        let ways = braces.into_iter().flat_map(|at| {
            let ways = match rest[..at].trim_end().ends_with('{') {
                true => ["", ", ", " "],
                false => [", ", " ", ""],
            };
            ways.map(|way| (at, way))
        });
        let ways: Vec<(usize, &str)> = ways.collect();
        ways.into_iter().map(move |(brace, comma)| {
            let (before, after) = rest.split_at(brace);
            let before = before.trim_end_matches(' ');
            // On a line of its own it is indented: a comment may end the line before.
            let lead = match before.ends_with('\n') {
                true => format!("{indent}  "),
                false => String::new(),
            };
            format!("{above}{before}{lead}{comma}{added}{after}")
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::raw::RawRecording;

    const HEAD: &str = "calib: 1\nrobot: {name: a, urdf: a.urdf}\ntracker: {frame: w}\nbodies:\n  b: {link: l, markers: [m]}\n";

    fn entry() -> Entry {
        let flow = |text: &str| Value::Flow(text.to_owned());
        Entry {
            comments: vec!["# Found.".to_owned()],
            key: "new".to_owned(),
            value: Value::Map {
                anchor: None,
                entries: vec![
                    ("file".to_owned(), flow("n.csv")),
                    ("use".to_owned(), flow("static")),
                ],
            },
        }
    }

    fn added(text: &str) -> Option<String> {
        let mut expected = parse(text, "p.yaml").expect("a profile");
        let new: RawRecording = serde_saphyr::from_str("{file: n.csv, use: static}").expect("one");
        expected.recordings.insert("new".to_owned(), new);
        with_entry(text, &["recordings"], &entry(), &expected)
    }

    #[test]
    fn entries_stand_at_the_end_of_their_block_and_nothing_else_changes() {
        const NEW: &str = "  # Found.\n  new:\n    file: n.csv\n    use: static\n";
        for (before, after) in [
            ("recordings:\n  a: {file: a.csv, use: static}\n", ""),
            (
                "recordings:\n  a: {file: a.csv, use: static}\n  # of a\n",
                "# of solve\nsolve: {}\n",
            ),
            (
                "recordings: # all\n  # first\n  a:\n    file: a.csv\n\n    # why\n    use: static # so\n",
                "\n\nsolve: {}\n",
            ),
            (
                "recordings:\n  a: {file: a.csv,\n    use: static}\n",
                "\n  # late\n",
            ),
            (
                "recordings:\n  a:\n    file: a.csv\n    use: static\n    # of use\n",
                "...\n",
            ),
        ] {
            let text = format!("{HEAD}{before}{after}");
            assert_eq!(
                added(&text),
                Some(format!("{HEAD}{before}{NEW}{after}")),
                "{text}"
            );
        }
    }

    #[test]
    fn line_ends_and_the_indentation_of_the_text_are_kept() {
        let text = format!("{HEAD}recordings:\n     a: {{file: a.csv, use: static}}");
        let new = added(&text).expect("a place");
        let lines = "\n     # Found.\n     new:\n       file: n.csv\n       use: static\n";
        assert_eq!(new, text.clone() + lines);
        let dos = (text + "\n").replace('\n', "\r\n");
        let new = added(&dos).expect("a place");
        assert_eq!(new, dos + &lines[1..].replace('\n', "\r\n"));
    }

    #[test]
    fn mappings_in_flow_style_stay_so() {
        const NEW: &str = "new: {file: n.csv, use: static}";
        for (before, comma, after) in [
            ("recordings: {a: {file: a.csv, use: static}", ", ", "}\n"),
            ("recordings: {", "", "} # none\nsolve: {}\n"),
            (
                "recordings: {a: {file: \"}.csv\", use: static},",
                " ",
                "}\n",
            ),
            (
                "recordings: {\n  a: {file: a.csv, use: static} # }\n",
                "  , ",
                "}\n",
            ),
        ] {
            let text = format!("{HEAD}{before}{after}");
            let new = format!("{HEAD}# new:\n# Found.\n{before}{comma}{NEW}{after}");
            assert_eq!(added(&text), Some(new));
        }
    }

    #[test]
    fn a_section_without_entries_gets_its_first() {
        const NEW: &str = "  # Found.\n  new:\n    file: n.csv\n    use: static\n";
        for (before, after) in [
            ("recordings:\n", ""),
            ("recordings: # none\n", "\n# of solve\nsolve: {}\n"),
        ] {
            let text = format!("{HEAD}{before}{after}");
            assert_eq!(added(&text), Some(format!("{HEAD}{before}{NEW}{after}")));
        }
    }

    #[test]
    fn a_value_takes_the_place_of_another_however_it_is_written() {
        for old in ["a b.csv", "\"a b.csv\"", "'a b.csv'"] {
            let of =
                |file: &str| format!("{HEAD}recordings:\n  ä: {{use: static, file: {file}}} # ö\n");
            let (text, new) = (of(old), of("c.csv"));
            let expected = parse(&new, "p.yaml").expect("a profile");
            let path = ["recordings", "ä", "file"];
            let replaced = with_value(&text, &path, "a b.csv", "c.csv", &expected);
            assert_eq!(replaced, Some(new));
        }
    }

    #[test]
    fn a_mapping_that_is_an_alias_is_left_alone() {
        let text = format!("{HEAD}recordings: &r {{a: {{file: a.csv, use: static}}}}\n");
        let new = added(&text).expect("a place");
        assert!(new.contains("&r {a"), "{new}");
        let mut expected = parse(&text, "p.yaml").expect("a profile");
        expected.calib = 2;
        assert_eq!(
            with_entry(&text, &["recordings"], &entry(), &expected),
            None
        );
    }
}
