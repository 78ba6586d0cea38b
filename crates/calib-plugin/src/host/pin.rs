//! The SHA-256 of a plugin's file, and the `sha256:` pin of a profile.

use std::path::Path;

use sha2::{Digest, Sha256};

use super::PluginError;

/// Libraries with debug information have some hundred megabytes.
const LARGEST: u64 = 1 << 30;

/// The hash of a file, 64 hexadecimal digits.
///
/// # Errors
/// [`PluginError::Unreadable`].
pub(super) fn sha256(path: &Path) -> Result<String, PluginError> {
    let bytes =
        calib_files::input::read(path, LARGEST).map_err(|error| PluginError::Unreadable {
            path: path.display().to_string(),
            reason: error.to_string(),
        })?;
    let digest = Sha256::digest(&bytes);
    Ok(digest.iter().map(|byte| format!("{byte:02x}")).collect())
}

/// Compares the hash of a file with the pin, before any of its code can run.
///
/// # Errors
/// [`PluginError::BadPin`], [`PluginError::Pin`].
pub(super) fn check(name: &str, path: &Path, found: &str, pin: &str) -> Result<(), PluginError> {
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
    if found == needed {
        return Ok(());
    }
    Err(PluginError::Pin {
        path: path.display().to_string(),
        found: found.to_string(),
        needed,
    })
}
