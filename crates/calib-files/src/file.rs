//! A file to be written, and names that go together.

use crate::error::FileError;
use crate::name::{NameFault, check_name};

/// Bytes of a name that every common file system holds.
const LONGEST_IN_FOLDER: usize = 255;

/// A file to be written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OutputFile {
    /// Name within the output folder.
    pub name: String,
    /// Its bytes.
    pub bytes: Vec<u8>,
}

impl OutputFile {
    /// A text file.
    pub fn text(name: impl Into<String>, text: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            bytes: text.into().into_bytes(),
        }
    }
}

/// Their names.
pub(crate) fn names(files: &[OutputFile]) -> Vec<&str> {
    files.iter().map(|file| &*file.name).collect()
}

/// Names that a folder can hold, none twice.
pub(crate) fn check_names(names: &[&str]) -> Result<(), FileError> {
    for (i, name) in names.iter().enumerate() {
        match check_name(name) {
            // Something was added to a name that a person gave.
            Err(NameFault::TooLong) if name.len() <= LONGEST_IN_FOLDER => {}
            checked => checked.map_err(|fault| FileError::Name {
                name: (*name).to_owned(),
                fault,
            })?,
        }
        // Two names that differ in case alone are one file on macOS and Windows.
        let same = |earlier: &&str| earlier.eq_ignore_ascii_case(name);
        if names[..i].iter().any(same) {
            return Err(FileError::SameName {
                name: (*name).to_owned(),
            });
        }
    }
    Ok(())
}
