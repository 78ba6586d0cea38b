//! Back to the original bytes.
//!
//! A patched file hides no state in itself. Beside it lies a [`ChangeRecord`] (as JSON, `robot.changes.json`): the hashes of
//! both texts and every replaced byte range with its old text. [`revert`] undoes the ranges if, and only if, the
//! file is still the one that the record describes, and hands out nothing whose hash is not the original's.

use crate::edit::change::Change;
use crate::edit::decimal::Splice;
use crate::edit::patch::Patched;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::fmt::Write;
use thiserror::Error;

/// The version of [`ChangeRecord`] that this code writes and reads.
pub const RECORD_VERSION: u32 = 1;

/// Everything that is needed to undo a patch.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ChangeRecord {
    /// [`RECORD_VERSION`].
    pub calib_changes: u32,
    /// Of the text before, 64 hexadecimal digits.
    pub original_sha256: String,
    /// Of the text after.
    pub patched_sha256: String,
    /// For people: what changed, attribute by attribute.
    pub changes: Vec<Change>,
    /// For [`revert`]: what changed, byte by byte, in the order of the file.
    pub replacements: Vec<Replacement>,
}

/// One byte range that was replaced.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Replacement {
    /// Byte offset in the **patched** text.
    pub at: usize,
    /// What stood there before.
    pub old: String,
    /// What stands there now.
    pub new: String,
}

/// Why a text is not reverted.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "each variant's text is its documentation")]
pub enum RevertError {
    #[error(
        "the record has the version {found}, expected {RECORD_VERSION}\n  help: revert with the calib that wrote it"
    )]
    Version { found: u32 },
    #[error("nothing to revert: the file already is the original")]
    AlreadyOriginal,
    #[error(
        "the file was edited after it was patched (sha256 {found}, recorded {recorded})\n  help: undo those edits first, or patch the original again; the record lists the old values"
    )]
    Edited { found: String, recorded: String },
    #[error("the record does not describe this file: at byte {at} it expects \"{expected}\"")]
    Mismatch { at: usize, expected: String },
    #[error(
        "the record is damaged: undoing it gives a text with sha256 {found}, recorded for the original is {recorded}"
    )]
    NotTheOriginal { found: String, recorded: String },
}

/// SHA-256 of a text's bytes, 64 hexadecimal digits.
#[must_use]
pub fn sha256_hex(bytes: &[u8]) -> String {
    Sha256::digest(bytes)
        .iter()
        .fold(String::with_capacity(64), |mut hex, byte| {
            // Writing to a String does not fail.
            let _ = write!(hex, "{byte:02x}");
            hex
        })
}

impl ChangeRecord {
    /// One record for this change and a later one: `first` is the text before this one, `last` the text after the later one.
    #[must_use]
    pub fn then(&self, later: &ChangeRecord, first: &str, last: &str) -> ChangeRecord {
        let mut changes = self.changes.clone();
        for change in &later.changes {
            let same =
                |c: &&mut Change| (&c.joint, &c.attribute) == (&change.joint, &change.attribute);
            match changes.iter_mut().find(same) {
                Some(earlier) => earlier.new.clone_from(&change.new),
                None => changes.push(change.clone()),
            }
        }
        changes.retain(|c| c.old != c.new);
        ChangeRecord {
            calib_changes: RECORD_VERSION,
            original_sha256: sha256_hex(first.as_bytes()),
            patched_sha256: sha256_hex(last.as_bytes()),
            changes,
            replacements: replaced_lines(first, last),
        }
    }
}

/// Lines that differ, as replacements.
fn replaced_lines(first: &str, last: &str) -> Vec<Replacement> {
    let diff = similar::TextDiff::from_lines(first, last);
    let mut at = 0;
    let mut replacements: Vec<Replacement> = Vec::new();
    for change in diff.iter_all_changes() {
        let line = change.value();
        if change.tag() == similar::ChangeTag::Equal {
            at += line.len();
            continue;
        }
        let goes_on = |r: &&mut Replacement| r.at + r.new.len() == at;
        if replacements.last_mut().filter(goes_on).is_none() {
            let (old, new) = (String::new(), String::new());
            replacements.push(Replacement { at, old, new });
        }
        if let Some(last) = replacements.last_mut() {
            if change.tag() == similar::ChangeTag::Insert {
                last.new += line;
                at += line.len();
            } else {
                last.old += line;
            }
        }
    }
    replacements
}

