use thiserror::Error;

/// Why a report or a scene cannot be written or read.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum ReportError {
    /// A required number is NaN or infinite; the text says where.
    #[error("the report has a non-finite value: {0}")]
    NotFinite(String),
    /// The JSON text is not what was expected; serde's text has line and column.
    #[error("{0}")]
    Json(String),
    /// The CSV writer failed.
    #[error("residuals as CSV: {0}")]
    Csv(String),
    /// The MCAP writer failed.
    #[error("view as MCAP: {0}")]
    Mcap(String),
    /// The HTML template failed.
    #[error("report as HTML: {0}")]
    Html(String),
    /// Two frames of a scene have one name.
    #[error("the scene has two frames named `{0}`")]
    FrameTwice(String),
    /// The parent of a frame, body or object does not exist.
    #[error("the parent `{parent}` of `{child}` is not a frame of the scene")]
    UnknownParent {
        /// The child.
        child: String,
        /// The missing frame.
        parent: String,
    },
    /// A frame comes before its parent.
    #[error("the parent `{parent}` of frame `{child}` comes after it: parents come first")]
    ParentLater {
        /// The child.
        child: String,
        /// Its parent.
        parent: String,
    },
    /// The parents of a frame form a cycle.
    #[error("the parents of frame `{0}` form a cycle")]
    FrameCycle(String),
    /// Values of a frame are not finite, or its quaternion does not have unit length.
    #[error(
        "frame `{0}` is not a pose: its values must be finite and its quaternion must have unit length"
    )]
    NotAPose(String),
}
