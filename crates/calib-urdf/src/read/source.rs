//! From bytes to a parsed XML document, and the few questions that reading and patching both ask of it.

use crate::error::{Problem, ReadError, ReadProblem};
use crate::read::nesting;
use calib_files::input;
use roxmltree::{Attribute, Document, Node, ParsingOptions};
use std::path::Path;

/// Robots with hundreds of links stay under 1 MB; this is a recording or a mesh given by mistake.
pub const MAX_BYTES: u64 = 64 << 20;

/// The text of a URDF's bytes, byte-order mark included.
///
/// # Errors
/// [`Problem::Empty`], [`Problem::TooLarge`], [`Problem::Utf16`], [`Problem::NotUtf8`].
pub fn decode<'a>(bytes: &'a [u8], name_for_errors: &str) -> Result<&'a str, ReadError> {
    let whole_file = |problem| {
        Err(ReadError::one(
            name_for_errors,
            ReadProblem::of_file(problem),
        ))
    };
    if bytes.len() as u64 > MAX_BYTES {
        return whole_file(Problem::TooLarge {
            bytes: bytes.len() as u64,
            limit: MAX_BYTES,
        });
    }
    if bytes.starts_with(&[0xff, 0xfe]) || bytes.starts_with(&[0xfe, 0xff]) {
        return whole_file(Problem::Utf16);
    }
    match std::str::from_utf8(bytes) {
        Ok(text) => Ok(text),
        Err(error) => {
            let offset = error.valid_up_to();
            // The valid part before the offending byte shows the line.
            let valid = std::str::from_utf8(&bytes[..offset]).unwrap_or("");
            let problem = Problem::NotUtf8 {
                offset,
                byte: bytes[offset],
            };
            Err(ReadError::one(
                name_for_errors,
                ReadProblem::at(valid, offset, problem),
            ))
        }
    }
}

/// Reads a URDF's text from a file; the bytes are kept as they are.
///
/// # Errors
/// [`Problem::Unreadable`] and those of [`decode`]. `name_for_errors` stands in the messages.
pub fn read_text(path: &Path, name_for_errors: &str) -> Result<String, ReadError> {
    let whole_file = |problem| ReadError::one(name_for_errors, ReadProblem::of_file(problem));
    let unreadable = |error: std::io::Error| {
        whole_file(match error.kind() {
            std::io::ErrorKind::IsADirectory => Problem::Folder,
            _ => Problem::Unreadable {
                reason: error.to_string(),
            },
        })
    };
    let bytes = input::read(path, MAX_BYTES).map_err(|error| {
        if error.kind() != std::io::ErrorKind::FileTooLarge {
            return unreadable(error);
        }
        let size = std::fs::metadata(path).map_or(MAX_BYTES + 1, |m| m.len());
        whole_file(Problem::TooLarge {
            bytes: size,
            limit: MAX_BYTES,
        })
    })?;
    decode(&bytes, name_for_errors).map(str::to_owned)
}

/// The XML document of a URDF or xacro text, whose root is `<robot>`.
///
/// # Errors
/// [`Problem::Empty`], [`Problem::TooLarge`], [`Problem::TooDeep`], [`Problem::Dtd`], [`Problem::Xml`],
/// [`Problem::NotARobot`].
pub fn parse<'a>(text: &'a str, name_for_errors: &str) -> Result<Document<'a>, ReadError> {
    let whole_file = |problem| ReadError::one(name_for_errors, ReadProblem::of_file(problem));
    if text.len() as u64 > MAX_BYTES {
        return Err(whole_file(Problem::TooLarge {
            bytes: text.len() as u64,
            limit: MAX_BYTES,
        }));
    }
    if text.trim_start_matches('\u{feff}').trim().is_empty() {
        return Err(whole_file(Problem::Empty));
    }
    // Before any parser: none of those that read the text later bounds its depth or its entities.
    if let Err((offset, problem)) = nesting::check(text) {
        return Err(ReadError::one(
            name_for_errors,
            ReadProblem::at(text, offset, problem),
        ));
    }
    let options = ParsingOptions {
        nodes_limit: 10_000_000,
        ..ParsingOptions::default()
    };
    let document = Document::parse_with_options(text, options).map_err(|error| {
        let offset = xml_error_offset(text, &error);
        let problem = Problem::Xml {
            reason: xml_reason(&error),
        };
        ReadError::one(name_for_errors, ReadProblem::at(text, offset, problem))
    })?;
    let root = document.root_element();
    if root.tag_name().name() != "robot" {
        let problem = Problem::NotARobot {
            found: root.tag_name().name().to_owned(),
        };
        let offset = root.range().start;
        return Err(ReadError::one(
            name_for_errors,
            ReadProblem::at(text, offset, problem),
        ));
    }
    Ok(document)
}