impl Patched {
    /// The patch that a record tells of; `patched_text` is the text that the record belongs to.
    #[must_use]
    pub fn from_record(patched_text: &str, record: &ChangeRecord) -> Self {
        let mut grown: isize = 0;
        let splices = record
            .replacements
            .iter()
            .map(|r| {
                let start = r.at.saturating_add_signed(-grown);
                grown += r.new.len() as isize - r.old.len() as isize;
                Splice {
                    range: start..start.saturating_add(r.old.len()),
                    new: r.new.clone(),
                }
            })
            .collect();
        Self {
            text: patched_text.to_owned(),
            changes: record.changes.clone(),
            splices,
        }
    }

    /// The record that [`revert`] needs; `original` is the text that was given to [`crate::patch()`].
    #[must_use]
    pub fn record(&self, original: &str) -> ChangeRecord {
        let mut replacements = Vec::with_capacity(self.splices.len());
        let mut grown: isize = 0;
        for splice in &self.splices {
            let old = original.get(splice.range.clone()).unwrap_or("").to_owned();
            replacements.push(Replacement {
                at: splice.range.start.saturating_add_signed(grown),
                new: splice.new.clone(),
                old,
            });
            grown += splice.new.len() as isize - splice.range.len() as isize;
        }
        ChangeRecord {
            calib_changes: RECORD_VERSION,
            original_sha256: sha256_hex(original.as_bytes()),
            patched_sha256: sha256_hex(self.text.as_bytes()),
            changes: self.changes.clone(),
            replacements,
        }
    }
}

/// The original text, byte for byte.
///
/// # Errors
/// [`RevertError`]: the file was edited since, already is the original, or belongs to another record.
pub fn revert(patched_text: &str, record: &ChangeRecord) -> Result<String, RevertError> {
    if record.calib_changes != RECORD_VERSION {
        return Err(RevertError::Version {
            found: record.calib_changes,
        });
    }
    let found = sha256_hex(patched_text.as_bytes());
    if found != record.patched_sha256 {
        if found == record.original_sha256 {
            return Err(RevertError::AlreadyOriginal);
        }
        return Err(RevertError::Edited {
            found,
            recorded: record.patched_sha256.clone(),
        });
    }
    let mut original = String::with_capacity(patched_text.len());
    let mut at = 0;
    for replacement in &record.replacements {
        let mismatch = || RevertError::Mismatch {
            at: replacement.at,
            expected: replacement.new.clone(),
        };
        let kept = patched_text.get(at..replacement.at).ok_or_else(mismatch)?;
        let rest = patched_text.get(replacement.at..).ok_or_else(mismatch)?;
        if !rest.starts_with(&replacement.new) {
            return Err(mismatch());
        }
        original.push_str(kept);
        original.push_str(&replacement.old);
        at = replacement.at + replacement.new.len();
    }
    original.push_str(&patched_text[at..]);
    let found = sha256_hex(original.as_bytes());
    if found != record.original_sha256 {
        return Err(RevertError::NotTheOriginal {
            found,
            recorded: record.original_sha256.clone(),
        });
    }
    Ok(original)
}

/// The patched text again from the original one; `None` where the record does not describe it.
#[must_use]
pub fn replay(original: &str, record: &ChangeRecord) -> Option<String> {
    let mut patched = String::with_capacity(original.len());
    let mut rest = original;
    for replacement in &record.replacements {
        let kept = replacement.at.checked_sub(patched.len())?;
        patched.push_str(rest.get(..kept)?);
        patched.push_str(&replacement.new);
        rest = rest.get(kept..)?.strip_prefix(replacement.old.as_str())?;
    }
    patched.push_str(rest);
    let is_it = sha256_hex(patched.as_bytes()) == record.patched_sha256;
    is_it.then_some(patched)
}
