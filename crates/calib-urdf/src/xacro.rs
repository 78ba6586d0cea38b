//! Joints in a xacro file, as far as their text can be patched without expanding it.
//!
//! A number may be replaced where the text is literal, or one property that nothing else uses, and stands for one joint. It
//! may not where xacro computes the number or the name, where a macro is used more than once, and where branches give several texts.

use crate::edit::EditError;
use crate::error::Place;
use crate::model::UnknownName;
use crate::numbers::{parse_numbers, tokens};
use crate::source::is_element;
use roxmltree::{Document, Node};
use std::ops::Range;

/// Does xacro compute this text?
pub(crate) fn is_expression(value: &str) -> bool {
    value.contains("${") || value.contains("$(")
}

/// The one `<joint>` of a xacro text that gives the joint of that name.
///
/// # Errors
/// Those of [`EditError`] that begin with `Xacro`, or [`EditError::UnknownName`].
pub(crate) fn joint<'a, 'b>(
    document: &'a Document<'b>,
    text: &str,
    name: &str,
    file: &str,
) -> Result<Node<'a, 'b>, EditError> {
    let place = |node: Node<'_, '_>| Place::of_byte(text, node.range().start);
    let joints: Vec<Node<'_, '_>> = document
        .descendants()
        .filter(|node| is_joint(*node))
        .collect();
    let named: Vec<Node<'_, '_>> = joints
        .iter()
        .copied()
        .filter(|node| node.attribute("name") == Some(name))
        .collect();
    match named.as_slice() {
        [] => {
            let template = joints.iter().find(|node| {
                node.attribute("name")
                    .is_some_and(|pattern| matches(pattern, name))
            });
            Err(match template {
                Some(node) => EditError::XacroTemplate {
                    file: file.to_owned(),
                    place: place(*node),
                    joint: name.to_owned(),
                    template: node.attribute("name").unwrap_or("").to_owned(),
                },
                None => EditError::UnknownName {
                    file: file.to_owned(),
                    source: UnknownName::among(
                        document.root_element().attribute("name").unwrap_or(""),
                        "joint",
                        name,
                        joints.iter().filter_map(|node| node.attribute("name")),
                    ),
                },
            })
        }
        [node] => match enclosing_macro(*node) {
            None => Ok(*node),
            Some(definition) => {
                let lines = use_lines(document, definition, text);
                if lines.len() == 1 {
                    return Ok(*node);
                }
                Err(EditError::XacroMacro {
                    file: file.to_owned(),
                    place: place(*node),
                    joint: name.to_owned(),
                    macro_name: definition.attribute("name").unwrap_or("").to_owned(),
                    lines,
                })
            }
        },
        several => Err(EditError::XacroAmbiguous {
            file: file.to_owned(),
            joint: name.to_owned(),
            lines: several.iter().map(|node| place(*node).line).collect(),
        }),
    }
}

/// A robot's joint, and not the `<joint>` of a `<transmission>`, `<gazebo>` or `<ros2_control>`.
fn is_joint(node: Node<'_, '_>) -> bool {
    let foreign = |above: Node<'_, '_>| {
        above.is_element()
            && above.tag_name().name() != "robot"
            && !above
                .tag_name()
                .namespace()
                .is_some_and(|uri| uri.contains("xacro"))
    };
    is_element(node, "joint")
        && node.has_attribute("name")
        && !node.ancestors().skip(1).any(foreign)
}

fn is_xacro(node: Node<'_, '_>, name: &str) -> bool {
    node.tag_name()
        .namespace()
        .is_some_and(|uri| uri.contains("xacro"))
        && node.tag_name().name() == name
}

fn enclosing_macro<'a, 'b>(node: Node<'a, 'b>) -> Option<Node<'a, 'b>> {
    node.ancestors()
        .skip(1)
        .find(|above| is_xacro(*above, "macro"))
}

/// The lines of the uses of a macro, a use inside another macro counting once for each use of that.
fn use_lines(document: &Document<'_>, definition: Node<'_, '_>, text: &str) -> Vec<usize> {
    /// Macros nested deeper than this call themselves, and then the count says "more than once" already.
    const DEEPEST: usize = 16;
    fn collect(
        document: &Document<'_>,
        definition: Node<'_, '_>,
        text: &str,
        depth: usize,
        lines: &mut Vec<usize>,
    ) {
        let Some(name) = definition.attribute("name") else {
            return;
        };
        for call in document.descendants().filter(|node| is_xacro(*node, name)) {
            match enclosing_macro(call) {
                Some(outer) if depth < DEEPEST && outer != definition => {
                    collect(document, outer, text, depth + 1, lines)
                }
                _ => lines.push(Place::of_byte(text, call.range().start).line),
            }
            // Two decide already; a chain of doubling macros would otherwise never end.
            if lines.len() > 8 {
                return;
            }
        }
    }
    let mut lines = Vec::new();
    collect(document, definition, text, 0, &mut lines);
    lines
}

