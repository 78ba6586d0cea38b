//! What an estimator is given, and which estimators it serves.

use calib_estimator::measured::{Cloud, Pose, RowWeights, Tracks};
use serde::{Deserialize, Serialize};

use crate::{options::Options, outcome::AorError};

/// Measurements of one joint's motion, in one tracker frame and one length unit.
#[derive(Debug, Clone, Copy)]
pub enum Input<'a> {
    /// Markers on the moving limb, each on its own circle. Shape: marker × sample.
    Points(&'a Tracks),
    /// Markers on one rigid body, seen together. Shape: marker × frame. Circle estimators accept it too.
    Markers(&'a Tracks),
    /// Poses of the moving body. Circle estimators take the body's origin as a marker.
    Poses(&'a [Option<Pose>]),
    /// Simultaneous poses of the bodies on both sides of the joint.
    TwoBodies {
        /// The body whose frame the axis is reported in.
        parent: &'a [Option<Pose>],
        /// The other body.
        child: &'a [Option<Pose>],
    },
}

/// The shape of data an estimator needs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum InputKind {
    /// Positions of one or more markers.
    Points,
    /// Markers of one rigid body, frame by frame.
    Markers,
    /// Poses of one body, or of two.
    Poses,
}

impl Input<'_> {
    /// True when an estimator that needs `kind` can use these data.
    #[must_use]
    pub fn serves(&self, kind: InputKind) -> bool {
        match kind {
            InputKind::Points => !matches!(self, Self::TwoBodies { .. }),
            InputKind::Markers => matches!(self, Self::Markers(_)),
            InputKind::Poses => matches!(self, Self::Poses(_) | Self::TwoBodies { .. }),
        }
    }

    /// The word for these data.
    #[must_use]
    pub fn word(&self) -> &'static str {
        match self {
            Self::Points(_) => "points",
            Self::Markers(_) => "markers",
            Self::Poses(_) => "poses",
            Self::TwoBodies { .. } => "two bodies",
        }
    }
}

/// The samples as a cloud of points, with their weights.
pub(crate) fn cloud_of(input: &Input<'_>, options: &Options) -> Result<Cloud, AorError> {
    let weights = RowWeights(&options.weights);
    match *input {
        Input::Points(tracks) | Input::Markers(tracks) => {
            Ok(Cloud::weighted(tracks, &[], weights)?)
        }
        Input::Poses(poses) => Ok(Cloud::of_weighted_origins(poses, weights)?),
        Input::TwoBodies { .. } => Err(AorError::WrongInput {
            expects: InputKind::Points,
            got: input.word(),
        }),
    }
}
