//! How a recording ends, and what the operator can say meanwhile.

use crate::{SourceError, TableError};

/// Input of the operator.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Key {
    /// The robot is at the pose.
    There,
    /// Skip this pose.
    Skip,
    /// Record the next best pose instead of this one.
    Instead,
    /// Count this pose with what is seen of it.
    Keep,
    /// Record the last pose again.
    Repeat,
    /// The program was interrupted.
    Interrupt,
    /// No further input will come.
    Closed,
    /// End the recording.
    Quit,
}

/// Why a recording ended. The file has everything that was recorded.
#[derive(Clone, Debug, PartialEq)]
pub enum Ended {
    /// All poses were held.
    Finished,
    /// What was asked for is reached.
    Reached,
    /// The operator ended it.
    Quit,
    /// The program was interrupted.
    Interrupted,
    /// The time limit was reached.
    TimeIsOver,
    /// The tracker sent nothing for this long, s.
    Silent(f64),
    /// Something arrived, and nothing of it was a frame: what the first of it was.
    Unreadable(String),
    /// The tracker closed the connection.
    Closed,
    /// The tracker's frame counter or clock jumped back.
    Restarted,
    /// A pose needs confirmation, and standard input was closed.
    NobodyThere,
}

impl Ended {
    /// Whether it ended as intended.
    pub fn is_good(&self) -> bool {
        matches!(
            self,
            Ended::Finished | Ended::Reached | Ended::Quit | Ended::TimeIsOver
        )
    }
}

impl std::fmt::Display for Ended {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Ended::Finished => f.write_str("all poses recorded"),
            Ended::Reached => f.write_str("what was asked for is reached"),
            Ended::Quit => f.write_str("stopped by the operator"),
            Ended::Interrupted => f.write_str("interrupted"),
            Ended::TimeIsOver => f.write_str("the time limit was reached"),
            Ended::Silent(s) => write!(
                f,
                "no data from the tracker for {s:.0} s. Check that it is measuring, that it sends to this computer and port, and that no firewall blocks it."
            ),
            Ended::Unreadable(why) => write!(
                f,
                "what arrives is not from the tracker: {why}. Check which port the tracker sends to and which protocol."
            ),
            Ended::Closed => f.write_str("the tracker's server closed the connection"),
            Ended::Restarted => f.write_str(
                "the tracker's frame counter or clock jumped back: the tracker was restarted. Continue in a new file.",
            ),
            Ended::NobodyThere => f.write_str(
                "standard input was closed, so poses cannot be confirmed. Let the robot send its joint positions (`--joints udp:PORT`).",
            ),
        }
    }
}

/// Why recording failed. The file has everything that was recorded before.
#[derive(Debug, thiserror::Error)]
pub enum CaptureError {
    /// The tracker.
    #[error(transparent)]
    Source(#[from] SourceError),
    /// The file.
    #[error(transparent)]
    Table(#[from] TableError),
}
