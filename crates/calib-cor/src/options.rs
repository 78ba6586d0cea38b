//! The options that estimators of one kind share, and the form of an entry in the table.

use calib_estimator::OptionId::{
    self, Covariances, NoisePerMarker, Seed, SigmaR, SigmaT, Significance, Subsets, WeakFraction,
    Weights,
};

use crate::outcome::CorEstimate;

/// One estimator of a center.
pub type EstimatorInfo = calib_estimator::EstimatorInfo<CorEstimate>;

/// What every sphere uses.
pub(crate) const COMMON: &[OptionId] = &[SigmaT, Weights, Significance, WeakFraction];

/// Random starts.
pub(crate) const SEEDED: &[OptionId] = &[SigmaT, Weights, Significance, WeakFraction, Seed];

/// Spheres that weigh samples by their covariance, or markers by a noise of their own.
pub(crate) const WEIGHING: &[OptionId] = &[
    SigmaT,
    Covariances,
    Weights,
    NoisePerMarker,
    Significance,
    WeakFraction,
];

/// Linear estimators on poses: only the orientation noise enters their test.
pub(crate) const ROTATIONS: &[OptionId] = &[SigmaR, Weights, Significance, WeakFraction];

/// Poses, errors in variables.
pub(crate) const POSES: &[OptionId] = &[SigmaT, SigmaR, Weights, Significance, WeakFraction];

/// Random subsets of points or poses.
pub(crate) const RANDOM: &[OptionId] = &[
    SigmaT,
    SigmaR,
    Weights,
    Significance,
    WeakFraction,
    Seed,
    Subsets,
];
