//! A file that a long computation resumes from.

use std::fs::File;
use std::path::{Path, PathBuf};

use crate::error::FileError;
use crate::folder::{folder_of, make_folder};
use crate::output::{self, replace};
use crate::{disk, input};

/// One line for the settings, then one for each finished part, appended as parts finish, in any order.
///
/// [`StateFile::close`] writes the lines in the order of the plan, so that an interrupted computation leaves the same bytes
/// as one that was not interrupted.
#[derive(Debug)]
pub struct StateFile {
    path: PathBuf,
    header: String,
    file: File,
}

impl StateFile {
    /// Opens the file, makes its folder, and returns the finished lines: those for which `is_whole` holds (the last line of
    /// an interrupted computation may be cut off). With `resume` unset, or with no file there, nothing is finished.
    ///
    /// `header` is one line that names everything that must be the same for finished parts to be kept.
    ///
    /// # Errors
    /// [`FileError::OtherState`] when the file has another header; [`FileError::Read`], [`FileError::Write`].
    pub fn open(
        path: &Path,
        header: &str,
        resume: bool,
        is_whole: impl Fn(&str) -> bool,
    ) -> Result<(Self, Vec<String>), FileError> {
        make_folder(folder_of(path))?;
        let mut finished = Vec::new();
        if resume && path.exists() {
            let text = input::read_text(path, u64::MAX).map_err(|source| FileError::Read {
                path: path.to_path_buf(),
                source,
            })?;
            let mut lines = text.lines();
            let found = lines.next().unwrap_or_default();
            if found != header {
                return Err(FileError::OtherState {
                    path: path.to_path_buf(),
                    found: found.to_owned(),
                    expected: header.to_owned(),
                });
            }
            finished = lines.filter(|l| is_whole(l)).map(str::to_owned).collect();
        }
        rewrite(path, header, &finished)?;
        let length = std::fs::metadata(path).map_err(FileError::write(path))?;
        let file = output::resume(path, length.len())?;
        let state = Self {
            path: path.to_path_buf(),
            header: header.to_owned(),
            file,
        };
        Ok((state, finished))
    }

    /// Appends the line of a finished part.
    ///
    /// # Errors
    /// [`FileError::Write`].
    pub fn append(&mut self, line: &str) -> Result<(), FileError> {
        disk::write(&mut self.file, format!("{line}\n").as_bytes())
            .map_err(FileError::write(&self.path))
    }

    /// Writes all lines in the order of the plan.
    ///
    /// # Errors
    /// [`FileError::Write`]; the appended lines are still there then.
    pub fn close(self, lines: &[String]) -> Result<(), FileError> {
        rewrite(&self.path, &self.header, lines)
    }
}

fn rewrite(path: &Path, header: &str, lines: &[String]) -> Result<(), FileError> {
    let mut text = format!("{header}\n");
    for line in lines {
        text.push_str(line);
        text.push('\n');
    }
    replace(path, text.as_bytes())
}
