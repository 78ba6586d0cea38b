//! The files of a twin, and their schema.

use calib_files::OutputFile;
use serde_json::Value;

use crate::error::TwinError;
use crate::page::page;
use crate::twin::Twin;

/// The twin as JSON, with the keys of [`json_schema`].
///
/// # Errors
/// [`TwinError::Unwritable`] for numbers that are not finite.
pub fn json(twin: &Twin) -> Result<String, TwinError> {
    Ok(serde_json::to_string_pretty(twin)? + "\n")
}

/// `twin.json` and `twin.html`.
///
/// # Errors
/// As [`json`].
pub fn files(twin: &Twin) -> Result<Vec<OutputFile>, TwinError> {
    Ok(vec![
        OutputFile::text("twin.json", json(twin)?),
        OutputFile::text("twin.html", page(twin)),
    ])
}

/// JSON Schema (draft 2020-12) of `twin.json`, from the same structs.
#[must_use]
pub fn json_schema() -> Value {
    let mut schema = schemars::schema_for!(Twin).to_value();
    schema["title"] = Value::from("calib twin");
    schema
}
