//! What an estimator answers: an estimate with its uncertainty, or why there is none.

use calib_estimator::{Estimate, Verdict, noise::Contradiction};
use calib_geometry::Line;
use nalgebra::{Matrix3, Matrix6, Point3, Unit, Vector3};
use serde::{Deserialize, Serialize};

/// Why a sample was left out.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum RejectReason {
    /// Its residual lies outside the gate, both in units of the noise.
    Outlier {
        /// Residual divided by the noise.
        residual_sigmas: f64,
        /// Largest accepted.
        gate_sigmas: f64,
    },
}

/// A sample that was left out.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Rejected {
    /// Marker (0 for poses).
    pub marker: usize,
    /// Row in the caller's table.
    pub row: usize,
    /// Why.
    pub reason: RejectReason,
}

/// Measurement noise behind a covariance.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Noise {
    /// Position noise, one coordinate, in the unit of the points.
    pub sigma_t: f64,
    /// Orientation noise about one axis, rad; absent where only points are used or it is not separable.
    pub sigma_r: Option<f64>,
    /// True when estimated from the residuals, false when stated by the caller.
    pub estimated: bool,
    /// A stated noise that the residuals exceed: the covariance is then that of the residuals.
    pub contradicts: Option<Contradiction>,
}

impl Noise {
    /// Levels that the residuals show.
    pub(crate) fn seen(sigma_t: f64, sigma_r: Option<f64>) -> Self {
        Self {
            sigma_t,
            sigma_r,
            estimated: true,
            contradicts: None,
        }
    }
}

/// What the estimator learned beside the center.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum Shape {
    /// Spheres: one radius for each marker that was seen at least twice.
    Radii {
        /// Radii, the second-order bias taken off.
        radii: Vec<f64>,
        /// The bias that was taken off: the estimator's own radius is `radii + bias`.
        bias: Vec<f64>,
    },
    /// One body: the center in the body's frame, and the covariance of `[center; body_point]`.
    BodyPoint {
        /// Center in the body.
        body_point: Point3<f64>,
        /// 6 × 6 over `[center (world); body_point]`.
        covariance: Matrix6<f64>,
    },
    /// Two bodies: the center in both, and the covariance of `[in_first; in_second]`.
    BodyPoints {
        /// Center in the first body.
        in_first: Point3<f64>,
        /// Center in the second body.
        in_second: Point3<f64>,
        /// 6 × 6 over `[in_first; in_second]`.
        covariance: Matrix6<f64>,
        /// Mean distance between the two bodies' ideas of the center.
        mean_gap: f64,
    },
}

/// A center of rotation.
///
/// For two bodies the center moves; [`CorEstimate::center`] is then its position in the second
/// body's frame.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct CorEstimate {
    /// Id of the estimator.
    pub estimator: &'static str,
    /// The center in the tracker's frame.
    pub center: Point3<f64>,
    /// Covariance of the center.
    pub covariance: Matrix3<f64>,
    /// Radii or body point.
    pub shape: Shape,
    /// Noise level the covariance rests on.
    pub noise: Noise,
    /// Degrees of freedom behind that noise, for the quantiles of Student's t and of F ([`calib_estimator::chance`]); `None` where the
    /// noise was stated, whose quantiles are those of the normal.
    pub degrees_of_freedom: Option<f64>,
    /// Root mean square of the residuals (points: radial; poses: per coordinate; bodies: per coordinate).
    pub rms: f64,
    /// Samples used.
    pub used: usize,
    /// Samples left out, with the reason.
    pub rejected: Vec<Rejected>,
    /// [`Verdict::Ok`], or [`Verdict::Weak`] with the reason beside it.
    pub verdict: Verdict,
    /// Why the verdict is not `ok`, with numbers.
    pub reason: Option<String>,
}

impl Estimate for CorEstimate {
    type Known = Known;

    const NOTHING: Known = Known::Nothing;

    calib_estimator::estimate_fields!();

    fn is_finite(&self) -> bool {
        let shape = match &self.shape {
            Shape::Radii { radii, bias } => radii.iter().chain(bias).all(|x| x.is_finite()),
            Shape::BodyPoint {
                body_point,
                covariance,
            } => body_point
                .iter()
                .chain(covariance.iter())
                .all(|x| x.is_finite()),
            Shape::BodyPoints {
                in_first,
                in_second,
                covariance,
                mean_gap,
            } => {
                mean_gap.is_finite()
                    && in_first
                        .iter()
                        .chain(in_second.iter())
                        .chain(covariance.iter())
                        .all(|x| x.is_finite())
            }
        };
        shape
            && self.rms.is_finite()
            && self.noise.sigma_t.is_finite()
            && self.noise.sigma_r.is_none_or(f64::is_finite)
            && self
                .center
                .iter()
                .chain(self.covariance.iter())
                .all(|x| x.is_finite())
    }
}

/// What is known although the center is not.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum Known {
    /// Every point of this line (tracker frame) is an equally good center.
    AxisLine(Line),
    /// The points lie in this plane.
    Plane {
        /// A point of it.
        point: Point3<f64>,
        /// Its normal.
        normal: Unit<Vector3<f64>>,
    },
    /// Nothing useful.
    Nothing,
}

/// The data cannot say where the center is.
pub type NotObservable = calib_estimator::NotObservable<Known>;

/// A center with its covariance, or the reason why not.
pub type Outcome = calib_estimator::Outcome<CorEstimate>;
