//! Files as they are read: regular files only, and never more of them than a limit.

use std::fs::{File, OpenOptions};
use std::io::{Error, ErrorKind, Read as _, Result};
use std::path::Path;

/// Opens a regular file for reading. A folder, a pipe, a socket or a device is refused, and none is waited for.
///
/// # Errors
/// What the system says; [`ErrorKind::IsADirectory`] for a folder, [`ErrorKind::InvalidInput`] for anything else that is no regular file.
pub fn open(path: &Path) -> Result<File> {
    let file = file_or_folder(path)?;
    // The system refuses it only when it is read, and with a number.
    if file.metadata()?.is_dir() {
        let text = "it is a folder, not a file";
        return Err(Error::new(ErrorKind::IsADirectory, text));
    }
    Ok(file)
}

/// The same, and folders as well.
pub(crate) fn file_or_folder(path: &Path) -> Result<File> {
    let mut options = OpenOptions::new();
    options.read(true);
    // Opening a pipe waits for its writer without it; regular files know no difference.
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::custom_flags(&mut options, libc::O_NONBLOCK);
    let file = options.open(path)?;
    let kind = file.metadata()?.file_type();
    if kind.is_file() || kind.is_dir() {
        return Ok(file);
    }
    Err(Error::new(
        ErrorKind::InvalidInput,
        "it is a pipe, a socket or a device, not a regular file",
    ))
}

/// The bytes of a regular file.
///
/// # Errors
/// As [`open`]; [`ErrorKind::FileTooLarge`] for a file of more than `limit` bytes, of which no more are read.
pub fn read(path: &Path, limit: u64) -> Result<Vec<u8>> {
    let file = open(path)?;
    let too_large = || {
        let text = format!("it has more than {limit} bytes");
        Error::new(ErrorKind::FileTooLarge, text)
    };
    let size = file.metadata()?.len();
    if size > limit {
        return Err(too_large());
    }
    // What a file says of its size may change while it is read.
    let mut bytes = Vec::with_capacity(usize::try_from(size).unwrap_or(0));
    file.take(limit.saturating_add(1)).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > limit {
        return Err(too_large());
    }
    Ok(bytes)
}

/// The text of a regular file.
///
/// # Errors
/// As [`read`]; [`ErrorKind::InvalidData`] for what is not UTF-8.
pub fn read_text(path: &Path, limit: u64) -> Result<String> {
    String::from_utf8(read(path, limit)?).map_err(|e| Error::new(ErrorKind::InvalidData, e))
}
