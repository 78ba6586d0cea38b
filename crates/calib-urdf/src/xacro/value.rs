//! Where the numbers of a xacro's attribute are written, and who else reads them.
//!
//! ```text
//! xyz="0 0 0.3"                                     in the attribute itself
//! xyz="0 0 ${height}"                               in <xacro:property name="height" value="0.3"/>
//! rpy="${pi/2} 0 0"                                 in the attribute: the constant is replaced as a whole
//! xyz="${c['elbow']['x']} 0 0"                      in the YAML that c = xacro.load_yaml(…) names
//! ```
//!
//! A look-up may pass through several properties. A value that something else reads too is not replaced.

use crate::edit::error::EditError;
use crate::error::Place;
use crate::read::numbers::parse_numbers;
use crate::read::source::OwnAttributes as _;
use crate::read::source::value_range;
use crate::xacro::companions::{Companions, loaded, unseen};
use crate::xacro::expression::{
    Access, Root, constant, expressions, look_ups, whole, words as value_words,
};
use crate::xacro::{enclosing_macro, is_xacro, mentions, parameter, words};
use crate::yaml::{YamlKind, YamlNode};
use roxmltree::{Document, Node};
use std::ops::Range;

/// A xacro's text with everything that is needed to follow its look-ups.
pub(crate) struct Context<'t, 'd> {
    pub(crate) text: &'t str,
    pub(crate) document: &'d Document<'t>,
    pub(crate) companions: &'d Companions,
    /// Trees of `companions.yaml`, in their order, or why there is none.
    pub(crate) yaml: &'d [Result<YamlNode, EditError>],
}

/// One number of an attribute.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Cell {
    /// Index of the YAML in the companions; `None` in the xacro itself.
    pub(crate) yaml: Option<usize>,
    /// Its bytes there.
    pub(crate) range: Range<usize>,
    pub(crate) value: f64,
    /// Where it comes from, when it is not written in the attribute.
    pub(crate) from: Option<Leaf>,
}

/// A value that expressions read.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Leaf {
    base: Base,
    keys: Vec<String>,
    /// Properties that the look-up passed through.
    chain: Vec<String>,
}

#[derive(Debug, Clone, PartialEq, Eq)]
enum Base {
    Property(String),
    Yaml(usize),
    /// YAML that was not found.
    Missing(String),
}

impl Leaf {
    /// `property reach`, or `arm.yaml elbow.x`.
    pub(crate) fn name(&self, companions: &Companions) -> String {
        match &self.base {
            Base::Property(name) => format!("property {name}"),
            Base::Yaml(file) => {
                let name = companions.yaml.get(*file).map_or("", |c| c.name.as_str());
                format!("{name} {}", self.keys.join("."))
            }
            Base::Missing(argument) => argument.clone(),
        }
    }

    /// Its name alone, for a message that says what it is.
    pub(crate) fn bare_name(&self) -> String {
        match &self.base {
            Base::Property(name) => name.clone(),
            Base::Yaml(_) | Base::Missing(_) => self.keys.join("."),
        }
    }
}

/// Why an attribute's numbers cannot be replaced.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Unwritable {
    /// xacro does more than to look up a value.
    Computed,
    /// A parameter that the macro uses more than once.
    SharedParameter { name: String, lines: Vec<usize> },
    /// A parameter that the call at this byte leaves at its default.
    NotGiven { name: String, call: usize },
    /// The YAML was not found.
    NotFound(String),
    /// The YAML cannot be read.
    NoYaml(Box<EditError>),
    /// The YAML has no such key, or something else than a plain number there.
    BadYaml {
        file: usize,
        offset: usize,
        keys: String,
        fault: &'static str,
    },
}

/// The N numbers of an attribute whose value is at these bytes; those of a macro's parameter are in the `call`, where one is known.
pub(crate) fn cells<const N: usize>(
    context: &Context<'_, '_>,
    raw: Range<usize>,
    joint: Node<'_, '_>,
    call: Option<Node<'_, '_>>,
) -> Result<[Cell; N], Unwritable> {
    let mut found = Vec::new();
    for (offset, word) in value_words(&context.text[raw.clone()]) {
        let range = raw.start + offset..raw.start + offset + word.len();
        if let Some(value) = number(word) {
            found.push(Cell {
                yaml: None,
                range,
                value,
                from: None,
            });
            continue;
        }
        let definition = call.and_then(|_| enclosing_macro(joint));
        let named = definition.and_then(|of| Some((of, parameter(word, of)?)));
        if let (Some(call), Some((definition, name))) = (call, named) {
            let lines = mentions(context.text, definition, name);
            if lines.len() > 1 {
                let name = name.to_owned();
                return Err(Unwritable::SharedParameter { name, lines });
            }
            found.extend(of_call(context, call, name)?);
            continue;
        }
        let access = whole(word).and_then(Access::parse);
        let access = access.ok_or(Unwritable::Computed)?;
        found.extend(follow_to_numbers(context, &access, joint)?);
    }
    found.try_into().map_err(|_| Unwritable::Computed)
}

