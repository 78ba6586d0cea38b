//! What an estimator answers: an axis with its uncertainty, or why there is none.

use calib_estimator::{Verdict, measured::DataError};
use calib_geometry::Line;
use nalgebra::{Matrix6, Point3, Unit, Vector3};
use serde::Serialize;

use crate::input::InputKind;

/// Input that no estimator can read.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum AorError {
    /// No estimator of this name.
    #[error("unknown estimator `{id}`, expected one of {}", known.join(", "))]
    Unknown {
        /// The name asked for.
        id: String,
        /// The names there are.
        known: Vec<&'static str>,
    },
    /// The estimator needs another kind of data.
    #[error("this estimator needs {expects:?}, got {got}")]
    WrongInput {
        /// What it needs.
        expects: InputKind,
        /// What was given.
        got: &'static str,
    },
    /// Samples that cannot be read.
    #[error(transparent)]
    Data(#[from] DataError),
    /// An option that is not a usable number.
    #[error("option {name} must be a (positive) number, got {value}")]
    BadOption {
        /// Its name.
        name: &'static str,
        /// Its value.
        value: f64,
    },
}

impl AorError {
    /// The verdict word that belongs to this error, for those that describe data.
    #[must_use]
    pub fn verdict(&self) -> Option<Verdict> {
        match self {
            Self::Data(error) => error.verdict(),
            _ => None,
        }
    }
}

/// The circle of one marker around the axis.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Circle {
    /// Its center `m + τ n` (paper Eqs. 14, 15).
    pub center: Point3<f64>,
    /// Its radius.
    pub radius: f64,
    /// Angle that its samples cover, rad.
    pub arc: f64,
}

/// An axis of rotation.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AorEstimate {
    /// Id of the estimator.
    pub estimator: &'static str,
    /// The axis in the tracker's frame; for two bodies in the parent's.
    pub line: Line,
    /// The axis in the moving body, for pose estimators.
    pub in_child: Option<Line>,
    /// Covariance over `[direction; point]` (rad, unit of length): rank four, no part along the axis.
    pub covariance: Matrix6<f64>,
    /// Largest standard deviation of the direction, rad.
    pub sigma_direction: f64,
    /// Signed distance τ along n from the held center (or from `line.point`) to the markers' centroid.
    pub tau: f64,
    /// One for each marker that was seen at least twice; empty for poses.
    pub circles: Vec<Circle>,
    /// Position noise behind the covariance (for poses: of the axis residual).
    pub sigma: f64,
    /// Root mean square of the residuals (two for each point; three coordinates for each pose).
    pub rms: f64,
    /// Samples used.
    pub used: usize,
    /// Rows left out. No estimator of this crate rejects samples; kept for readers of results.
    pub rejected: Vec<usize>,
    /// [`Verdict::Ok`], or [`Verdict::Weak`] with the reason beside it.
    pub verdict: Verdict,
    /// Why the verdict is not `ok`, with numbers.
    pub reason: Option<String>,
}

impl AorEstimate {
    fn is_finite(&self) -> bool {
        let line = |l: &Line| {
            l.point
                .iter()
                .chain(l.direction.iter())
                .all(|x| x.is_finite())
        };
        line(&self.line)
            && self.in_child.iter().all(line)
            && self.covariance.iter().all(|x| x.is_finite())
            && self.circles.iter().all(|c| {
                c.center.iter().all(|x| x.is_finite()) && c.radius.is_finite() && c.arc.is_finite()
            })
            && [self.sigma_direction, self.tau, self.sigma, self.rms]
                .iter()
                .all(|x| x.is_finite())
    }
}

/// What is known although the axis is not.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub enum Known {
    /// The points lie on this line; any axis perpendicular to it fits.
    Chord(Line),
    /// The direction, but not the place.
    Direction(Unit<Vector3<f64>>),
    /// Nothing useful.
    Nothing,
}

/// The data cannot say where the axis is.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NotObservable {
    /// Id of the estimator.
    pub estimator: &'static str,
    /// The kind of degeneracy.
    pub verdict: Verdict,
    /// The reason, with numbers.
    pub reason: String,
    /// What the data do determine.
    pub known: Known,
}

/// Estimate, or the reason why not.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub enum Outcome {
    /// An axis with its covariance; look at its verdict for `weak`.
    Estimate(Box<AorEstimate>),
    /// No axis.
    NotObservable(NotObservable),
}

impl Outcome {
    /// The verdict of either branch.
    #[must_use]
    pub fn verdict(&self) -> Verdict {
        match self {
            Self::Estimate(e) => e.verdict,
            Self::NotObservable(n) => n.verdict,
        }
    }

    /// True when an axis is determined (`ok`); false for `weak` and all degeneracies.
    #[must_use]
    pub fn is_observable(&self) -> bool {
        self.verdict() == Verdict::Ok
    }

    /// The estimate, weak or not.
    #[must_use]
    pub fn estimate(&self) -> Option<&AorEstimate> {
        match self {
            Self::Estimate(e) => Some(e),
            Self::NotObservable(_) => None,
        }
    }

    /// Why the verdict is not `ok`.
    #[must_use]
    pub fn reason(&self) -> Option<&str> {
        match self {
            Self::Estimate(e) => e.reason.as_deref(),
            Self::NotObservable(n) => Some(&n.reason),
        }
    }

    /// The outcome itself, unless a number in it is not finite: then it says so.
    pub(crate) fn checked(self) -> Self {
        match self {
            Self::Estimate(e) if !e.is_finite() => Self::none(
                e.estimator,
                Verdict::Diverged,
                "the result is beyond the range of numbers".into(),
                Known::Nothing,
            ),
            outcome => outcome,
        }
    }

    pub(crate) fn none(
        estimator: &'static str,
        verdict: Verdict,
        reason: String,
        known: Known,
    ) -> Self {
        Self::NotObservable(NotObservable {
            estimator,
            verdict,
            reason,
            known,
        })
    }
}