/// The byte that the parser stopped at; where it names none, the end of the text.
fn xml_error_offset(text: &str, error: &roxmltree::Error) -> usize {
    use roxmltree::Error::{UnclosedRootNode, UnexpectedEndOfStream};
    if matches!(error, UnclosedRootNode | UnexpectedEndOfStream) {
        return text.trim_end().len();
    }
    let at = error.pos();
    let line_start = text
        .split_inclusive('\n')
        .take(at.row as usize - 1)
        .map(str::len)
        .sum::<usize>();
    let line = text.get(line_start..).unwrap_or("");
    let in_line = line
        .char_indices()
        .nth((at.col as usize).saturating_sub(1))
        .map_or(line.len(), |(i, _)| i);
    (line_start + in_line).min(text.len())
}

/// The parser's message without its own " at 3:7", which the place already says.
fn xml_reason(error: &roxmltree::Error) -> String {
    match error {
        roxmltree::Error::UnclosedRootNode => "the file ends before </robot>".to_owned(),
        roxmltree::Error::UnknownNamespace(prefix, _) if prefix == "xacro" => {
            "the prefix `xacro` is used, but <robot> does not declare xmlns:xacro=\"http://www.ros.org/wiki/xacro\"".to_owned()
        }
        _ => error.to_string().replace(&format!(" at {}", error.pos()), ""),
    }
}

/// The attributes of an element without a prefix: those with one belong to somebody else, whatever they are called.
pub(crate) trait OwnAttributes<'a, 'b: 'a> {
    /// The attribute of that name.
    fn own_attribute(&self, name: &str) -> Option<Attribute<'a, 'b>>;

    /// Its value.
    fn own(&self, name: &str) -> Option<&'a str> {
        self.own_attribute(name).map(|attribute| attribute.value())
    }

    /// Whether it is there.
    fn has_own(&self, name: &str) -> bool {
        self.own_attribute(name).is_some()
    }
}

impl<'a, 'b: 'a> OwnAttributes<'a, 'b> for Node<'a, 'b> {
    fn own_attribute(&self, name: &str) -> Option<Attribute<'a, 'b>> {
        let own = |a: &Attribute<'_, '_>| a.namespace().is_none() && a.name() == name;
        self.attributes().find(own)
    }
}

/// Is this an element of the URDF itself (and not of a foreign namespace) with that name?
pub(crate) fn is_element(node: Node<'_, '_>, name: &str) -> bool {
    node.is_element()
        && node.tag_name().name() == name
        && node.tag_name().namespace() == node.document().root_element().tag_name().namespace()
}

/// The first child element with that name.
pub(crate) fn child<'a, 'b>(node: Node<'a, 'b>, name: &str) -> Option<Node<'a, 'b>> {
    node.children().find(|child| is_element(*child, name))
}

/// The elements of that name directly under `<robot>`: not the `<joint>` of a `<transmission>`.
pub(crate) fn top_level<'a, 'b: 'a>(
    document: &'a Document<'b>,
    name: &'a str,
) -> impl Iterator<Item = Node<'a, 'b>> {
    document
        .root_element()
        .children()
        .filter(move |node| is_element(*node, name))
}

/// Where the text of an attribute's value begins.
pub(crate) fn value_start(attribute: &Attribute<'_, '_>) -> usize {
    attribute.range_value().start
}

/// Does URDF version ≥ 1.1 apply, in which `<origin>` may have a `quat_xyzw`? (Before, it is ignored.)
pub(crate) fn has_quaternions(document: &Document<'_>) -> bool {
    let version = document
        .root_element()
        .own("version")
        .unwrap_or("1.0")
        .trim();
    let mut parts = version.split('.').map(str::parse::<u32>);
    matches!((parts.next(), parts.next()), (Some(Ok(major)), Some(Ok(minor))) if (major, minor) >= (1, 1))
}

/// What shows that a text is a xacro and not a URDF, with the byte offset of it.
///
/// A URDF that xacro wrote may still declare the namespace and mention `${…}` in its comments: neither counts.
pub(crate) fn xacro_evidence(document: &Document<'_>) -> Option<(usize, String)> {
    for node in document.descendants().filter(Node::is_element) {
        let tag = node.tag_name();
        if tag.namespace().is_some_and(|uri| uri.contains("xacro")) {
            return Some((
                node.range().start,
                format!("it contains <xacro:{}>", tag.name()),
            ));
        }
    }
    for kind in ["link", "joint"] {
        for element in top_level(document, kind) {
            for node in element.descendants().filter(Node::is_element) {
                if let Some(attribute) = node.attributes().find(|a| a.value().contains("${")) {
                    return Some((
                        value_start(&attribute),
                        format!("it contains \"{}\"", attribute.value()),
                    ));
                }
            }
        }
    }
    None
}

/// The bytes between an attribute's quotes, found in the text itself (the parser's own range fails after 255 spaces).
pub(crate) fn value_range(text: &str, attribute: &Attribute<'_, '_>) -> std::ops::Range<usize> {
    let whole = attribute.range();
    let end = whole.end - 1;
    let start = text[whole.clone()].find('=').and_then(|equals| {
        text[whole.start + equals..end]
            .find(['"', '\''])
            .map(|quote| whole.start + equals + quote + 1)
    });
    start.unwrap_or(end)..end
}
