//! What an estimator answers: an axis with its uncertainty, or why there is none.

use calib_estimator::{Estimate, Verdict, noise::Contradiction};
use calib_geometry::Line;
use nalgebra::{Matrix6, Point3, Unit, Vector3};
use serde::Serialize;

/// The circle of one marker around the axis.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[non_exhaustive]
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
#[non_exhaustive]
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
    /// Degrees of freedom behind that noise, for the quantiles of Student's t and of F ([`calib_estimator::chance`]); `None` where the
    /// noise was stated, whose quantiles are those of the normal.
    pub degrees_of_freedom: Option<f64>,
    /// A stated noise that the residuals exceed: the covariance is then that of the residuals.
    pub contradicts: Option<Contradiction>,
    /// Root mean square of the residuals (two for each point; three coordinates for each pose).
    pub rms: f64,
    /// Samples used.
    pub used: usize,
    /// Rows with rejected samples.
    pub rejected: Vec<usize>,
    /// [`Verdict::Ok`], or [`Verdict::Weak`] with the reason beside it.
    pub verdict: Verdict,
    /// Why the verdict is not `ok`, with numbers.
    pub reason: Option<String>,
}

impl Estimate for AorEstimate {
    type Known = Known;

    const NOTHING: Known = Known::Nothing;

    calib_estimator::estimate_fields!();

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
#[non_exhaustive]
pub enum Known {
    /// The points lie on this line; any axis perpendicular to it fits.
    Chord(Line),
    /// The direction, but not the place.
    Direction(Unit<Vector3<f64>>),
    /// Nothing useful.
    Nothing,
}

/// The data cannot say where the axis or the frame is.
pub type NotObservable = calib_estimator::NotObservable<Known>;

/// An axis with its covariance, or the reason why not.
pub type Outcome = calib_estimator::Outcome<AorEstimate>;
