//! `--map NAME=FROM`: names of the profile, and the tracker's.

use std::collections::BTreeMap;

use super::record::error::RecordError;

/// The tracker's name by the profile's.
///
/// # Errors
/// [`RecordError::Map`] with the text that is no pair; [`RecordError::MapTwice`] for a name that two pairs have on the same side.
pub(in crate::commands) fn names_of(
    map: &[String],
) -> Result<BTreeMap<String, String>, RecordError> {
    let mut names: BTreeMap<String, String> = BTreeMap::new();
    for text in map {
        let pair = text.split_once('=');
        let pair = pair.filter(|(name, from)| !name.is_empty() && !from.is_empty());
        let (name, from) = pair.ok_or_else(|| RecordError::Map(text.clone()))?;
        let twice = |word: &str| RecordError::MapTwice(word.to_owned());
        if names.values().any(|other| other == from) {
            return Err(twice(from));
        }
        if names.insert(name.to_owned(), from.to_owned()).is_some() {
            return Err(twice(name));
        }
    }
    Ok(names)
}
