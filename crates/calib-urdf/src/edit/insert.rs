//! New elements and attributes in the hand of the file: its indentation, line ending and quotes.

use crate::edit::decimal::{decimals, tidy_angle};
use crate::edit::error::EditError;
use crate::kinematics::rpy::rpy_from_rotation;
use crate::read::source::top_level;
use nalgebra::Isometry3;
use roxmltree::{Document, Node};

/// A new attribute of an element: where, and the text with its space.
pub(crate) fn attribute(
    text: &str,
    element: Node<'_, '_>,
    name: &str,
    value: &str,
) -> (usize, String) {
    match element
        .attributes()
        .max_by_key(|attribute| attribute.range().start)
    {
        // After the last one, in its own manner: `\r\n\t\txyz='…'` is followed by `\r\n\t\trpy='…'`.
        Some(last) => {
            let range = last.range();
            let quote = &text[range.end - 1..range.end];
            let space = space_before(text, range.start);
            let space = if space.is_empty() { " " } else { space };
            (range.end, format!("{space}{name}={quote}{value}{quote}"))
        }
        None => {
            let start = element.range().start + 1;
            let tag = &text[start..];
            let end = tag
                .find(|c: char| c.is_whitespace() || c == '>' || c == '/')
                .unwrap_or(tag.len());
            (start + end, format!(" {name}=\"{value}\""))
        }
    }
}

/// A new element as the first child element: where, and the text with the space that separates it from the next.
pub(crate) fn first_child(text: &str, parent: Node<'_, '_>, element: &str) -> (usize, String) {
    match parent.first_element_child() {
        Some(first) => {
            let at = first.range().start;
            let space = space_before(text, at);
            // From the line's end on: blank lines above the neighbor are not repeated.
            let space = match space.rfind('\n') {
                Some(newline) => {
                    &space[if space[..newline].ends_with('\r') {
                        newline - 1
                    } else {
                        newline
                    }..]
                }
                None => space,
            };
            (at, format!("{element}{space}"))
        }
        // No joint that could be read is without children; the place before its end tag would do.
        None => {
            let range = parent.range();
            (
                text[range.clone()]
                    .rfind("</")
                    .map_or(range.end, |end| range.start + end),
                element.to_owned(),
            )
        }
    }
}

fn space_before(text: &str, at: usize) -> &str {
    let before = &text[..at];
    let kept = before.trim_end_matches([' ', '\t', '\r', '\n']).len();
    &before[kept..]
}

/// After the last thing inside `<robot>`, before the space that leads to `</robot>`.
pub(crate) fn before_closing_tag(text: &str, document: &Document<'_>) -> usize {
    let range = document.root_element().range();
    let end_tag = text[range.clone()]
        .rfind("</")
        .map_or(range.end, |at| range.start + at);
    end_tag - space_before(text, end_tag).len()
}

/// `urdf:` where the file writes its elements with a prefix.
pub(crate) fn prefix<'t>(text: &'t str, node: Node<'_, '_>) -> &'t str {
    let tag = &text[node.range().start + 1..];
    let name = &tag[..tag
        .find(|c: char| c.is_whitespace() || c == '>' || c == '/')
        .unwrap_or(0)];
    name.find(':').map_or("", |colon| &name[..=colon])
}

/// A link on a fixed joint, to be added.
pub(crate) struct FixedFrame<'a> {
    pub(crate) link: &'a str,
    pub(crate) parent_link: &'a str,
    pub(crate) joint: &'a str,
    /// The joint's origin.
    pub(crate) parent_from_frame: &'a Isometry3<f64>,
    /// Written above the link.
    pub(crate) comment: Option<&'a str>,
}

/// How a file is written.
pub(crate) struct Style<'t> {
    /// `urdf:` where the elements are written with a prefix.
    prefix: &'t str,
    /// `"\n"`, `"\r\n"`, or nothing where the whole robot stands in one line.
    pub(crate) line_ending: &'static str,
    /// Before a top-level element.
    indent: &'t str,
    /// Before its children.
    inner: &'t str,
}

impl<'t> Style<'t> {
    pub(crate) fn of(text: &'t str, document: &Document<'_>) -> Self {
        let line_ending = match text.find('\n') {
            Some(at) if text[..at].ends_with('\r') => "\r\n",
            Some(_) => "\n",
            None => "",
        };
        let indent_of = |node: Node<'_, '_>| {
            let space = space_before(text, node.range().start);
            space.rfind('\n').map(|newline| &space[newline + 1..])
        };
        let last = |kind| top_level(document, kind).filter_map(indent_of).last();
        let indent = last("joint").or_else(|| last("link")).unwrap_or("");
        let inner = top_level(document, "joint")
            .filter_map(|joint| joint.first_element_child())
            .filter_map(indent_of)
            .last();
        Self {
            prefix: prefix(text, document.root_element()),
            line_ending,
            indent,
            inner: inner.unwrap_or(if indent.is_empty() { "  " } else { indent }),
        }
    }

    /// A link on a fixed joint, beginning with a line ending.
    pub(crate) fn fixed_frame(&self, frame: &FixedFrame<'_>) -> String {
        let outer = format!("{}{}", self.line_ending, self.indent);
        // Where the children stand no deeper than the joint, they are set below it all the same.
        let inner = if self.inner.len() > self.indent.len() {
            format!("{}{}", self.line_ending, self.inner)
        } else {
            format!("{outer}  ")
        };
        let inner = if self.line_ending.is_empty() {
            ""
        } else {
            &inner
        };
        let above = frame.comment.map_or_else(String::new, |words| {
            format!("{outer}{}", comment(words, self.line_ending))
        });
        let xyz = decimals(frame.parent_from_frame.translation.vector.as_slice());
        let rpy = decimals(
            rpy_from_rotation(&frame.parent_from_frame.rotation)
                .map(tidy_angle)
                .as_slice(),
        );
        let p = self.prefix;
        format!(
            "{above}{outer}<{p}link name=\"{}\"/>{outer}<{p}joint name=\"{}\" type=\"fixed\">{inner}<{p}parent link=\"{}\"/>\
             {inner}<{p}child link=\"{}\"/>{inner}<{p}origin xyz=\"{xyz}\" rpy=\"{rpy}\"/>{outer}</{p}joint>",
            escaped(frame.link),
            escaped(frame.joint),
            escaped(frame.parent_link),
            escaped(frame.link),
        )
    }
}

/// A comment that is well-formed whatever the words are: no `--`, no control characters.
pub(crate) fn comment(words: &str, line_ending: &str) -> String {
    let mut safe: String = words
        .chars()
        .filter(|c| !c.is_control() || *c == '\n' || *c == '\t')
        .collect();
    while safe.contains("--") {
        safe = safe.replace("--", "- -");
    }
    let line_ending = if line_ending.is_empty() {
        " "
    } else {
        line_ending
    };
    format!("<!-- {} -->", safe.trim().replace('\n', line_ending))
}

fn escaped(name: &str) -> String {
    name.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}

/// A name that every reader gives back as it was written.
pub(crate) fn check_name(kind: &'static str, name: &str) -> Result<(), EditError> {
    let reason = if name.trim().is_empty() {
        "it is empty"
    } else if name.chars().any(char::is_control) {
        "it has control characters"
    } else if name.trim() != name {
        "it begins or ends with a space"
    } else {
        return Ok(());
    };
    Err(EditError::BadName {
        kind,
        name: name.to_owned(),
        reason,
    })
}
