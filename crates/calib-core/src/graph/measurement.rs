//! Measurements: what the tracker says about the frames at the two ends of a path.
//!
//! With `T = from_from_to(s; x)` along the path, residual = predicted ⊟ observed:
//!
//! ```text
//! marker      e = R p + t − y                                          3, from axes, m      (1)
//! pose        e = [ Log(R_zᵀ R); R_zᵀ (t − t_z) ]                      6, body axes, rad, m (2)
//! direction   e = E(d)ᵀ R a,  E(d) spans the plane across d            2, rad               (3)
//! plane       e = nᵀ (R p + t) − h                                     1, m                 (4)
//! line        e = E(d)ᵀ (R p + t − o)                                  2, m                 (5)
//! distance    e = |R p + t − y| − ℓ                                    1, m                 (6)
//! loop        (2) with T the closed path and T_z = identity            6                    (7)
//! ```
//!
//! An unknown plane or line is a frame with an unknown edge: give the measurement that frame as `from`.

use nalgebra::{Isometry3, Matrix3, Matrix6, Point3, Unit, Vector3};

use crate::graph::ids::{EdgeId, FrameId, GroupId, PointId};

/// One kind of measurement along one path.
#[derive(Debug, Clone, PartialEq)]
pub struct Measurement {
    /// Name, for findings (`hand`, `table contact`).
    pub name: String,
    /// Frame in which the measurement is stated.
    pub from: FrameId,
    /// Frame that is measured.
    pub to: FrameId,
    /// The edges from `from` to `to`, each with `true` where it is walked from child to parent;
    /// `None`: the shortest way through the graph.
    pub path: Option<Vec<(EdgeId, bool)>>,
    /// What is measured.
    pub kind: MeasurementKind,
}

/// Equations (1) to (7).
#[derive(Debug, Clone, PartialEq)]
pub enum MeasurementKind {
    /// Marker points, one vector each.
    Markers {
        /// σ per coordinate.
        noise: GroupId,
        /// What was seen.
        observations: Vec<MarkerObservation>,
    },
    /// Body poses.
    Poses {
        /// How their noise is described.
        noise: PoseNoise,
        /// What was seen.
        observations: Vec<PoseObservation>,
    },
    /// A direction that is fixed in `to` (an axis, a beam).
    Directions {
        /// The direction in `to`.
        direction: Unit<Vector3<f64>>,
        /// σ, rad.
        noise: GroupId,
        /// Observed directions in `from`.
        observations: Vec<DirectionObservation>,
        /// The observation has no sign.
        sign_free: bool,
    },
    /// A point of `to` lies at height h over a plane of `from`.
    Plane {
        /// The point.
        point: PointId,
        /// Unit normal in `from`.
        normal: Unit<Vector3<f64>>,
        /// σ, m.
        noise: GroupId,
        /// (sample, h in m).
        observations: Vec<(usize, f64)>,
    },
    /// A point of `to` lies on a line of `from`.
    Line {
        /// The point.
        point: PointId,
        /// A point of the line.
        through: Point3<f64>,
        /// Its direction.
        direction: Unit<Vector3<f64>>,
        /// σ, m.
        noise: GroupId,
        /// Samples where it does.
        samples: Vec<usize>,
    },
    /// The distance of a point of `to` from a point of `from`.
    Distance {
        /// The point of `to`.
        point: PointId,
        /// The point of `from`.
        anchor: Point3<f64>,
        /// σ, m.
        noise: GroupId,
        /// (sample, distance in m).
        observations: Vec<(usize, f64)>,
    },
    /// A closed path: `from` and `to` are the same frame and the path (given edge by edge, see
    /// [`Problem::add_loop`](crate::Problem::add_loop)) returns to where it began.
    Loop {
        /// How its noise is described.
        noise: PoseNoise,
        /// Samples where it closes.
        samples: Vec<usize>,
    },
}

/// Marker seen at `position` in the measurement's `from` frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MarkerObservation {
    /// Sample index.
    pub sample: usize,
    /// The marker, a point of the measurement's `to` frame.
    pub point: PointId,
    /// Where it was seen, m.
    pub position: Point3<f64>,
    /// Shape of its covariance in `from`, in units of σ²; `None` isotropic.
    pub shape: Option<Matrix3<f64>>,
}

/// Body seen at a pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PoseObservation {
    /// Sample index.
    pub sample: usize,
    /// `from_from_to`.
    pub pose: Isometry3<f64>,
}

/// Direction seen in `from`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DirectionObservation {
    /// Sample index.
    pub sample: usize,
    /// Unit direction.
    pub direction: Unit<Vector3<f64>>,
}

/// Noise of a measured pose.
#[derive(Debug, Clone, Copy, PartialEq)]
#[expect(
    clippy::large_enum_variant,
    reason = "one per measurement, not per observation; a box would cost Copy"
)]
pub enum PoseNoise {
    /// Isotropic in orientation and position.
    Split {
        /// σ rad.
        orientation: GroupId,
        /// σ m.
        position: GroupId,
    },
    /// Full covariance `[ω; v]` in the body frame, times the group's σ².
    Full {
        /// Shape.
        shape: Matrix6<f64>,
        /// Its scale.
        scale: GroupId,
    },
}

impl MeasurementKind {
    /// Samples of the observations, in their order.
    pub(crate) fn samples(&self) -> Vec<usize> {
        match self {
            Self::Markers { observations, .. } => observations.iter().map(|o| o.sample).collect(),
            Self::Poses { observations, .. } => observations.iter().map(|o| o.sample).collect(),
            Self::Directions { observations, .. } => {
                observations.iter().map(|o| o.sample).collect()
            }
            Self::Plane { observations, .. } | Self::Distance { observations, .. } => {
                observations.iter().map(|o| o.0).collect()
            }
            Self::Line { samples, .. } | Self::Loop { samples, .. } => samples.clone(),
        }
    }

    /// Rows per observation.
    pub(crate) fn rows(&self) -> usize {
        match self {
            Self::Markers { .. } => 3,
            Self::Poses { .. } | Self::Loop { .. } => 6,
            Self::Directions { .. } | Self::Line { .. } => 2,
            Self::Plane { .. } | Self::Distance { .. } => 1,
        }
    }
}
