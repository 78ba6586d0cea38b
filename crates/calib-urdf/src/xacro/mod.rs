//! Joints in a xacro file, as far as their text can be patched without expanding it.
//!
//! A number may be replaced where the text is literal, a constant, or one property or YAML value that nothing else uses
//! (see `xacro_value`), and stands for one joint. It may not where xacro computes it, where a macro is used more than
//! once, and where branches give several texts.

mod call;
pub mod companions;
mod expression;
mod named;
pub mod origins;
pub(crate) mod value;

pub(crate) use call::{Block, block, called, mentions, parameter};

use crate::edit::error::EditError;
use crate::error::Place;
use crate::model::UnknownName;
use crate::read::source::OwnAttributes as _;
use crate::read::source::is_element;
use roxmltree::{Document, Node};

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
        .filter(|node| node.own("name") == Some(name))
        .collect();
    let templates: Vec<Node<'_, '_>> = joints
        .iter()
        .copied()
        .filter(|node| {
            node.own("name")
                .is_some_and(|pattern| matches(pattern, name))
        })
        .collect();
    match named.as_slice() {
        [] if templates.len() == 1 => {
            // One text for a joint whose name xacro computes: it is this joint's if it is used once.
            let node = templates[0];
            used_once(document, text, node, name, file)?;
            if enclosing_macro(node).is_none() && !has_fixed_part(node) {
                return Err(template(file, place(node), name, node));
            }
            let written = node.own("name").unwrap_or("");
            match named::given(document, node, written) {
                Some(named) if named != name => Err(EditError::XacroNamed {
                    file: file.to_owned(),
                    place: place(node),
                    joint: name.to_owned(),
                    template: written.to_owned(),
                    named,
                }),
                _ => Ok(node),
            }
        }
        [] => Err(match templates.first() {
            Some(node) => template(file, place(*node), name, *node),
            None => EditError::UnknownName {
                file: file.to_owned(),
                source: UnknownName::among(
                    document.root_element().own("name").unwrap_or(""),
                    "joint",
                    name,
                    joints.iter().filter_map(|node| node.own("name")),
                ),
            },
        }),
        [node] => {
            used_once(document, text, *node, name, file)?;
            Ok(*node)
        }
        several => Err(EditError::XacroAmbiguous {
            file: file.to_owned(),
            joint: name.to_owned(),
            lines: several.iter().map(|node| place(*node).line).collect(),
        }),
    }
}

/// Refuses a joint of a macro that is not used exactly once: one text would be several joints.
fn used_once(
    document: &Document<'_>,
    text: &str,
    node: Node<'_, '_>,
    joint: &str,
    file: &str,
) -> Result<(), EditError> {
    let Some(definition) = enclosing_macro(node) else {
        return Ok(());
    };
    let lines = use_lines(document, definition, text);
    if lines.len() == 1 {
        return Ok(());
    }
    Err(several_calls(document, text, node, joint, file))
}

/// The refusal of an element of a macro whose one text would be several joints.
pub(crate) fn several_calls(
    document: &Document<'_>,
    text: &str,
    node: Node<'_, '_>,
    joint: &str,
    file: &str,
) -> EditError {
    let definition = enclosing_macro(node);
    let lines = definition.map_or_else(Vec::new, |of| use_lines(document, of, text));
    EditError::XacroMacro {
        file: file.to_owned(),
        place: Place::of_byte(text, node.range().start),
        joint: joint.to_owned(),
        macro_name: definition
            .and_then(|of| of.own("name"))
            .unwrap_or("")
            .to_owned(),
        lines,
    }
}

fn template(file: &str, place: Place, joint: &str, node: Node<'_, '_>) -> EditError {
    EditError::XacroTemplate {
        file: file.to_owned(),
        place,
        joint: joint.to_owned(),
        template: node.own("name").unwrap_or("").to_owned(),
    }
}

/// Does the joint's name say more than `${…}`? A name that is computed as a whole fits every joint.
fn has_fixed_part(node: Node<'_, '_>) -> bool {
    let name = node.own("name").unwrap_or("");
    !(name.starts_with('$') && name.ends_with(['}', ')']) && name.matches('$').count() == 1)
}

/// A robot's joint, and not the `<joint>` of a `<transmission>`, `<gazebo>` or `<ros2_control>`.
pub(crate) fn is_joint(node: Node<'_, '_>) -> bool {
    let foreign = |above: Node<'_, '_>| {
        above.is_element()
            && above.tag_name().name() != "robot"
            && !above
                .tag_name()
                .namespace()
                .is_some_and(|uri| uri.contains("xacro"))
    };
    is_element(node, "joint") && node.has_own("name") && !node.ancestors().skip(1).any(foreign)
}

/// Is this xacro's own element of that name?
pub(crate) fn is_xacro(node: Node<'_, '_>, name: &str) -> bool {
    node.tag_name()
        .namespace()
        .is_some_and(|uri| uri.contains("xacro"))
        && node.tag_name().name() == name
}

/// An element of xacro inside a joint that may give its origin: a branch with one, a block, a call.
pub(crate) fn gives_origin<'a, 'b>(joint: Node<'a, 'b>) -> Option<Node<'a, 'b>> {
    let by_xacro = |node: &Node<'_, '_>| {
        let uri = node.tag_name().namespace();
        node.is_element() && uri.is_some_and(|uri| uri.contains("xacro"))
    };
    joint.children().filter(by_xacro).find(|node| {
        let origins = || {
            node.descendants()
                .any(|inside| is_element(inside, "origin"))
        };
        match node.tag_name().name() {
            "property" => false,
            "if" | "unless" => {
                origins() || node.descendants().skip(1).any(|inside| by_xacro(&inside))
            }
            _ => true,
        }
    })
}

pub(crate) fn enclosing_macro<'a, 'b>(node: Node<'a, 'b>) -> Option<Node<'a, 'b>> {
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
        let Some(name) = definition.own("name") else {
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

/// The names in an expression.
pub(crate) fn words(expression: &str) -> impl Iterator<Item = &str> {
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
