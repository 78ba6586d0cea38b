//! The `sha256:` pin of a profile.

use std::path::Path;

use sha2::{Digest, Sha256};

use super::PluginError;

/// Libraries with debug information have some hundred megabytes.
const LARGEST: u64 = 1 << 30;

/// Compares the file with the pin, before any of its code can run.
///
/// # Errors
/// [`PluginError::BadPin`], [`PluginError::Unreadable`], [`PluginError::Pin`].
pub(super) fn check(name: &str, path: &Path, pin: &str) -> Result<(), PluginError> {
    let needed = pin
        .strip_prefix("sha256:")
        .unwrap_or(pin)
        .to_ascii_lowercase();
    if needed.len() != 64 || !needed.bytes().all(|b| b.is_ascii_hexdigit()) {
        return Err(PluginError::BadPin {
            name: name.to_string(),
            pin: pin.to_string(),
        });
    }
    let shown = path.display().to_string();
    let bytes =
        calib_files::input::read(path, LARGEST).map_err(|error| PluginError::Unreadable {
            path: shown.clone(),
            reason: error.to_string(),
        })?;
    let found: String = Sha256::digest(&bytes)
        .iter()
        .map(|byte| format!("{byte:02x}"))
        .collect();
    if found == needed {
        return Ok(());
    }
    Err(PluginError::Pin {
        path: shown,
        found,
        needed,
    })
}
