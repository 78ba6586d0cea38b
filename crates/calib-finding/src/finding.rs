//! A finding and its form in JSON.

use crate::catalog::Id;
use crate::{Fact, Facts, Subject, template};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::fmt;

/// How bad a finding is.
#[derive(
    Debug,
    Clone,
    Copy,
    Default,
    PartialEq,
    Eq,
    PartialOrd,
    Ord,
    Hash,
    Serialize,
    Deserialize,
    JsonSchema,
)]
#[serde(rename_all = "snake_case")]
pub enum Severity {
    /// Good to know; nothing is wrong.
    #[default]
    Info,
    /// The result may be worse than it looks; it goes into the report.
    Warning,
    /// The data, the result, or a part of it, cannot be used.
    Error,
}

impl Severity {
    /// The word for people.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Info => "info",
            Self::Warning => "warning",
            Self::Error => "error",
        }
    }
}

impl fmt::Display for Severity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.word())
    }
}

/// One finding: data only. The words come from the [catalog](crate::catalog).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(into = "Written", from = "Written")]
#[schemars(with = "Written")]
#[non_exhaustive]
pub struct Finding {
    /// Stable id from the catalog; the book has a section of that name.
    pub id: Id,
    /// How bad it is; [`new`](Self::new) takes it from the catalog.
    pub severity: Severity,
    /// What it is about.
    pub subject: Subject,
    /// The rows it is about, as the recording numbers them: lines from 1 of our own tables, frames of a tracker's
    /// file. Empty: all rows, or none in particular.
    pub rows: Vec<u64>,
    /// Named values.
    pub facts: Facts,
}

impl Finding {
    /// A finding of a given id, in the catalog's first form.
    pub fn new(id: Id, subject: impl Into<Subject>) -> Self {
        Finding {
            id,
            severity: id.form(None).severity,
            subject: subject.into(),
            rows: Vec::new(),
            facts: Facts::new(),
        }
    }

    /// A finding of an id that has several forms; `kind` names one of them and becomes the fact `kind`.
    pub fn of_kind(id: Id, kind: &'static str, subject: impl Into<Subject>) -> Self {
        let mut finding = Finding::new(id, subject).with("kind", Fact::choice(kind));
        finding.severity = finding.form().severity;
        finding
    }

    /// The same finding with one more value.
    #[must_use]
    pub fn with(mut self, key: &'static str, fact: Fact) -> Self {
        self.facts.insert(key, fact);
        self
    }

    /// The same finding, with a value where there is one.
    #[must_use]
    pub fn with_some(self, key: &'static str, fact: Option<Fact>) -> Self {
        match fact {
            Some(fact) => self.with(key, fact),
            None => self,
        }
    }

    /// The same finding, about these rows.
    #[must_use]
    pub fn at_rows(mut self, rows: impl IntoIterator<Item = u64>) -> Self {
        self.rows = rows.into_iter().collect();
        self
    }

    /// The same finding, with another severity.
    #[must_use]
    pub fn with_severity(mut self, severity: Severity) -> Self {
        self.severity = severity;
        self
    }

    /// The same finding, its subject seen in this recording.
    #[must_use]
    pub fn in_recording(mut self, name: impl Into<String>) -> Self {
        self.subject = self.subject.in_recording(name);
        self
    }

    /// What was found, in one sentence with numbers and units.
    #[must_use]
    pub fn text(&self) -> String {
        template::fill(self.form().text, &self.facts)
    }

    /// What to do about it, in sentences of their own.
    #[must_use]
    pub fn remedy(&self) -> String {
        template::fill(self.form().remedy, &self.facts)
    }

    fn form(&self) -> &'static crate::catalog::Form {
        self.id.form(self.facts.get("kind").and_then(Fact::word))
    }
}

/// A finding in JSON.
#[derive(Serialize, Deserialize, JsonSchema)]
#[schemars(rename = "Finding")]
struct Written {
    /// Stable id: the section of the book that explains it.
    id: String,
    /// How bad.
    severity: Severity,
    /// What it is about, for people: a recording, body, marker, joint.
    subject: String,
    /// Rows of the recording as its file numbers them; empty when it is about all.
    rows: Vec<u64>,
    /// What was found, with numbers.
    text: String,
    /// What to do.
    remedy: String,
    /// The values of the text by name, SI; `kind` says which form of the text it is.
    #[serde(default)]
    facts: Facts,
    /// What it is about, for programs.
    #[serde(default)]
    about: Subject,
}

impl From<Finding> for Written {
    fn from(finding: Finding) -> Self {
        Written {
            text: finding.text(),
            remedy: finding.remedy(),
            id: finding.id.as_str().to_owned(),
            severity: finding.severity,
            subject: finding.subject.to_string(),
            rows: finding.rows,
            facts: finding.facts,
            about: finding.subject,
        }
    }
}

impl From<Written> for Finding {
    fn from(written: Written) -> Self {
        Finding {
            id: Id::parse(&written.id).unwrap_or(Id::UNKNOWN),
            severity: written.severity,
            subject: written.about,
            rows: written.rows,
            facts: written.facts,
        }
    }
}
