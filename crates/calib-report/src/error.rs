use thiserror::Error;

/// Why a report or a scene cannot be written or read.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum ReportError {
    /// A number that must be known is NaN or infinite; serde's text says where.
    #[error("the report has a number that is not finite: {0}")]
    NotFinite(String),
    /// The JSON text is not what was expected; serde's text has line and column.
    #[error("{0}")]
    Json(String),
    /// The CSV writer failed.
    #[error("residuals as CSV: {0}")]
    Csv(String),
    /// The HTML template failed.
    #[error("report as HTML: {0}")]
    Html(String),
    /// A mesh cannot be read: what was found, what was needed.
    #[error("mesh: {0}")]
    Stl(String),
    /// Two frames of a scene have one name.
    #[error("the scene has two frames named `{0}`")]
    FrameTwice(String),
    /// A frame, body or object hangs on a frame that does not exist.
    #[error("`{child}` hangs on `{parent}`, which is not a frame of the scene")]
    UnknownParent {
        /// What hangs.
        child: String,
        /// The missing frame.
        parent: String,
    },
    /// The parents of a frame form a ring.
    #[error("the parents of frame `{0}` form a ring")]
    FrameCycle(String),
    /// A frame's numbers are not finite or its quaternion has not unit length.
    #[error("frame `{0}` is not a pose: numbers must be finite, the quaternion of unit length")]
    NotAPose(String),
}
