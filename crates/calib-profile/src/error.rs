//! Messages about a profile: file, line, caret, what was found, what was expected.

use std::fmt;

use calib_finding::nearest_word;

use crate::locate::{Place, Places};
use crate::slip;

/// One problem.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Problem {
    /// Where in the text, when it has one place.
    pub place: Option<Place>,
    /// What was found.
    pub finding: String,
    /// What to do about it.
    pub remedy: String,
}

impl Problem {
    /// A problem at a place.
    pub fn new(
        place: Option<Place>,
        finding: impl Into<String>,
        remedy: impl Into<String>,
    ) -> Self {
        Self {
            place,
            finding: finding.into(),
            remedy: remedy.into(),
        }
    }
}

/// Everything that is wrong with one profile.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ProfileError {
    file: String,
    lines: Vec<String>,
    /// The problems, in the order of the text.
    pub problems: Vec<Problem>,
}

impl ProfileError {
    pub(crate) fn new(file: &str, text: &str, mut problems: Vec<Problem>) -> Self {
        problems.sort_by_key(|p| p.place);
        Self {
            file: file.to_owned(),
            lines: text.lines().map(str::to_owned).collect(),
            problems,
        }
    }
}

impl ProfileError {
    /// The profile, as the caller named it.
    #[must_use]
    pub fn file(&self) -> &str {
        &self.file
    }

    /// One problem at the value that `path` (keys, or list positions as decimal numbers) leads to.
    pub fn at(
        file: &str,
        text: &str,
        path: &[&str],
        finding: impl Into<String>,
        remedy: impl Into<String>,
    ) -> Self {
        let place = Places::of(text).value(path);
        Self::new(file, text, vec![Problem::new(place, finding, remedy)])
    }

    /// The same at the last key of `path`.
    pub fn at_key(
        file: &str,
        text: &str,
        path: &[&str],
        finding: impl Into<String>,
        remedy: impl Into<String>,
    ) -> Self {
        let places = Places::of(text);
        let place = places.key(path).or_else(|| places.value(path));
        Self::new(file, text, vec![Problem::new(place, finding, remedy)])
    }
}

impl std::error::Error for ProfileError {}

impl fmt::Display for ProfileError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, problem) in self.problems.iter().enumerate() {
            if i > 0 {
                writeln!(f)?;
            }
            match problem.place {
                Some(place) => {
                    write!(
                        f,
                        "{}:{}:{}: {}",
                        self.file, place.line, place.column, problem.finding
                    )?;
                    if let Some(line) = self.lines.get(place.line.saturating_sub(1)) {
                        let number = place.line.to_string();
                        write!(f, "\n{number} | {line}")?;
                        let caret = " ".repeat(place.column.saturating_sub(1));
                        write!(f, "\n{:width$} | {caret}^", "", width = number.len())?;
                    }
                }
                None => write!(f, "{}: {}", self.file, problem.finding)?,
            }
            if !problem.remedy.is_empty() {
                write!(f, "\n  help: {}", problem.remedy)?;
            }
        }
        Ok(())
    }
}

/// `a, b or c`.
pub(crate) fn one_of<S: AsRef<str>>(names: impl IntoIterator<Item = S>) -> String {
    let names: Vec<String> = names
        .into_iter()
        .map(|n| format!("`{}`", n.as_ref()))
        .collect();
    match names.split_last() {
        None => "nothing".to_owned(),
        Some((only, [])) => only.clone(),
        Some((last, rest)) => format!("{} or {last}", rest.join(", ")),
    }
}

/// `did you mean …? expected one of …`, the nearest word first.
pub(crate) fn expected<'a>(wrong: &str, known: impl IntoIterator<Item = &'a str>) -> String {
    let known: Vec<&str> = known.into_iter().collect();
    if known.is_empty() {
        return "the profile declares none".to_owned();
    }
    match nearest_word(wrong, known.iter().copied()) {
        Some(near) => format!("did you mean `{near}`? known: {}", one_of(&known)),
        None => format!("expected {}", one_of(&known)),
    }
}

/// What a value has to be.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Form {
    /// Keys with values.
    Keys,
    /// A list.
    List,
    /// One word, text or number.
    Value,
}

/// The form by the parser's name for it.
fn form(expected: &str) -> Option<Form> {
    match expected {
        "mapping start" => Some(Form::Keys),
        "sequence start" => Some(Form::List),
        "scalar" | "string scalar" => Some(Form::Value),
        _ => None,
    }
}

/// A value of the wrong form: what was found, and what to write.
fn misformed(form: Form, path: &[String]) -> (String, String) {
    let what = match form {
        Form::Keys => "keys with values belong here",
        Form::List => "a list belongs here",
        Form::Value => "a single value belongs here",
    };
    let keys: Vec<&str> = path.iter().map(String::as_str).collect();
    let (finding, remedy) = match (form, keys.as_slice()) {
        (_, []) => (
            what.to_owned(),
            "a profile is YAML: keys, colons, indentation; see the profiles in `robots/`".to_owned(),
        ),
        (Form::Keys, ["plugins"]) => (
            "`plugins`: each plugin is a key".to_owned(),
            "write `plugins: {my-sphere: {}}`, or `plugins: {my-sphere: {path: libmy-sphere.so}}` for a file elsewhere"
                .to_owned(),
        ),
        (Form::Keys, ["plugins", plugin]) => (
            format!("plugin `{plugin}`: {what}"),
            format!("write `{plugin}: {{}}` where it lies in a plugin folder, or `{plugin}: {{path: FILE}}`"),
        ),
        (form, [.., key]) => {
            let remedy = match form {
                Form::Keys => format!(
                    "write `{key}: {{NAME: VALUE}}`, or each `NAME: VALUE` on a line of its own below `{key}:`, indented"
                ),
                Form::List => format!("write `{key}: [A, B]`"),
                Form::Value => format!("write `{key}: VALUE`"),
            };
            (format!("`{}`: {what}", keys.join(".")), remedy)
        }
    };
    (finding, remedy)
}

