//! Long computations: in a thread of their own, so that the caller's thread can ask for signals.
//!
//! An interrupt is answered within [`TICK`]: the call raises it and asks the computation to stop. The computation unwinds at the next place
//! where it tells its progress; what it would have answered is dropped. It writes no file and calls no Python after that.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use calib_cli::CliError;
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

use crate::error::raised;

/// How often signals are asked for: a tenth of the 100 ms in which an interrupt must be answered.
const TICK: Duration = Duration::from_millis(10);

/// What a computation says.
enum Said<T> {
    /// A stage begins.
    Stage(String),
    /// So many of so many are done.
    Count(u64, u64),
    /// It ended: an answer, an error, or a panic.
    Ended(Result<Result<T, CliError>, Box<dyn Any + Send>>),
}

/// Unwinds a computation that nobody waits for.
struct Stopped;

/// The computation's end of the line.
pub(crate) struct Teller<T> {
    line: Sender<Said<T>>,
    stop: Arc<AtomicBool>,
}

impl<T> Teller<T> {
    /// A stage begins.
    pub(crate) fn stage(&self, name: &str) {
        self.say(Said::Stage(name.to_owned()));
    }

    /// So many of so many are done.
    pub(crate) fn count(&self, done: u64, total: u64) {
        self.say(Said::Count(done, total));
    }

    fn say(&self, said: Said<T>) {
        if self.stop.load(Ordering::SeqCst) || self.line.send(said).is_err() {
            // Not a panic: no hook prints it.
            resume_unwind(Box::new(Stopped));
        }
    }
}

/// Asks the computation to stop when the caller no longer waits.
struct Asking(Arc<AtomicBool>);

impl Drop for Asking {
    fn drop(&mut self) {
        self.0.store(true, Ordering::SeqCst);
    }
}

/// Runs `work` in a thread of its own; `progress(stage)` or `progress(done, total)` is called in the caller's thread.
///
/// # Errors
/// What `work` ends with, what `progress` raises, and `KeyboardInterrupt`.
pub(crate) fn waited<T: Send + 'static>(
    py: Python<'_>,
    progress: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(&Teller<T>) -> Result<T, CliError> + Send + 'static,
) -> PyResult<T> {
    let (line, heard) = channel();
    let stop = Arc::new(AtomicBool::new(false));
    let teller = Teller {
        line: line.clone(),
        stop: stop.clone(),
    };
    let _asking = Asking(stop);
    std::thread::spawn(move || {
        let ended = catch_unwind(AssertUnwindSafe(|| work(&teller)));
        // Nobody listens where the caller was interrupted.
        let _ = line.send(Said::Ended(ended));
    });
    let heard = Mutex::new(heard);
    loop {
        match py.detach(|| next(&heard)) {
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => {
                return Err(PyRuntimeError::new_err(
                    "the computation ended without an answer",
                ));
            }
            Ok(Said::Ended(Ok(answer))) => return answer.map_err(|error| raised(py, error)),
            Ok(Said::Ended(Err(panic))) => {
                return Err(PyRuntimeError::new_err(format!(
                    "calib stopped at a fault of its own: {}",
                    message(&*panic)
                )));
            }
            Ok(Said::Stage(name)) => {
                if let Some(progress) = progress {
                    progress.call1((name,))?;
                }
            }
            Ok(Said::Count(done, total)) => {
                if let Some(progress) = progress {
                    progress.call1((done, total))?;
                }
            }
        }
        py.check_signals()?;
    }
}

fn next<T>(heard: &Mutex<Receiver<Said<T>>>) -> Result<Said<T>, RecvTimeoutError> {
    let heard = heard.lock().unwrap_or_else(PoisonError::into_inner);
    heard.recv_timeout(TICK)
}

/// What a panic said.
fn message(panic: &(dyn Any + Send)) -> &str {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    text.or_else(|| panic.downcast_ref::<&str>().copied())
        .unwrap_or("a panic without a text")
}
