//! The options that estimators of one kind share, and the form of an entry in the table.

use calib_estimator::{
    EstimatorInfo,
    OptionId::{self, SigmaR, SigmaT, Significance, WeakAngle, WeakFraction},
};

use crate::outcome::HandEye;

/// One estimator of hand-eye transforms.
pub type HandEyeInfo = EstimatorInfo<HandEye>;

/// What every estimator uses.
pub(crate) const COMMON: &[OptionId] = &[SigmaT, SigmaR, Significance, WeakFraction, WeakAngle];
