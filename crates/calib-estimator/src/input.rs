//! What an estimator is given, and which estimators it serves.

use nalgebra::{Isometry3, Point3};

use crate::{
    error::EstimatorError,
    frame::FrameSample,
    kind::InputKind,
    measured::{Cloud, Pose, RowWeights, Tracks},
    options::Options,
};

/// Measurements of a motion, in one tracker frame and one length unit.
#[derive(Debug, Clone, Copy)]
#[non_exhaustive]
pub enum Input<'a> {
    /// Markers on the moving limb; they need not be rigid to each other. Shape: marker × sample.
    Points(&'a Tracks),
    /// Markers on one rigid body, seen together. Shape: marker × frame. Estimators for points accept it too.
    Markers(&'a Tracks),
    /// Poses of the moving body. Estimators for points take the body's origin as a marker.
    Poses(&'a [Option<Pose>]),
    /// Simultaneous poses of the bodies on both sides of the joint.
    TwoBodies {
        /// The body in whose frame an axis is reported.
        parent: &'a [Option<Pose>],
        /// The other body, in whose frame a center is reported.
        child: &'a [Option<Pose>],
    },
    /// Poses of a body behind two joints, with the angles of both.
    TwoJoints {
        /// One for each row.
        samples: &'a [FrameSample],
        /// Where the center of both axes comes from, for estimators that hold it; `None`: the point nearest to the axes.
        center: Option<CenterBy<'a>>,
    },
    /// Simultaneous poses of two frames that are rigidly attached to each other, each seen from its own base.
    PosePairs {
        /// `base_from_flange`, by the robot.
        robot: &'a [Isometry3<f64>],
        /// `tracker_from_body`, measured.
        measured: &'a [Isometry3<f64>],
    },
}

/// An estimator of a center, run on the poses of the body in the tracker's frame.
#[derive(Clone, Copy)]
pub struct CenterBy<'a>(pub &'a CenterOfPoses<'a>);

/// The center of rotation that poses have, if one is found: tracker frame, m.
pub type CenterOfPoses<'a> = dyn Fn(&[Option<Pose>]) -> Option<Point3<f64>> + 'a;

impl std::fmt::Debug for CenterBy<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("CenterBy")
    }
}

impl Input<'_> {
    /// The shape of these data.
    #[must_use]
    pub fn kind(&self) -> InputKind {
        match self {
            Self::Points(_) => InputKind::Points,
            Self::Markers(_) => InputKind::Markers,
            Self::Poses(_) => InputKind::Poses,
            Self::TwoBodies { .. } => InputKind::TwoBodies,
            Self::TwoJoints { .. } => InputKind::TwoJoints,
            Self::PosePairs { .. } => InputKind::PosePairs,
        }
    }

    /// True when an estimator that needs `kind` can use these data.
    #[must_use]
    pub fn serves(&self, kind: InputKind) -> bool {
        kind.shapes().contains(&self.kind())
    }

    /// The error of an estimator that needs `expects`.
    #[must_use]
    pub fn wrong(&self, expects: InputKind) -> EstimatorError {
        EstimatorError::WrongInput {
            expects,
            got: self.kind(),
        }
    }
}

/// The samples of `input` as clouds of points, with their weights and covariances.
///
/// # Errors
/// [`EstimatorError::Data`] for samples that cannot be read, [`EstimatorError::WrongInput`] for data without points.
pub fn cloud_of(input: &Input<'_>, options: &Options) -> Result<Cloud, EstimatorError> {
    let weights = RowWeights(&options.weights);
    match *input {
        Input::Points(tracks) | Input::Markers(tracks) => {
            Ok(Cloud::weighted(tracks, &options.covariances, weights)?)
        }
        Input::Poses(poses) => Ok(Cloud::of_weighted_origins(poses, weights)?),
        Input::TwoBodies { .. } | Input::TwoJoints { .. } | Input::PosePairs { .. } => {
            Err(input.wrong(InputKind::Points))
        }
    }
}
