//! What an estimator is given, and which estimators it serves.

use calib_estimator::measured::{Cloud, Pose, RowWeights, Tracks};
use serde::{Deserialize, Serialize};

use crate::{options::Options, outcome::CorError};

/// Measurements of a joint's motion, in one tracker frame and one length unit.
#[derive(Debug, Clone, Copy)]
pub enum Input<'a> {
    /// Markers on the moving limb; they need not be rigid to each other. Shape: marker × sample.
    Points(&'a Tracks),
    /// Markers on one rigid body, seen together. Shape: marker × frame. Sphere estimators accept it too.
    Markers(&'a Tracks),
    /// Poses of one body. Sphere estimators take the body's origin as a marker.
    Poses(&'a [Option<Pose>]),
    /// Simultaneous poses of the two bodies beside the joint.
    TwoBodies {
        /// The body whose motion is described.
        first: &'a [Option<Pose>],
        /// The other body.
        second: &'a [Option<Pose>],
    },
}

/// The shape of data an estimator needs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum InputKind {
    /// Positions of one or more markers.
    Points,
    /// Poses of one body.
    Poses,
    /// Markers of one rigid body, frame by frame.
    Markers,
    /// Poses of two bodies.
    TwoBodies,
    /// Spheres for points, hot spots for poses.
    PointsOrPoses,
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
        }
    }

    /// True when an estimator that needs `kind` can use these data.
    #[must_use]
    pub fn serves(&self, kind: InputKind) -> bool {
        self.kind() == kind
            || (matches!(kind, InputKind::Points | InputKind::PointsOrPoses)
                && self.kind() != InputKind::TwoBodies)
    }
}

/// The samples of `input` as clouds of points, with their weights and covariances.
pub(crate) fn cloud_of(input: &Input<'_>, options: &Options) -> Result<Cloud, CorError> {
    let weights = RowWeights(&options.weights);
    match *input {
        Input::Points(tracks) | Input::Markers(tracks) => {
            Ok(Cloud::weighted(tracks, &options.covariances, weights)?)
        }
        Input::Poses(poses) => Ok(Cloud::of_weighted_origins(poses, weights)?),
        Input::TwoBodies { .. } => Err(CorError::WrongInput {
            expects: InputKind::Points,
            got: input.kind(),
        }),
    }
}
