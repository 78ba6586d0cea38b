//! Every change that this program makes to a disk: one function for each system call, so that a test can fail each of them.

use std::fs::{self, File, OpenOptions, Permissions};
use std::io::{ErrorKind, Result, Write as _};
use std::path::Path;

#[cfg(test)]
use crate::fault::next as fault;
#[cfg(not(test))]
fn fault() -> Result<()> {
    Ok(())
}

/// Whether anything has this name, a link that leads nowhere included.
pub(crate) fn is_there(path: &Path) -> bool {
    fs::symlink_metadata(path).is_ok()
}

pub(crate) fn create_dir(folder: &Path) -> Result<()> {
    fault()?;
    fs::create_dir(folder)
}

/// A file that was not there: a link of that name is not followed.
pub(crate) fn create_new(path: &Path) -> Result<File> {
    fault()?;
    OpenOptions::new().write(true).create_new(true).open(path)
}

pub(crate) fn write(file: &mut File, bytes: &[u8]) -> Result<()> {
    if let Err(error) = fault() {
        // A full disk takes a part.
        file.write_all(&bytes[..bytes.len() / 2])?;
        return Err(error);
    }
    file.write_all(bytes)
}

pub(crate) fn sync(file: &File) -> Result<()> {
    fault()?;
    file.sync_all()
}

pub(crate) fn set_permissions(path: &Path, permissions: Permissions) -> Result<()> {
    fault()?;
    fs::set_permissions(path, permissions)
}

pub(crate) fn rename(from: &Path, to: &Path) -> Result<()> {
    fault()?;
    fs::rename(from, to)
}

/// A second name, which nothing may have.
pub(crate) fn hard_link(file: &Path, name: &Path) -> Result<()> {
    fault()?;
    fs::hard_link(file, name)
}

pub(crate) fn remove_file(path: &Path) -> Result<()> {
    fault()?;
    fs::remove_file(path)
}

pub(crate) fn remove_folder(path: &Path) -> Result<()> {
    fault()?;
    fs::remove_dir(path)
}

pub(crate) fn remove_tree(path: &Path) -> Result<()> {
    fault()?;
    fs::remove_dir_all(path)
}

/// Makes the names in a folder last through a power cut, where the system can.
pub(crate) fn sync_folder(folder: &Path) -> Result<()> {
    fault()?;
    let Ok(open) = File::open(folder) else {
        return Ok(());
    };
    match open.sync_all() {
        // Some file systems cannot synchronize a folder; Windows does not let one be opened for it.
        Err(error)
            if matches!(
                error.kind(),
                ErrorKind::InvalidInput | ErrorKind::Unsupported
            ) =>
        {
            Ok(())
        }
        done => done,
    }
}