/// The numbers that a call gives a parameter.
fn of_call(
    context: &Context<'_, '_>,
    call: Node<'_, '_>,
    name: &str,
) -> Result<Vec<Cell>, Unwritable> {
    let attribute = call.own_attribute(name).ok_or(Unwritable::NotGiven {
        name: name.to_owned(),
        call: call.range().start,
    })?;
    let range = value_range(context.text, &attribute);
    let mut cells = Vec::new();
    for (offset, word) in value_words(&context.text[range.clone()]) {
        cells.push(Cell {
            yaml: None,
            range: range.start + offset..range.start + offset + word.len(),
            value: number(word).ok_or(Unwritable::Computed)?,
            from: None,
        });
    }
    Ok(cells)
}

/// A literal or constant number.
fn number(word: &str) -> Option<f64> {
    match whole(word) {
        Some(expression) => constant(expression),
        None => parse_numbers::<1>(word).ok().map(|[value]| value),
    }
}

fn follow_to_numbers(
    context: &Context<'_, '_>,
    access: &Access,
    joint: Node<'_, '_>,
) -> Result<Vec<Cell>, Unwritable> {
    // A parameter of the macro hides the property of that name.
    if let (Root::Name(name), Some(definition)) = (&access.root, enclosing_macro(joint)) {
        let parameters = definition.own("params").unwrap_or("");
        if words(parameters).any(|word| word == name) {
            return Err(Unwritable::Computed);
        }
    }
    let leaf = follow(context, access);
    let (yaml, range) = match &leaf.base {
        Base::Missing(argument) => return Err(Unwritable::NotFound(argument.clone())),
        Base::Yaml(file) => (Some(*file), yaml_value(context, *file, &leaf.keys)?),
        Base::Property(name) => {
            let definition = definition(context.document, name)
                .filter(|_| leaf.keys.is_empty())
                .ok_or(Unwritable::Computed)?;
            let attribute = definition
                .own_attribute("value")
                .ok_or(Unwritable::Computed)?;
            (None, value_range(context.text, &attribute))
        }
    };
    let text = match yaml {
        None => context.text,
        Some(file) => &context.companions.yaml[file].text,
    };
    let mut cells = Vec::new();
    for (offset, word) in value_words(&text[range.clone()]) {
        let value = number(word).ok_or(Unwritable::Computed)?;
        cells.push(Cell {
            yaml,
            range: range.start + offset..range.start + offset + word.len(),
            value,
            from: Some(leaf.clone()),
        });
    }
    Ok(cells)
}

/// The bytes of a plain scalar below these keys.
fn yaml_value(
    context: &Context<'_, '_>,
    file: usize,
    keys: &[String],
) -> Result<Range<usize>, Unwritable> {
    let bad = |offset: usize, fault: &'static str| Unwritable::BadYaml {
        file,
        offset,
        keys: keys.join("."),
        fault,
    };
    let tree = context.yaml.get(file).ok_or(Unwritable::Computed)?;
    let mut node = tree
        .as_ref()
        .map_err(|e| Unwritable::NoYaml(Box::new(e.clone())))?;
    for key in keys {
        let (value, times) = node.get(key);
        let value = value.ok_or_else(|| bad(node.range.start, "there is no such key"))?;
        if times > 1 {
            return Err(bad(value.range.start, "the key stands there twice"));
        }
        if value.anchored || value.kind == YamlKind::Alias {
            return Err(bad(
                value.range.start,
                "the value has an anchor, so that other keys share it",
            ));
        }
        node = value;
    }
    match &node.kind {
        YamlKind::Scalar { plain: true, .. } => Ok(node.range.clone()),
        YamlKind::Scalar { .. } => Err(bad(
            node.range.start,
            "the value has quotes, a tag or a block style",
        )),
        _ => Err(bad(node.range.start, "the value is not a number")),
    }
}

