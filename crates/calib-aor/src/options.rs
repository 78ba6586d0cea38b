//! The options that estimators of one kind share, and the form of an entry in the table.

use calib_estimator::OptionId::{
    self, Angles, Axes, Center, PlaneFit, SameAngle, Seed, Separation, SigmaR, SigmaT,
    Significance, Subsets, Towards, WeakAngle, WeakFraction, Weights,
};

use crate::{frame::FrameEstimate, outcome::AorEstimate};

/// One estimator of an axis.
pub type EstimatorInfo = calib_estimator::EstimatorInfo<AorEstimate>;

/// One estimator of a frame.
pub type FrameInfo = calib_estimator::EstimatorInfo<FrameEstimate>;

/// What every estimator on circles uses.
pub(crate) const COMMON: &[OptionId] = &[SigmaT, Weights, Angles, Towards, Significance, WeakAngle];

/// Circles with a center that may be held.
pub(crate) const CENTERED: &[OptionId] = &[
    SigmaT,
    Weights,
    Center,
    Angles,
    Towards,
    Significance,
    WeakAngle,
];

/// Random subsets of samples.
pub(crate) const RANDOM: &[OptionId] = &[
    SigmaT,
    Weights,
    Angles,
    Towards,
    Significance,
    WeakAngle,
    Seed,
    Subsets,
];

/// Pairs of samples.
pub(crate) const PAIRS: &[OptionId] = &[
    SigmaT,
    Weights,
    Angles,
    Towards,
    Separation,
    Significance,
    WeakAngle,
];

/// Linear estimators on poses: only the orientation noise enters their test.
pub(crate) const ROTATIONS: &[OptionId] =
    &[SigmaR, Weights, Angles, Towards, Significance, WeakAngle];

/// Poses, errors in variables.
pub(crate) const POSES: &[OptionId] = &[
    SigmaT,
    SigmaR,
    Weights,
    Angles,
    Towards,
    Significance,
    WeakAngle,
];

/// What every frame estimator uses.
pub(crate) const FRAMED: &[OptionId] = &[
    SigmaT,
    SigmaR,
    Axes,
    PlaneFit,
    SameAngle,
    WeakAngle,
    WeakFraction,
];

/// The same over random subsets.
pub(crate) const FRAMED_RANDOM: &[OptionId] = &[
    SigmaT,
    SigmaR,
    Axes,
    PlaneFit,
    SameAngle,
    WeakAngle,
    WeakFraction,
    Seed,
    Subsets,
];
