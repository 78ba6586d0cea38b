//! `--map NAME=FROM`: names of the profile, and the tracker's.

use std::collections::BTreeMap;

use super::record::error::RecordError;

/// The tracker's name by the profile's.
///
/// # Errors
/// [`RecordError::Map`] with the text that is no pair.
pub(in crate::commands) fn names_of(
    map: &[String],
) -> Result<BTreeMap<String, String>, RecordError> {
    map.iter()
        .map(|text| {
            let (name, from) = text
                .split_once('=')
                .ok_or_else(|| RecordError::Map(text.clone()))?;
            Ok((name.to_owned(), from.to_owned()))
        })
        .collect()
}
