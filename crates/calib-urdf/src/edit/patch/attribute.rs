//! The numbers of one attribute, replaced one by one.

use super::patcher::Patcher;
use crate::edit::change::Change;
use crate::edit::decimal::{Splice, apply, decimals, same_number, splice_numbers};
use crate::edit::error::EditError;
use crate::edit::insert;
use crate::error::{Problem, ReadError, ReadProblem};
use crate::read::numbers::parse_numbers;
use crate::read::source::OwnAttributes as _;
use crate::read::source::value_range;
use crate::xacro;
use crate::xacro::value::Context;
use roxmltree::Node;

/// An attribute of a joint's child element, written or not.
pub(super) struct Site<'j, 'd, 't> {
    pub(super) element: Node<'d, 't>,
    pub(super) joint: &'j str,
    pub(super) name: &'static str,
    /// The call of the macro that gives this joint, where there are several calls.
    pub(super) call: Option<Node<'d, 't>>,
}

impl Site<'_, '_, '_> {
    /// `origin xyz`
    pub(super) fn attribute(&self) -> String {
        format!("{} {}", self.element.tag_name().name(), self.name)
    }
}

impl Patcher<'_, '_> {
    /// Sets the numbers of one attribute; `new` gets the old ones, or `default` where there is no attribute.
    pub(super) fn set_numbers<const N: usize>(
        &mut self,
        site: &Site<'_, '_, '_>,
        default: [f64; N],
        new: impl FnOnce([f64; N]) -> [f64; N],
    ) -> Result<(), EditError> {
        let Site {
            element,
            joint,
            name,
            call,
        } = *site;
        let Some(attribute) = element.own_attribute(name) else {
            let new = new(default);
            if !default
                .iter()
                .zip(&new)
                .all(|(old, new)| same_number(*old, *new))
            {
                if call.is_some() {
                    return Err(self.one_text(site));
                }
                self.insert_attribute(site, &decimals(&new));
            }
            return Ok(());
        };
        let raw = value_range(self.context.text, &attribute);
        let value = &self.context.text[raw.clone()];
        if self.is_xacro && xacro::is_expression(attribute.value()) {
            return self.set_looked_up(site, raw, new);
        }
        let old: [f64; N] = parse_numbers(attribute.value()).map_err(|fault| {
            // A URDF was checked before; a xacro was not.
            let problem = Problem::BadNumber {
                owner: format!("joint `{joint}`"),
                attribute: name.to_owned(),
                found: attribute.value().to_owned(),
                expected: "numbers",
                reason: fault.reason,
            };
            ReadError::one(
                self.file,
                ReadProblem::at(self.context.text, raw.start, problem),
            )
        })?;
        let splices = splice_numbers(value, raw.start, &old, &new(old));
        if splices.is_empty() {
            return Ok(());
        }
        if call.is_some() {
            return Err(self.one_text(site));
        }
        let local: Vec<Splice> = splices
            .iter()
            .map(|splice| Splice {
                range: splice.range.start - raw.start..splice.range.end - raw.start,
                new: splice.new.clone(),
            })
            .collect();
        self.changes.push(Change {
            line: self.place(raw.start).line,
            joint: joint.to_owned(),
            attribute: site.attribute(),
            old: value.to_owned(),
            new: apply(value, &local),
        });
        self.splices.extend(splices);
        Ok(())
    }

    /// A number in the text of a macro that several calls share.
    pub(super) fn one_text(&self, site: &Site<'_, '_, '_>) -> EditError {
        let Context { text, document, .. } = self.context;
        xacro::several_calls(document, text, site.element, site.joint, self.file)
    }

    fn insert_attribute(&mut self, site: &Site<'_, '_, '_>, value: &str) {
        let inserted = insert::attribute(self.context.text, site.element, site.name, value);
        self.insert(inserted, site.joint, site.attribute(), value.to_owned());
    }

    /// Inserts a child element of a joint.
    pub(super) fn insert_element(
        &mut self,
        joint: Node<'_, '_>,
        name: &str,
        element: &str,
        text: String,
    ) {
        let inserted = insert::first_child(self.context.text, joint, &text);
        self.insert(inserted, name, format!("<{element}>"), text);
    }
}
