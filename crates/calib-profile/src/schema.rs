//! JSON Schema of the profile, for editors.

use crate::raw::RawProfile;

/// The schema (draft 2020-12) as pretty JSON, ending in a newline.
#[must_use]
pub fn json_schema() -> String {
    let schema = schemars::schema_for!(RawProfile);
    let mut text = serde_json::to_string_pretty(&schema).unwrap_or_default();
    text.push('\n');
    text
}
