//! The state of one patch: the text with what is known about it, and the changes so far.

use crate::edit::change::Change;
use crate::edit::decimal::Splice;
use crate::edit::error::EditError;
use crate::error::Place;
use crate::model::UnknownName;
use crate::read::source::OwnAttributes as _;
use crate::read::source::top_level;
use crate::xacro;
use crate::xacro::value::Context;
use nalgebra::Isometry3;
use roxmltree::Node;
use std::collections::BTreeMap;

/// A text that is being patched.
pub(super) struct Patcher<'t, 'd> {
    pub(super) file: &'t str,
    pub(super) context: Context<'t, 'd>,
    pub(super) is_xacro: bool,
    /// URDF 1.1 or newer: an `<origin>` may have a `quat_xyzw`.
    pub(super) quaternions: bool,
    pub(super) changes: Vec<Change>,
    pub(super) splices: Vec<Splice>,
    /// Changes of companions: index of the YAML, change, splice.
    pub(super) in_yaml: Vec<(usize, Change, Splice)>,
    /// Origins as read, `parent_link_from_joint` by joint.
    pub(super) before: BTreeMap<String, Isometry3<f64>>,
}

impl<'t, 'd> Patcher<'t, 'd> {
    pub(super) fn place(&self, offset: usize) -> Place {
        Place::of_byte(self.context.text, offset)
    }

    /// The element of a joint.
    pub(super) fn joint(&self, name: &str) -> Result<Node<'d, 't>, EditError> {
        let Context { text, document, .. } = self.context;
        if self.is_xacro {
            return xacro::joint(document, text, name, self.file);
        }
        top_level(document, "joint")
            .find(|node| node.own("name") == Some(name))
            .ok_or_else(|| EditError::UnknownName {
                file: self.file.to_owned(),
                source: UnknownName::among(
                    document.root_element().own("name").unwrap_or(""),
                    "joint",
                    name,
                    top_level(document, "joint").filter_map(|node| node.own("name")),
                ),
            })
    }

    /// The element of a joint, and the call that gives it where its macro is called several times.
    pub(super) fn joint_and_call(
        &self,
        name: &str,
    ) -> Result<(Node<'d, 't>, Option<Node<'d, 't>>), EditError> {
        match self.joint(name) {
            Ok(node) => Ok((node, None)),
            Err(refused @ (EditError::XacroMacro { .. } | EditError::XacroTemplate { .. })) => {
                match xacro::called(self.context.document, name) {
                    Some((node, call)) => Ok((node, Some(call))),
                    None => Err(refused),
                }
            }
            Err(refused) => Err(refused),
        }
    }

    /// Inserts `text` at byte `at`; `new` is what the list of changes shows of it.
    pub(super) fn insert(
        &mut self,
        (at, text): (usize, String),
        joint: &str,
        attribute: String,
        new: String,
    ) {
        self.changes.push(Change {
            line: self.place(at).line,
            joint: joint.to_owned(),
            attribute,
            old: String::new(),
            new,
        });
        self.splices.push(Splice {
            range: at..at,
            new: text,
        });
    }
}
