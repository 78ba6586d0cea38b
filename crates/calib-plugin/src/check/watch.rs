//! Calls that must return in time.

use std::{
    fmt,
    sync::{Arc, mpsc},
    time::Duration,
};

use super::{
    judged,
    subject::{Input, Reply, Subject},
};
use crate::host::{Cancel, Control};

/// A call that did not return in time.
pub(super) struct Late(Duration);

impl fmt::Display for Late {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "did not return within {:?}", self.0)
    }
}

/// Calls in a thread of its own; one that is late is asked to stop and left behind.
pub(super) fn call(
    subject: &Arc<Subject>,
    input: &Input,
    cancel: &Cancel,
    limit: Duration,
) -> Result<Result<Reply, String>, Late> {
    let (send, receive) = mpsc::channel();
    let (subject, input, inner) = (subject.clone(), input.clone(), cancel.clone());
    std::thread::spawn(move || {
        let reply = judged(subject.call(&input, &Control::cancelled_by(&inner)));
        // Nobody listens any more when it is late.
        let _ = send.send(reply);
    });
    match receive.recv_timeout(limit) {
        Ok(reply) => Ok(reply),
        Err(mpsc::RecvTimeoutError::Timeout) => {
            cancel.cancel();
            Err(Late(limit))
        }
        Err(mpsc::RecvTimeoutError::Disconnected) => Ok(Err("the call panicked".to_string())),
    }
}
