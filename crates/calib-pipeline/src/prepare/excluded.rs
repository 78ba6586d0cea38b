//! What of a recording takes no part in the fit.

use calib_report::RejectedFor;

/// A body or marker of one row that takes no part in the fit.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Excluded {
    /// The recording.
    pub recording: String,
    /// The row, from 0.
    pub row: usize,
    /// The body or marker.
    pub body: String,
    /// Why.
    pub cause: RejectedFor,
}
