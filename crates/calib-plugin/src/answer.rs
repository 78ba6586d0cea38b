//! What estimators answer, and how anything fails.

/// An estimate, or why there is none.
#[derive(Debug, Clone, PartialEq)]
pub enum Answer<T> {
    /// Determined by the data.
    Found(T),
    /// Not determined; the reason, with numbers.
    NotObservable(String),
}

/// A center of rotation.
#[derive(Debug, Clone, PartialEq)]
pub struct CorFit {
    /// In the tracker's frame, m; for two bodies in track 0.
    pub center_m: [f64; 3],
    /// Of the center, m².
    pub covariance_m2: Option<[[f64; 3]; 3]>,
    /// The center in each body, m; empty where no body is known.
    pub body_points_m: Vec<[f64; 3]>,
    /// Radius of each marker, m; empty where not known.
    pub radii_m: Vec<f64>,
    /// Root mean square of the residuals, m.
    pub rms_m: f64,
    /// Samples used.
    pub used: usize,
    /// Samples left out as wrong: (track, sample).
    pub rejected: Vec<[usize; 2]>,
    /// Why the center is determined only badly.
    pub weak: Option<String>,
}

/// A line: a point of it (m), and its direction of unit length.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxisLine {
    /// A point of it, m.
    pub point_m: [f64; 3],
    /// Unit length.
    pub direction: [f64; 3],
}

/// An axis of rotation.
#[derive(Debug, Clone, PartialEq)]
pub struct AorFit {
    /// In the tracker's frame; for two bodies in track 0.
    pub line: AxisLine,
    /// Over `[direction; point]` (rad, m).
    pub covariance: Option<[[f64; 6]; 6]>,
    /// The axis in the moving body.
    pub in_child: Option<AxisLine>,
    /// Root mean square of the residuals, m.
    pub rms_m: f64,
    /// Samples used.
    pub used: usize,
    /// Samples left out as wrong: (track, sample).
    pub rejected: Vec<[usize; 2]>,
    /// Why the axis is determined only badly.
    pub weak: Option<String>,
}

/// Why a call gave no answer.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Failure {
    /// The input is not what it reads: where and why.
    BadInput(String),
    /// Parameters that are each in range do not go together.
    BadParameter(String),
    /// Stopped because the call was cancelled.
    Cancelled,
    /// Anything else.
    Failed(String),
    /// A panic was stopped at the border: what it said.
    Panicked(String),
    /// What came back breaks the contract. Only hosts say this.
    Contract(String),
}

impl std::fmt::Display for Failure {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::BadInput(text) | Self::BadParameter(text) | Self::Failed(text) => {
                f.write_str(text)
            }
            Self::Cancelled => f.write_str("cancelled"),
            Self::Panicked(text) => write!(f, "panicked: {text}"),
            Self::Contract(text) => write!(f, "breaks the contract: {text}"),
        }
    }
}

impl std::error::Error for Failure {}
