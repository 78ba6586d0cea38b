//! Whole files that are too large to be held in memory.

use std::fs::File;
use std::io::{self, Read as _, Write};
use std::path::Path;

use crate::disk::{self, is_there};
use crate::error::FileError;
use crate::folder::{folder_of, make_folder};
use crate::input;
use crate::staged::{Staged, clean};

/// Where the pieces of a file go.
#[derive(Debug)]
pub struct Pieces<'a>(&'a mut File);

impl Write for Pieces<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        disk::write(self.0, bytes).map(|()| bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// What stopped the file: the system, or whoever wrote the pieces.
enum Stop<E> {
    System(io::Error),
    Caller(E),
}

impl<E> From<io::Error> for Stop<E> {
    fn from(error: io::Error) -> Self {
        Self::System(error)
    }
}

/// Writes a file that must not exist yet, piece by piece: all of it, or nothing. A file that is there with the very same bytes is done
/// already, so that a call that was stopped can be repeated.
///
/// # Errors
/// [`FileError::Exists`], [`FileError::Write`], and what `fill` says.
pub fn write_pieces<E: From<FileError>>(
    path: &Path,
    fill: impl FnOnce(&mut Pieces<'_>) -> Result<(), E>,
) -> Result<(), E> {
    let folder = folder_of(path);
    make_folder(folder)?;
    clean(folder);
    let staged = Staged::filled(folder, |file| fill(&mut Pieces(file)).map_err(Stop::Caller));
    let staged = staged.map_err(|stop| match stop {
        Stop::System(error) => FileError::write(path)(error).into(),
        Stop::Caller(error) => error,
    })?;
    let exists = || FileError::Exists {
        path: path.to_path_buf(),
    };
    if is_there(path) {
        let same = same(staged.path(), path).map_err(FileError::write(path))?;
        return same.then_some(()).ok_or_else(|| exists().into());
    }
    let placed = staged.place_new(path).map(drop);
    let placed = placed.and_then(|()| disk::sync_folder(folder));
    placed.map_err(|error| match error.kind() {
        io::ErrorKind::AlreadyExists => exists().into(),
        _ => FileError::write(path)(error).into(),
    })
}

/// Whether two regular files have the same bytes.
fn same(a: &Path, b: &Path) -> io::Result<bool> {
    /// Bytes that are compared at a time.
    const PIECE: u64 = 1 << 16;
    let is_file = std::fs::symlink_metadata(b).is_ok_and(|m| m.is_file());
    if !is_file {
        return Ok(false);
    }
    let (mut a, mut b) = (input::open(a)?, input::open(b)?);
    loop {
        let (mut of_a, mut of_b) = (Vec::new(), Vec::new());
        (&mut a).take(PIECE).read_to_end(&mut of_a)?;
        (&mut b).take(PIECE).read_to_end(&mut of_b)?;
        if of_a != of_b {
            return Ok(false);
        }
        if of_a.is_empty() {
            return Ok(true);
        }
    }
}
