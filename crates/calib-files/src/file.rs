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

/// Names that a folder can hold, none twice.
pub(crate) fn check_names(files: &[OutputFile]) -> Result<(), FileError> {
    for (i, file) in files.iter().enumerate() {
        match check_name(&file.name) {
            // Something was added to a name that a person gave.
            Err(NameFault::TooLong) if file.name.len() <= LONGEST_IN_FOLDER => {}
            checked => checked.map_err(|fault| FileError::Name {
                name: file.name.clone(),
                fault,
            })?,
        }
        // Two names that differ in case alone are one file on macOS and Windows.
        let same = |earlier: &OutputFile| earlier.name.eq_ignore_ascii_case(&file.name);
        if files[..i].iter().any(same) {
            return Err(FileError::SameName {
                name: file.name.clone(),
            });
        }
    }
    Ok(())
}
