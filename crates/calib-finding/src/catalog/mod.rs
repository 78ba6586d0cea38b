//! The ids of all findings with their words: the one place where findings become sentences.
//!
//! Each topic is a file. An entry has one form, or several that the fact `kind` selects; a form is a severity, a
//! sentence and a remedy with places for values. Every id has a section in `book/src/findings.md`; a test compares
//! the two.

mod bodies;
mod changes;
mod files;
mod joints;
mod markers;
mod model;
mod motion;
mod results;

pub use bodies::*;
pub use changes::*;
pub use files::*;
pub use joints::*;
pub use markers::*;
pub use model::*;
pub use motion::*;
pub use results::*;

use crate::Severity;
use std::cmp::Ordering;
use std::fmt;
use std::hash::{Hash, Hasher};

/// The id of a finding: an entry of the catalog.
#[derive(Clone, Copy)]
pub struct Id(&'static Entry);

/// What the catalog knows of one id.
struct Entry {
    /// Kebab-case and stable.
    id: &'static str,
    /// At least one.
    forms: &'static [Form],
}

/// One form of an entry.
pub(crate) struct Form {
    /// The fact `kind` that selects it; empty for the only form.
    kind: &'static str,
    /// How bad it is.
    pub(crate) severity: Severity,
    /// What was found.
    pub(crate) text: &'static str,
    /// What to do about it.
    pub(crate) remedy: &'static str,
}

/// Declares the entries of a topic: constants for the code, and the list `ENTRIES`.
macro_rules! topic {
    ($( $(#[$doc:meta])* $name:ident = $id:literal {
        $( $kind:literal: $severity:ident, $text:literal, $remedy:literal; )+
    } )+) => {
        $(
            $(#[$doc])*
            pub const $name: super::Id = super::Id(&super::Entry {
                id: $id,
                forms: &[$( super::Form {
                    kind: $kind,
                    severity: crate::Severity::$severity,
                    text: $text,
                    remedy: $remedy,
                } ),+],
            });
        )+
        pub(super) const ENTRIES: &[super::Id] = &[$( $name ),+];
    };
}
use topic;

impl Id {
    /// The id of a finding that was written by a version of the program with another catalog.
    pub const UNKNOWN: Id = Id(&Entry {
        id: "unknown-finding",
        forms: &[Form {
            kind: "",
            severity: Severity::Info,
            text: "This version of the program does not know this finding.",
            remedy: "Read the text in the report itself.",
        }],
    });

    /// All ids of the catalog, sorted.
    #[must_use]
    pub fn all() -> Vec<Id> {
        let topics = [
            bodies::ENTRIES,
            changes::ENTRIES,
            files::ENTRIES,
            joints::ENTRIES,
            markers::ENTRIES,
            model::ENTRIES,
            motion::ENTRIES,
            results::ENTRIES,
        ];
        let mut all = topics.concat();
        all.sort();
        all
    }

    /// The id of this name.
    #[must_use]
    pub fn parse(name: &str) -> Option<Id> {
        Id::all().into_iter().find(|id| id.0.id == name)
    }

    /// The name: kebab-case and stable.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        self.0.id
    }

    /// The section of the book that explains it, relative to `book/src`.
    #[must_use]
    pub fn page(self) -> String {
        format!("findings.md#{}", self.0.id)
    }

    /// The form of a kind; the first one where there is no such kind.
    pub(crate) fn form(self, kind: Option<&str>) -> &'static Form {
        let forms = self.0.forms;
        let named = forms.iter().find(|form| Some(form.kind) == kind);
        named.unwrap_or(&forms[0])
    }

    /// The kinds of its forms; one empty text where there is only one form.
    #[must_use]
    pub fn kinds(self) -> Vec<&'static str> {
        self.0.forms.iter().map(|form| form.kind).collect()
    }
}

impl PartialEq for Id {
    fn eq(&self, other: &Self) -> bool {
        self.0.id == other.0.id
    }
}

impl Eq for Id {}

impl PartialOrd for Id {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Id {
    fn cmp(&self, other: &Self) -> Ordering {
        self.0.id.cmp(other.0.id)
    }
}

impl Hash for Id {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.0.id.hash(state);
    }
}

impl fmt::Debug for Id {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.0.id)
    }
}

impl fmt::Display for Id {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.0.id)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::template;

    #[test]
    fn ids_are_unique_and_kebab_case() {
        let all = Id::all();
        assert!(all.len() > 40, "{}", all.len());
        for pair in all.windows(2) {
            assert!(pair[0] < pair[1], "{} occurs twice", pair[0]);
        }
        for id in all {
            let letters = |b: u8| b.is_ascii_lowercase() || b == b'-';
            assert!(id.as_str().bytes().all(letters), "{id}");
            assert_eq!(Id::parse(id.as_str()), Some(id));
        }
        assert_eq!(Id::parse("unknown-finding"), None);
    }

    #[test]
    fn texts_are_sentences_and_remedies_too() {
        for id in Id::all() {
            let kinds = id.kinds();
            let several = kinds.len() > 1;
            for form in id.0.forms {
                assert_eq!(several, !form.kind.is_empty(), "{id}: kinds {kinds:?}");
                assert_eq!(
                    kinds.iter().filter(|kind| **kind == form.kind).count(),
                    1,
                    "{id}: `{}` is declared twice",
                    form.kind
                );
                for text in [form.text, form.remedy] {
                    let first = text.chars().find(|c| c.is_alphanumeric() || *c == '{');
                    let begins = first.is_some_and(|c| c.is_uppercase() || c == '{');
                    assert!(
                        begins && text.trim_end_matches("]]").ends_with('.'),
                        "{id}: {text}"
                    );
                    assert_eq!(
                        text.matches("[[").count(),
                        text.matches("]]").count(),
                        "{id}: {text}"
                    );
                    assert_eq!(text.matches('`').count() % 2, 0, "{id}: {text}");
                }
            }
        }
    }

    #[test]
    fn a_brace_that_is_text_is_written_once() {
        for form in Id::all().into_iter().flat_map(|id| id.0.forms) {
            for text in [form.text, form.remedy] {
                for inside in text.split("{{").skip(1) {
                    let inside = inside.split('}').next().unwrap_or_default();
                    assert!(template::is_place(inside), "`{inside}` in {text}");
                }
            }
        }
    }

    #[test]
    fn every_place_for_a_value_has_a_plain_key() {
        for form in Id::all().into_iter().flat_map(|id| id.0.forms) {
            for key in template::keys(form.text) {
                assert!(
                    !key.is_empty() && key.bytes().all(|b| b.is_ascii_lowercase() || b == b'_'),
                    "{key} in {}",
                    form.text
                );
            }
        }
    }
}
