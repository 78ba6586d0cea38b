//! All hand-eye estimators in one table: what each needs and how to call it by name.

use calib_estimator::{
    EstimatorInfo, InputKind, Kind, OptionId,
    OptionId::{SigmaR, SigmaT, Significance, WeakAngle, WeakFraction},
};

use crate::{by_input, dual_quaternion, outcome::HandEye};

/// One estimator of hand-eye transforms.
pub type HandEyeInfo = EstimatorInfo<HandEye>;

/// What every estimator uses.
const COMMON: &[OptionId] = &[SigmaT, SigmaR, Significance, WeakFraction, WeakAngle];

const TABLE: &[HandEyeInfo] = &[
    HandEyeInfo {
        id: "handeye",
        name: "robot–world and hand–eye, certified",
        input: InputKind::PosePairs,
        options: COMMON,
        summary: "both transforms of A X = Z B at once, with a proof of optimality",
        source: "quadratic cost with orthogonality constraints, see the book",
        fit: by_input::certified,
    },
    HandEyeInfo {
        id: "dual_quaternion",
        name: "hand-eye by dual quaternions",
        input: InputKind::PosePairs,
        options: COMMON,
        summary: "X in closed form from relative motions, Z as the mean; no weights and no start",
        source: "Daniilidis 1999",
        fit: dual_quaternion::fit,
    },
];

calib_estimator::offers!(
    Kind::HandEye,
    TABLE: HandEyeInfo,
    "All estimators of hand-eye transforms."
    estimators,
    estimator
);
