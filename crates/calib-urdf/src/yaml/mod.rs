//! A YAML text as a tree whose every scalar knows its bytes, for edits that leave every other byte alone.
//!
//! Read with the event parser behind the profile's YAML reader; comments, order and quoting never pass through here.

pub mod origins;

use crate::edit::error::EditError;
use crate::error::Place;
use granit_parser::{Event, Parser, ScalarStyle, Span};
use std::ops::Range;

/// A node of the tree.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct YamlNode {
    /// Its bytes: those of the value alone for a scalar, where it begins for a collection.
    pub(crate) range: Range<usize>,
    /// It has an anchor, so an alias may stand for it elsewhere.
    pub(crate) anchored: bool,
    /// What it is.
    pub(crate) kind: YamlKind,
}

/// What a node is.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum YamlKind {
    /// A value; `plain` without quotes, tag or block style.
    Scalar { text: String, plain: bool },
    /// Keys and values in the order of the file; keys that are not scalars are ignored.
    Map(Vec<(String, YamlNode)>),
    /// A list.
    List(Vec<YamlNode>),
    /// `*name`: the value stands elsewhere.
    Alias,
}

impl YamlNode {
    /// The entries of a map; none of anything else.
    pub(crate) fn entries(&self) -> &[(String, YamlNode)] {
        match &self.kind {
            YamlKind::Map(entries) => entries,
            _ => &[],
        }
    }

    /// The value of a key, and how often the key stands there.
    pub(crate) fn get(&self, key: &str) -> (Option<&YamlNode>, usize) {
        let mut found = self.entries().iter().filter(|(k, _)| k == key);
        (found.next().map(|(_, node)| node), 1 + found.count())
    }
}

/// The first document of a YAML text.
///
/// # Errors
/// [`EditError::Yaml`] where it cannot be read, or holds no value.
pub(crate) fn parse(text: &str, file: &str) -> Result<YamlNode, EditError> {
    let mut parser = Parser::new_from_str(text);
    let fault = |offset: usize, reason: &str| EditError::Yaml {
        file: file.to_owned(),
        place: Place::of_byte(text, offset),
        reason: reason.to_owned(),
    };
    while let Some(next) = parser.next_event() {
        let (event, span) = next.map_err(|e| {
            let offset = e.marker().byte_offset().unwrap_or(text.len());
            fault(offset, &e.info())
        })?;
        match event {
            Event::StreamStart | Event::DocumentStart(..) | Event::Comment(..) => {}
            Event::StreamEnd | Event::DocumentEnd => break,
            event => {
                return node(&mut parser, event, &span).map_err(|e| match e {
                    Stop::Scan(offset, reason) => {
                        fault(offset.unwrap_or(text.len()), reason.as_str())
                    }
                    Stop::End => fault(text.len(), "the text ends in the middle of a value"),
                });
            }
        }
    }
    Err(fault(0, "there is no value in it"))
}

enum Stop {
    Scan(Option<usize>, String),
    End,
}

type Events<'a> = Parser<'a, granit_parser::StrInput<'a>>;

fn next<'a>(parser: &mut Events<'a>) -> Result<(Event<'a>, Span), Stop> {
    loop {
        let (event, span) = parser
            .next_event()
            .ok_or(Stop::End)?
            .map_err(|e| Stop::Scan(e.marker().byte_offset(), e.info()))?;
        if !matches!(event, Event::Comment(..)) {
            return Ok((event, span));
        }
    }
}

/// Depth is bounded by the parser's own limit of 255 nested collections.
fn node<'a>(parser: &mut Events<'a>, event: Event<'a>, span: &Span) -> Result<YamlNode, Stop> {
    let range = span.byte_range().unwrap_or(0..0);
    Ok(match event {
        Event::Scalar(text, style, anchor, tag) => YamlNode {
            range,
            anchored: anchor != 0,
            kind: YamlKind::Scalar {
                text: text.into_owned(),
                plain: style == ScalarStyle::Plain && tag.is_none(),
            },
        },
        Event::MappingStart(_, anchor, _) => {
            let mut entries = Vec::new();
            loop {
                let (event, span) = next(parser)?;
                if matches!(event, Event::MappingEnd) {
                    break;
                }
                let key = node(parser, event, &span)?;
                let (event, span) = next(parser)?;
                let value = node(parser, event, &span)?;
                if let YamlKind::Scalar { text, .. } = key.kind {
                    entries.push((text, value));
                }
            }
            YamlNode {
                range,
                anchored: anchor != 0,
                kind: YamlKind::Map(entries),
            }
        }
        Event::SequenceStart(_, anchor, _) => {
            let mut items = Vec::new();
            loop {
                let (event, span) = next(parser)?;
                if matches!(event, Event::SequenceEnd) {
                    break;
                }
                items.push(node(parser, event, &span)?);
            }
            YamlNode {
                range,
                anchored: anchor != 0,
                kind: YamlKind::List(items),
            }
        }
        _ => YamlNode {
            range,
            anchored: false,
            kind: YamlKind::Alias,
        },
    })
}
