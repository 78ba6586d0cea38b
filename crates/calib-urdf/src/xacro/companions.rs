//! The files that a xacro reads besides itself: what it includes, and the YAML that it loads.
//!
//! This crate opens none of them: [`references`] says what is read, the caller finds and reads the files, and
//! [`crate::patch_with`] gets their texts.

use crate::error::{Place, ReadError};
use crate::read::source::OwnAttributes as _;
use crate::read::source::parse;
use crate::xacro::expression::{Access, Root};
use crate::xacro::is_xacro;
use roxmltree::{Document, Node};

/// A file that a xacro names.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Companion {
    /// How the xacro names it, `$(find pkg)/config/calibration.yaml`; properties and defaults of arguments replaced.
    pub argument: String,
    /// Its name in messages.
    pub name: String,
    /// Its text.
    pub text: String,
}

/// The files around a xacro, as far as they were found.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Companions {
    /// YAML that it loads. A number that is read from here can be replaced here.
    pub yaml: Vec<Companion>,
    /// What it includes, and what that includes. Properties that these use are not replaced.
    pub included: Vec<Companion>,
    /// Arguments of included files that were not found; they may use any property.
    pub unseen: Vec<String>,
}

/// Why a xacro reads a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reads {
    /// `<xacro:include filename="…"/>`
    Include,
    /// `xacro.load_yaml(…)`
    Yaml,
}

/// A file that a xacro reads.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Reference {
    /// Why.
    pub reads: Reads,
    /// The argument, as [`Companion::argument`].
    pub argument: String,
    /// Where it says so.
    pub place: Place,
}

/// What a xacro's text reads, in the order of the text, each argument once.
///
/// # Errors
/// [`ReadError`] for a text that is not XML with the root `<robot>`.
pub fn references(text: &str, name_for_errors: &str) -> Result<Vec<Reference>, ReadError> {
    let document = parse(text, name_for_errors)?;
    let mut found: Vec<Reference> = Vec::new();
    let mut push = |reads: Reads, argument: String, offset: usize| {
        if !found
            .iter()
            .any(|known| known.reads == reads && known.argument == argument)
        {
            found.push(Reference {
                reads,
                argument,
                place: Place::of_byte(text, offset),
            });
        }
    };
    for node in document.descendants().filter(Node::is_element) {
        if let (true, Some(filename)) = (is_xacro(node, "include"), node.own("filename")) {
            push(
                Reads::Include,
                plain_text(&document, filename),
                node.range().start,
            );
        }
        for attribute in node.attributes() {
            for expression in crate::xacro::expression::expressions(attribute.value()) {
                if let Some(Access {
                    root: Root::Load(argument),
                    ..
                }) = Access::parse(expression)
                {
                    let argument = loaded(&document, &argument);
                    push(Reads::Yaml, argument, attribute.range().start);
                }
            }
        }
    }
    Ok(found)
}

/// The argument of `load_yaml(…)`: a quoted text, or the property that holds it.
pub(crate) fn loaded(document: &Document<'_>, argument: &str) -> String {
    let quoted = ['\'', '"'].into_iter().find_map(|quote| {
        argument
            .strip_prefix(quote)
            .and_then(|rest| rest.strip_suffix(quote))
    });
    match quoted {
        Some(text) => plain_text(document, text),
        None => plain_text(document, &format!("${{{argument}}}")),
    }
}

/// A text with its properties and the defaults of its arguments put in; what cannot be put in stays.
pub(crate) fn plain_text(document: &Document<'_>, text: &str) -> String {
    /// A property that names itself would be put in forever.
    const DEEPEST: usize = 8;
    let mut text = text.to_owned();
    for _ in 0..DEEPEST {
        let Some((range, value)) = first_known(document, &text) else {
            break;
        };
        text.replace_range(range, &value);
    }
    text
}

fn first_known(document: &Document<'_>, text: &str) -> Option<(std::ops::Range<usize>, String)> {
    for (open, close, element, attribute) in [
        ("${", '}', "property", "value"),
        ("$(arg ", ')', "arg", "default"),
    ] {
        for (start, _) in text.match_indices(open) {
            let rest = &text[start + open.len()..];
            let Some(length) = rest.find(close) else {
                continue;
            };
            let name = rest[..length].trim();
            let value = document
                .descendants()
                .find(|node| is_xacro(*node, element) && node.own("name") == Some(name))
                .and_then(|node| node.own(attribute));
            if let Some(value) = value {
                return Some((
                    start..start + open.len() + length + close.len_utf8(),
                    value.to_owned(),
                ));
            }
        }
    }
    None
}

/// The included files that nobody has read: they may use any property.
pub(crate) fn unseen(document: &Document<'_>, companions: &Companions) -> bool {
    !companions.unseen.is_empty()
        || document
            .descendants()
            .filter(|node| is_xacro(*node, "include"))
            .any(|node| {
                let argument = plain_text(document, node.own("filename").unwrap_or(""));
                !companions
                    .included
                    .iter()
                    .any(|file| file.argument == argument)
            })
}
