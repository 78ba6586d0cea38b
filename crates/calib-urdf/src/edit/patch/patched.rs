//! A patched text and what is different in it.

use crate::edit::change::Change;
use crate::edit::decimal::{Splice, apply};
use nalgebra::Isometry3;
use std::collections::BTreeMap;

/// A patched text and what is different in it.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Patched {
    /// The new text.
    pub text: String,
    /// Attribute by attribute, in the order of the file.
    pub changes: Vec<Change>,
    /// The replaced byte ranges of the original, sorted, not overlapping.
    pub splices: Vec<Splice>,
}

/// What [`crate::patch_with`] makes of a text and of the files that it reads.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct PatchedFiles {
    /// The text itself.
    pub main: Patched,
    /// YAML files that changed: their place in [`crate::Companions::yaml`].
    pub yaml: Vec<(usize, Patched)>,
    /// The origins as the texts had them, `parent_link_from_joint` by joint, of all joints that the edits name.
    pub before: BTreeMap<String, Isometry3<f64>>,
}

impl Patched {
    pub(crate) fn of(text: &str, mut changes: Vec<Change>, mut splices: Vec<Splice>) -> Self {
        // Stable: insertions at one place stay in the order of the edits.
        splices.sort_by_key(|splice| splice.range.start);
        changes.sort_by_key(|change| change.line);
        Self {
            text: apply(text, &splices),
            changes,
            splices,
        }
    }
}