/// The one definition of a property, directly under `<robot>`; `None` where another one might count.
pub(crate) fn definition<'a, 'b>(document: &'a Document<'b>, name: &str) -> Option<Node<'a, 'b>> {
    let mut definitions = document
        .descendants()
        .filter(|node| is_xacro(*node, "property") && node.own("name") == Some(name));
    let (definition, none) = (definitions.next()?, definitions.next());
    (none.is_none() && definition.parent() == Some(document.root_element())).then_some(definition)
}

/// Where a look-up ends: passes through properties whose whole value is a look-up.
fn follow(context: &Context<'_, '_>, access: &Access) -> Leaf {
    /// Properties that name each other would be followed forever.
    const DEEPEST: usize = 8;
    let mut access = access.clone();
    let mut chain = Vec::new();
    loop {
        let name = match &access.root {
            Root::Load(argument) => {
                let argument = loaded(context.document, argument);
                let file = context
                    .companions
                    .yaml
                    .iter()
                    .position(|c| c.argument == argument);
                return Leaf {
                    base: file.map_or(Base::Missing(argument), Base::Yaml),
                    keys: access.keys,
                    chain,
                };
            }
            Root::Name(name) => name.clone(),
        };
        let inner = definition(context.document, &name)
            .and_then(|node| node.own("value"))
            .and_then(whole)
            .filter(|inner| constant(inner).is_none())
            .and_then(Access::parse);
        chain.push(name.clone());
        match inner {
            Some(mut inner) if chain.len() < DEEPEST => {
                inner.keys.append(&mut access.keys);
                access = inner;
            }
            _ => {
                return Leaf {
                    base: Base::Property(name),
                    keys: access.keys,
                    chain,
                };
            }
        }
    }
}

/// Who reads a value: lines of this file, names of included files.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(crate) struct Readers {
    pub(crate) lines: Vec<usize>,
    pub(crate) included: Vec<String>,
    /// Files that nobody has seen are included.
    pub(crate) unseen: bool,
}

impl Readers {
    /// Is the value this attribute's alone?
    pub(crate) fn is_one(&self) -> bool {
        self.lines.len() == 1 && self.included.is_empty() && !self.unseen
    }
}

/// Every reader of a value, as far as the files around are known.
pub(crate) fn readers(context: &Context<'_, '_>, leaf: &Leaf) -> Readers {
    let mut lines = Vec::new();
    for node in context.document.descendants() {
        for attribute in node.attributes() {
            let alias = is_xacro(node, "property")
                && attribute.name() == "value"
                && whole(attribute.value()).is_some_and(|e| Access::parse(e).is_some())
                && node
                    .own("name")
                    .is_some_and(|name| definition(context.document, name) == Some(node));
            if alias {
                // Its own readers are counted where they are.
                continue;
            }
            let line = Place::of_byte(context.text, attribute.range().start).line;
            for expression in expressions(attribute.value()) {
                lines.extend(std::iter::repeat_n(line, reads(context, expression, leaf)));
            }
        }
        if let Some(text) = node.text().filter(|_| node.is_text()) {
            let line = Place::of_byte(context.text, node.range().start).line;
            for expression in expressions(text) {
                lines.extend(std::iter::repeat_n(line, reads(context, expression, leaf)));
            }
        }
    }
    let included = context.companions.included.iter().filter(|file| {
        let loads = match leaf.base {
            Base::Yaml(yaml) => crate::xacro::companions::references(&file.text, &file.name)
                .is_ok_and(|found| {
                    found
                        .iter()
                        .any(|r| r.argument == context.companions.yaml[yaml].argument)
                }),
            _ => false,
        };
        loads
            || expressions(&file.text)
                .flat_map(words)
                .any(|word| leaf.chain.iter().any(|name| name == word))
    });
    Readers {
        lines,
        included: included.map(|file| file.name.clone()).collect(),
        unseen: unseen(context.document, context.companions),
    }
}

/// How often an expression reads a value: a look-up of it or of what holds it, or any mention where it computes.
fn reads(context: &Context<'_, '_>, expression: &str, leaf: &Leaf) -> usize {
    let covers = |found: &Leaf| {
        found.base == leaf.base
            && found
                .keys
                .iter()
                .zip(&leaf.keys)
                .all(|(found, wanted)| found == wanted)
    };
    if let Some(access) = Access::parse(expression) {
        return usize::from(covers(&follow(context, &access)));
    }
    let loads = matches!(leaf.base, Base::Yaml(_)) && expression.contains("load_yaml");
    let named = look_ups(expression)
        .iter()
        .filter(|access| covers(&follow(context, access)))
        .count();
    named + usize::from(loads)
}