/// The problem of a value that is understood, though YAML or the profile writes it otherwise.
fn written_otherwise(
    error: &serde_saphyr::Error,
    text: &str,
    place: Option<Place>,
) -> Option<Problem> {
    use serde_saphyr::Error as Yaml;
    match error {
        Yaml::SerdeMissingField { field, .. } if *field == "calib" && !text.trim().is_empty() => {
            let first = Place { line: 1, column: 1 };
            let finding = "the key `calib`, the version of the profile, is missing";
            let remedy = "write `calib: 1` as the first line";
            Some(Problem::new(Some(first), finding, remedy))
        }
        Yaml::SerdeUnknownField { .. } | Yaml::InvalidScalar { .. } => {
            let (written, meant) = slip::decimal_comma(text, place?)?;
            let finding = format!("`{written}` has a decimal comma");
            let remedy = format!("write a decimal point: `{meant}`");
            Some(Problem::new(place, finding, remedy))
        }
        Yaml::Unexpected { expected, .. } if form(expected) == Some(Form::Keys) => {
            let path = Places::of(text).path_to(place?)?;
            let [.., columns, time] = path.as_slice() else {
                return None;
            };
            if columns != "columns" || time != "time" {
                return None;
            }
            let column = slip::plain(text, place?)?;
            let finding = format!("`time: {column}` does not state the unit of the column");
            let remedy = format!("write `{}`", slip::time_column(column));
            Some(Problem::new(place, finding, remedy))
        }
        _ => None,
    }
}

/// The problem of backslashes in double quotes, which begin escapes there.
pub(crate) fn escaped(text: &str, place: Place) -> Option<Problem> {
    let meant = slip::backslashes(text, place)?;
    let finding = "in double quotes `\\` begins an escape, as `\\t` for a tab";
    let remedy = format!("write `/` in paths, on Windows too: `{meant}`; or use single quotes");
    Some(Problem::new(Some(place), finding, remedy))
}

/// The problem of a text that is no YAML.
fn no_yaml(error: &serde_saphyr::Error, text: &str, place: Option<Place>) -> Problem {
    if let Some(problem) = place.and_then(|at| escaped(text, at)) {
        return problem;
    }
    if place.is_some_and(|at| slip::tab(text, at)) {
        let finding = "this line is indented with a tab, which YAML does not allow";
        return Problem::new(place, finding, "indent with spaces, two for each level");
    }
    let full = error.to_string();
    let first = full.lines().next().unwrap_or("not readable as YAML");
    // The place stands before the message.
    let finding = match first.rsplit_once(" at line ") {
        Some((finding, _)) if place.is_some() => finding.to_owned(),
        _ => first.to_owned(),
    };
    let remedy = "a profile is YAML: keys, colons, indentation; see the profiles in `robots/`";
    Problem::new(place, finding, remedy)
}

pub(crate) fn from_yaml(error: &serde_saphyr::Error, text: &str, file: &str) -> ProfileError {
    use serde_saphyr::Error as Yaml;
    let error = error.without_snippet();
    let place = error.location().filter(|at| at.line() > 0).map(|at| Place {
        line: at.line() as usize,
        column: at.column() as usize,
    });
    if let Some(problem) = written_otherwise(error, text, place) {
        return ProfileError::new(file, text, vec![problem]);
    }
    let (finding, remedy) = match error {
        _ if text.trim().is_empty() => (
            "the profile is empty".to_owned(),
            "start from one of the profiles in `robots/`".to_owned(),
        ),
        Yaml::DuplicateMappingKey { key, .. } => {
            let name = key
                .as_deref()
                .map_or_else(|| "a key".to_owned(), |k| format!("the key `{k}`"));
            (
                format!("{name} stands twice"),
                "remove one of them".to_owned(),
            )
        }
        Yaml::SerdeUnknownField {
            field,
            expected: known,
            ..
        } => (
            format!("unknown key `{field}`"),
            expected(field, known.iter().copied()),
        ),
        Yaml::SerdeUnknownVariant {
            variant,
            expected: known,
            ..
        } => (
            format!("unknown word `{variant}`"),
            expected(variant, known.iter().copied()),
        ),
        Yaml::SerdeMissingField { field, .. } => (
            format!("the key `{field}` is missing here"),
            format!("add `{field}: …`"),
        ),
        Yaml::NonFiniteFloat { value, .. } => (
            format!("`{value}` is not finite"),
            "give a finite number".to_owned(),
        ),
        Yaml::InvalidScalar { ty, .. } => {
            let (finding, remedy) = match *ty {
                "floating point" => (
                    "a number belongs here",
                    "give it without its unit, which stands in the key",
                ),
                "boolean" => ("`true` or `false` belongs here", "write one of the two"),
                _ => (
                    "a whole number belongs here",
                    "give 0 or more, without point or unit",
                ),
            };
            (finding.to_owned(), remedy.to_owned())
        }
        Yaml::Unexpected { expected, .. } if form(expected).is_some() => {
            let path = place.and_then(|at| Places::of(text).path_to(at));
            let path = path.unwrap_or_default();
            misformed(form(expected).unwrap_or(Form::Value), &path)
        }
        other => {
            let problem = no_yaml(other, text, place);
            return ProfileError::new(file, text, vec![problem]);
        }
    };
    ProfileError::new(file, text, vec![Problem::new(place, finding, remedy)])
}
