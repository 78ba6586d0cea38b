//! What an estimator finds, and the shape of data that it needs.

use serde::{Deserialize, Serialize};

/// What an estimator finds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[non_exhaustive]
pub enum Kind {
    /// A center of rotation.
    Center,
    /// An axis of rotation.
    Axis,
    /// The frame of a joint with two axes.
    Frame,
    /// The two fixed transforms between two pairs of frames.
    HandEye,
}

impl std::fmt::Display for Kind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Center => "center",
            Self::Axis => "axis",
            Self::Frame => "frame",
            Self::HandEye => "hand-eye",
        })
    }
}

/// The shape of data an estimator needs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum InputKind {
    /// Positions of one or more markers.
    Points,
    /// Poses of one body.
    Poses,
    /// Markers of one rigid body, frame by frame.
    Markers,
    /// Poses of two bodies.
    TwoBodies,
    /// Points, or poses of one body.
    PointsOrPoses,
    /// Poses of one body, or of two.
    OneOrTwoBodies,
    /// Poses of a body behind two joints, with their angles.
    TwoJoints,
    /// Pairs of simultaneous poses.
    PosePairs,
}

impl std::fmt::Display for InputKind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Points => "points",
            Self::Poses => "poses",
            Self::Markers => "markers",
            Self::TwoBodies => "two bodies",
            Self::PointsOrPoses => "points or poses",
            Self::OneOrTwoBodies => "poses of one or two bodies",
            Self::TwoJoints => "poses behind two joints",
            Self::PosePairs => "pairs of poses",
        })
    }
}

impl InputKind {
    /// The shapes of [`crate::Input`] that serve an estimator of this kind, the preferred first.
    #[must_use]
    pub fn shapes(self) -> &'static [Self] {
        match self {
            Self::Points => &[Self::Points, Self::Markers, Self::Poses],
            Self::PointsOrPoses => &[Self::Poses, Self::Points, Self::Markers],
            Self::OneOrTwoBodies => &[Self::TwoBodies, Self::Poses],
            Self::Poses => &[Self::Poses],
            Self::Markers => &[Self::Markers],
            Self::TwoBodies => &[Self::TwoBodies],
            Self::TwoJoints => &[Self::TwoJoints],
            Self::PosePairs => &[Self::PosePairs],
        }
    }
}
