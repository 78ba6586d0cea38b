//! The fault that a test injects into the changes of the disk.

use std::cell::Cell;
use std::io::{Error, ErrorKind, Result};

/// Which call fails.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Fault {
    None,
    /// This call alone fails.
    Error(usize),
    /// This call and all later ones fail: the program was killed.
    Stop(usize),
}

thread_local! {
    pub(crate) static FAULT: Cell<Fault> = const { Cell::new(Fault::None) };
    pub(crate) static CALLS: Cell<usize> = const { Cell::new(0) };
}

/// Counts a call; fails where the fault is.
pub(crate) fn next() -> Result<()> {
    let call = CALLS.get();
    CALLS.set(call + 1);
    let fails = match FAULT.get() {
        Fault::None => false,
        Fault::Error(at) => call == at,
        Fault::Stop(at) => call >= at,
    };
    match fails {
        true => Err(Error::from(ErrorKind::StorageFull)),
        false => Ok(()),
    }
}
