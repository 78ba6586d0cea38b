//! A folder for files that are needed only while a result is made.

use std::path::Path;

use crate::error::FileError;
use crate::folder::{folder_of, make_folder};
use crate::staged::{Staged, clean};

/// An empty folder under a name of its own, removed when it is dropped; that of a killed program is removed by the next one that writes beside it.
#[derive(Debug)]
pub struct ScratchFolder(Staged);

impl ScratchFolder {
    /// Makes it in the folder of a file that is to be written.
    ///
    /// # Errors
    /// [`FileError::Write`].
    pub fn beside(file: &Path) -> Result<Self, FileError> {
        let folder = folder_of(file);
        make_folder(folder)?;
        clean(folder);
        let made = Staged::folder(folder).map_err(FileError::write(folder))?;
        Ok(Self(made))
    }

    /// Where it is.
    #[must_use]
    pub fn path(&self) -> &Path {
        self.0.path()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_goes_with_its_content() {
        let root = tempfile::tempdir().expect("a folder");
        let scratch = ScratchFolder::beside(&root.path().join("all.parquet")).expect("made");
        std::fs::write(scratch.path().join("1.parquet"), "1").expect("a file");
        assert_eq!(std::fs::read_dir(root.path()).expect("a folder").count(), 1);
        // Whoever cleans leaves it alone while it is in use.
        clean(root.path());
        assert!(scratch.path().join("1.parquet").exists());
        drop(scratch);
        assert_eq!(std::fs::read_dir(root.path()).expect("a folder").count(), 0);
    }
}
