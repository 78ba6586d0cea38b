//! The name that a file gives to a joint whose name xacro computes.
//!
//! ```text
//! <xacro:macro name="arm" params="side">  <joint name="${side}_elbow" …>
//! <xacro:arm side="left"/>                the joint of this file is `left_elbow`, and no `right_elbow`
//! ```

use crate::read::source::OwnAttributes as _;
use crate::xacro::value::definition;
use crate::xacro::{enclosing_macro, is_expression, is_xacro};
use roxmltree::{Document, Node};

/// Parameters that name each other would be followed forever.
const DEEPEST: usize = 16;

/// A text of an element, such as its name, with everything in its place that the file gives; `None` where more is needed: an argument of
/// the command line, a calculation, a parameter of a macro that is called several times.
pub(crate) fn given(document: &Document<'_>, node: Node<'_, '_>, text: &str) -> Option<String> {
    expanded(document, node, text, 0)
}

fn expanded(
    document: &Document<'_>,
    node: Node<'_, '_>,
    text: &str,
    depth: usize,
) -> Option<String> {
    if depth > DEEPEST {
        return None;
    }
    let (mut name, mut rest) = (String::new(), text);
    while let Some(begin) = rest.find("${") {
        let end = begin + rest[begin..].find('}')?;
        name += &rest[..begin];
        name += &value(document, node, rest[begin + 2..end].trim(), depth + 1)?;
        rest = &rest[end + 1..];
    }
    (!is_expression(rest)).then(|| name + rest)
}

/// What a name means to an element: a parameter of its macro, or a property.
fn value(document: &Document<'_>, node: Node<'_, '_>, name: &str, depth: usize) -> Option<String> {
    let of = enclosing_macro(node);
    let Some((of, parameter)) = of.and_then(|of| Some((of, Parameter::of(of, name)?))) else {
        // A file that this one includes may set the property as well.
        if document.descendants().any(|n| is_xacro(n, "include")) {
            return None;
        }
        let property = definition(document, name)?;
        return expanded(document, property, property.own("value")?, depth);
    };
    let macro_name = of.own("name")?;
    let mut calls = document
        .descendants()
        .filter(|node| is_xacro(*node, macro_name));
    let (call, none) = (calls.next()?, calls.next());
    if none.is_some() || call.ancestors().any(|above| above == of) {
        return None;
    }
    match (call.own(name), parameter.default) {
        (Some(text), _) => expanded(document, call, text, depth),
        (None, Some(text)) if !text.starts_with('^') => {
            expanded(document, document.root_element(), text, depth)
        }
        (None, _) => None,
    }
}

/// One of the `params` of a macro: `name`, `name:=default`.
struct Parameter<'a> {
    default: Option<&'a str>,
}

impl<'a> Parameter<'a> {
    fn of(definition: Node<'a, '_>, name: &str) -> Option<Self> {
        let parameters = definition.own("params")?;
        parameters.split_whitespace().find_map(|word| {
            let parts = word.split_once(":=").or_else(|| word.split_once('='));
            let (found, default) = parts.map_or((word, None), |(n, d)| (n, Some(d)));
            let default = default.map(|d| d.trim_matches(['\'', '"']));
            (found == name).then_some(Self { default })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn name_in(body: &str) -> Option<String> {
        let text = format!("<robot xmlns:xacro=\"http://www.ros.org/wiki/xacro\">{body}</robot>");
        let document = Document::parse(&text).expect("XML");
        let joint = document.descendants().find(|n| n.has_tag_name("joint"));
        let joint = joint.expect("a joint");
        given(&document, joint, joint.own("name").expect("a name"))
    }

    #[test]
    fn what_the_file_gives() {
        let arm = |params: &str, call: &str| {
            name_in(&format!(
                "<xacro:property name=\"s\" value=\"left\"/><xacro:macro name=\"arm\" params=\"{params}\">\
                 <joint name=\"${{side}}_elbow\"/></xacro:macro>{call}"
            ))
        };
        let left = Some("left_elbow".to_owned());
        assert_eq!(arm("side", "<xacro:arm side=\"left\"/>"), left);
        assert_eq!(arm("n side", "<xacro:arm n=\"1\" side=\"${s}\"/>"), left);
        assert_eq!(arm("side:=left n", "<xacro:arm/>"), left);
        assert_eq!(arm("side:='left'", "<xacro:arm/>"), left);
        let nested = "<xacro:macro name=\"two\" params=\"p\"><xacro:arm side=\"${p}\"/></xacro:macro><xacro:two p=\"left\"/>";
        assert_eq!(arm("side", nested), left);
        assert_eq!(
            name_in("<xacro:property name=\"p\" value=\"left_\"/><joint name=\"${p}elbow\"/>"),
            left
        );
    }

    #[test]
    fn what_needs_more_than_the_file() {
        let arm = |params: &str, call: &str| {
            name_in(&format!(
                "<xacro:macro name=\"arm\" params=\"{params}\"><joint name=\"${{side}}_elbow\"/></xacro:macro>{call}"
            ))
        };
        assert_eq!(arm("side", "<xacro:arm side=\"$(arg side)\"/>"), None);
        assert_eq!(arm("side", "<xacro:arm side=\"${'l' + s}\"/>"), None);
        assert_eq!(arm("side:=^", "<xacro:arm/>"), None);
        assert_eq!(
            arm("side", "<xacro:arm side=\"a\"/><xacro:arm side=\"b\"/>"),
            None
        );
        assert_eq!(arm("side", "<xacro:arm/>"), None);
        assert_eq!(arm("side", ""), None);
        assert_eq!(name_in("<joint name=\"$(arg p)elbow\"/>"), None);
        assert_eq!(name_in("<joint name=\"${p}elbow\"/>"), None);
        let set =
            "<xacro:property name=\"p\" value=\"left_\"/><xacro:include filename=\"p.xacro\"/>";
        assert_eq!(
            name_in(&format!("{set}<joint name=\"${{p}}elbow\"/>")),
            None
        );
        let around = "<xacro:property name=\"p\" value=\"${q}\"/><xacro:property name=\"q\" value=\"${p}\"/>";
        assert_eq!(name_in(&format!("{around}<joint name=\"${{p}}\"/>")), None);
    }
}
