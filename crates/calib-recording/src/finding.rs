//! A finding: something about the data that a person should know before believing a calibration.

use serde::Serialize;

/// How bad it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// Worth knowing; nothing is wrong.
    Info,
    /// The result may suffer; it goes into the report.
    Warning,
    /// The data cannot be used as they are.
    Error,
}

/// `1 row`, `2 rows`.
pub(crate) fn counted(count: usize, one: &str) -> String {
    format!("{count} {one}{}", if count == 1 { "" } else { "s" })
}

/// The verb after [`counted`].
pub(crate) fn are(count: usize) -> &'static str {
    if count == 1 { "is" } else { "are" }
}

/// One finding about a recording. Its id is stable: the book has a page of that name.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Finding {
    /// Kebab-case id, e.g. `all-zero-triplet`.
    pub id: &'static str,
    /// How bad it is.
    pub severity: Severity,
    /// The marker, body, joint or file it is about.
    pub subject: String,
    /// The rows it is about, numbered as [`Poses::rows`](crate::Poses::rows) numbers them: lines from
    /// 1 of our own tables, frames of a tracker's file. Empty = the whole recording.
    pub rows: Vec<u64>,
    /// What was found, with numbers and units.
    pub text: String,
    /// What to do about it.
    pub remedy: String,
}

impl Finding {
    /// A finding about all rows; see [`at_rows`](Self::at_rows).
    pub fn new(
        id: &'static str,
        severity: Severity,
        subject: impl Into<String>,
        text: impl Into<String>,
        remedy: impl Into<String>,
    ) -> Self {
        Finding {
            id,
            severity,
            subject: subject.into(),
            rows: Vec::new(),
            text: text.into(),
            remedy: remedy.into(),
        }
    }

    /// The same finding, about these rows.
    pub fn at_rows(mut self, rows: impl IntoIterator<Item = u64>) -> Self {
        self.rows = rows.into_iter().collect();
        self
    }
}
