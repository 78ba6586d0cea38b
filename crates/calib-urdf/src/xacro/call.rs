//! A joint of a macro that is called several times: the one call that gives it, by the name that the call's parameters make.
//!
//! ```text
//! <xacro:macro name="axis" params="name xyz rpy">  <joint name="${name}" …> <origin xyz="${xyz}" rpy="${rpy}"/> …
//! <xacro:axis name="elbow" xyz="0.3 0 0" rpy="0 0 0"/>          the numbers of `elbow` stand here
//! ```

use crate::error::Place;
use crate::read::source::{OwnAttributes as _, is_element};
use crate::xacro::expression::{expressions, whole};
use crate::xacro::{enclosing_macro, is_expression, is_joint, is_xacro, words};
use roxmltree::{Document, Node};

/// The joint's element in its macro and the one call that gives it this name; `None` where no call or several do, or where xacro computes
/// the name of a call that might.
pub(crate) fn called<'a, 'b>(
    document: &'a Document<'b>,
    name: &str,
) -> Option<(Node<'a, 'b>, Node<'a, 'b>)> {
    let mut found = Vec::new();
    for joint in document.descendants().filter(|node| is_joint(*node)) {
        let pattern = joint.own("name")?;
        let Some(definition) = enclosing_macro(joint) else {
            if pattern == name || is_expression(pattern) {
                return None;
            }
            continue;
        };
        let macro_name = definition.own("name")?;
        let calls = document.descendants();
        for call in calls.filter(|node| is_xacro(*node, macro_name)) {
            if enclosing_macro(call).is_some() {
                return None;
            }
            if with_parameters(pattern, call)? == name {
                found.push((joint, call));
            }
        }
    }
    match found.as_slice() {
        [only] => Some(*only),
        _ => None,
    }
}

/// A name with the parameters of a call in their places; `None` where it needs more than literal parameters.
fn with_parameters(pattern: &str, call: Node<'_, '_>) -> Option<String> {
    let (mut name, mut rest) = (String::new(), pattern);
    while let Some(begin) = rest.find("${") {
        let end = begin + rest[begin..].find('}')?;
        let value = call.own(rest[begin + 2..end].trim())?;
        if is_expression(value) {
            return None;
        }
        name += &rest[..begin];
        name += value;
        rest = &rest[end + 1..];
    }
    (!is_expression(rest)).then(|| name + rest)
}

/// What a block parameter of a macro puts into a joint.
pub(crate) enum Block<'a, 'b> {
    /// There is none.
    None,
    /// This `<origin>`, an element of the call.
    Origin(Node<'a, 'b>),
    /// Something that the text does not show.
    Hidden(Node<'a, 'b>),
}

/// The block that is inserted into a joint without an `<origin>` of its own.
///
/// ```text
/// <xacro:macro name="axis" params="name *place">  <joint name="${name}" …> <xacro:insert_block name="place"/> …
/// <xacro:axis name="elbow">  <origin xyz="0.3 0 0"/>  </xacro:axis>
/// ```
pub(crate) fn block<'a, 'b>(
    document: &'a Document<'b>,
    joint: Node<'a, 'b>,
    call: Option<Node<'a, 'b>>,
) -> Block<'a, 'b> {
    let mut hidden = None;
    let inserts = joint.descendants();
    for insert in inserts.filter(|node| is_xacro(*node, "insert_block")) {
        match inserted(document, (joint, insert), call) {
            Some(Inserted::Origin(origin)) => return Block::Origin(origin),
            Some(Inserted::Other) => {}
            None => hidden = hidden.or(Some(insert)),
        }
    }
    hidden.map_or(Block::None, Block::Hidden)
}

/// What stands in the place of an `insert_block`.
enum Inserted<'a, 'b> {
    /// This `<origin>`, which no other place inserts.
    Origin(Node<'a, 'b>),
    /// Elements that are no origin.
    Other,
}

/// An element of xacro's own: what it becomes does not stand in the text.
fn is_computed(node: Node<'_, '_>) -> bool {
    node.is_element() && node.tag_name().namespace().is_some()
}

/// What a joint's `insert_block` inserts; `None` where the text does not show it.
fn inserted<'a, 'b>(
    document: &'a Document<'b>,
    (joint, insert): (Node<'a, 'b>, Node<'a, 'b>),
    call: Option<Node<'a, 'b>>,
) -> Option<Inserted<'a, 'b>> {
    let name = insert.own("name")?;
    let origin = |node: &Node<'_, '_>| is_element(*node, "origin");
    let definition = enclosing_macro(joint);
    let parameters = definition.and_then(|d| d.own("params")).unwrap_or("");
    let mut blocks = parameters.split_whitespace().filter(|w| w.starts_with('*'));
    // The n-th block of the parameters is the n-th element of the call; of `**name`, its children are inserted.
    let Some(place) = blocks.position(|word| word.trim_start_matches('*') == name) else {
        let mut properties = document.descendants();
        let property =
            properties.find(|n| is_xacro(*n, "property") && n.own("name") == Some(name))?;
        let plain = |node: Node<'_, '_>| !origin(&node) && !is_computed(node);
        return property.children().all(plain).then_some(Inserted::Other);
    };
    let definition = definition?;
    let macro_name = definition.own("name")?;
    let calls = document.descendants();
    let calls: Vec<_> = calls.filter(|node| is_xacro(*node, macro_name)).collect();
    let call = match (call, calls.as_slice()) {
        (Some(call), _) => call,
        (None, [only]) => *only,
        _ => return None,
    };
    if enclosing_macro(call).is_some() {
        return None;
    }
    let element = call.children().filter(Node::is_element).nth(place)?;
    let children = parameters
        .split_whitespace()
        .any(|word| word.strip_prefix("**") == Some(name));
    let mut elements = match children {
        true => element.children().filter(Node::is_element).collect(),
        false => vec![element],
    };
    elements.retain(|node| origin(node) || is_computed(*node));
    let found = match elements.as_slice() {
        [] => return Some(Inserted::Other),
        [only] if origin(only) => *only,
        _ => return None,
    };
    let inserts = definition
        .descendants()
        .filter(|node| is_xacro(*node, "insert_block") && node.own("name") == Some(name));
    (inserts.count() == 1).then_some(Inserted::Origin(found))
}

/// The parameter of a macro that a word of an attribute consists of.
pub(crate) fn parameter<'w>(word: &'w str, definition: Node<'_, '_>) -> Option<&'w str> {
    let name = whole(word)?.trim();
    let parameters = definition.own("params").unwrap_or("");
    words(parameters).any(|word| word == name).then_some(name)
}

/// The lines of the expressions of a macro's body that mention a parameter.
pub(crate) fn mentions(text: &str, definition: Node<'_, '_>, parameter: &str) -> Vec<usize> {
    let mut lines = Vec::new();
    for node in definition.descendants() {
        let attributes = node.attributes().map(|a| (a.value(), a.range().start));
        let own = node.text().filter(|_| node.is_text());
        let own = own.map(|own| (own, node.range().start));
        for (value, at) in attributes.chain(own) {
            let of = expressions(value).filter(|e| words(e).any(|word| word == parameter));
            lines.extend(of.map(|_| Place::of_byte(text, at).line));
        }
    }
    lines
}