/// One number of an attribute that xacro computes, where it is a literal or just one property: `0 0 ${height}`.
pub(crate) struct Cell<'a> {
    /// Where the number is written: in the attribute, or in the property.
    pub(crate) range: Range<usize>,
    pub(crate) value: f64,
    /// The property's name.
    pub(crate) property: Option<&'a str>,
}

/// The numbers of an attribute at byte `start` of the text; `None` where xacro does more than to look up a property.
pub(crate) fn cells<'a, const N: usize>(
    document: &Document<'_>,
    text: &'a str,
    raw: Range<usize>,
    joint: Node<'_, '_>,
) -> Option<[Cell<'a>; N]> {
    let cells: Option<Vec<Cell<'a>>> = tokens(&text[raw.clone()])
        .map(|(offset, token)| {
            let range = raw.start + offset..raw.start + offset + token.len();
            match token
                .strip_prefix("${")
                .and_then(|rest| rest.strip_suffix('}'))
            {
                None => parse_numbers::<1>(token).ok().map(|[value]| Cell {
                    range,
                    value,
                    property: None,
                }),
                Some(name) => property(document, text, name, joint),
            }
        })
        .collect();
    cells?.try_into().ok()
}

/// The one literal definition of a property, directly under `<robot>`; `None` where another one might count.
fn property<'a>(
    document: &Document<'_>,
    text: &'a str,
    name: &'a str,
    joint: Node<'_, '_>,
) -> Option<Cell<'a>> {
    let is_parameter = enclosing_macro(joint).is_some_and(|definition| {
        let parameters = definition.attribute("params").unwrap_or("");
        words(parameters).any(|word| word == name)
    });
    let mut definitions = document
        .descendants()
        .filter(|node| is_xacro(*node, "property") && node.attribute("name") == Some(name));
    let (definition, none) = (definitions.next()?, definitions.next());
    if is_parameter || none.is_some() || definition.parent() != Some(document.root_element()) {
        return None;
    }
    let attribute = definition.attribute_node("value")?;
    let [value] = parse_numbers(attribute.value()).ok()?;
    let range = attribute.range_value();
    // The number itself, without spaces around it.
    let (offset, token) = tokens(text.get(range.clone())?).next()?;
    let range = range.start + offset..range.start + offset + token.len();
    token.parse::<f64>().is_ok().then_some(Cell {
        range,
        value,
        property: Some(name),
    })
}

/// The lines in which xacro's expressions name a property; included files are not seen.
pub(crate) fn property_lines(document: &Document<'_>, text: &str, name: &str) -> Vec<usize> {
    let named = |value: &str| {
        value
            .split("${")
            .skip(1)
            .flat_map(|rest| words(rest.split('}').next().unwrap_or("")))
            .filter(|word| *word == name)
            .count()
    };
    let mut lines = Vec::new();
    for node in document.descendants() {
        for attribute in node.attributes() {
            let line = Place::of_byte(text, attribute.range().start).line;
            lines.extend(std::iter::repeat_n(line, named(attribute.value())));
        }
        if let Some(words) = node.text().filter(|_| node.is_text()) {
            lines.extend(std::iter::repeat_n(
                Place::of_byte(text, node.range().start).line,
                named(words),
            ));
        }
    }
    lines
}

/// Does the file take text from another one, which may use its properties too?
pub(crate) fn has_includes(document: &Document<'_>) -> bool {
    document.descendants().any(|node| is_xacro(node, "include"))
}

/// The names in an expression.
fn words(expression: &str) -> impl Iterator<Item = &str> {
    expression.split(|c: char| !(c.is_alphanumeric() || c == '_'))
}

/// Could xacro turn `pattern`, such as `${side}_elbow`, into `name`?
fn matches(pattern: &str, name: &str) -> bool {
    if !is_expression(pattern) {
        return false;
    }
    let mut rest = name;
    let mut first = true;
    let mut open = pattern;
    loop {
        let begin = open.find("${").into_iter().chain(open.find("$(")).min();
        let literal = &open[..begin.unwrap_or(open.len())];
        let fits = match (first, begin) {
            (true, _) => rest.strip_prefix(literal),
            (false, None) => rest.ends_with(literal).then_some(""),
            (false, Some(_)) => rest.find(literal).map(|at| &rest[at + literal.len()..]),
        };
        let (Some(left), Some(begin)) = (fits, begin) else {
            return fits.is_some();
        };
        rest = left;
        first = false;
        let Some(close) = open[begin..].find(['}', ')']) else {
            return false;
        };
        open = &open[begin + close + 1..];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patterns() {
        assert!(matches("${side}_elbow", "left_elbow"));
        assert!(matches("$(arg prefix)elbow${i}", "ur_elbow3"));
        assert!(matches("${name}", "anything"));
        assert!(!matches("${side}_elbow", "left_wrist"));
        assert!(!matches("arm_${i}", "leg_1"));
        assert!(!matches("elbow", "elbow"));
        assert!(!matches("${open", "open"));
    }
}
