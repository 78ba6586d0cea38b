//! All estimators in one table, and how to call one by name. What each is and needs stands in its file.

use calib_estimator::Kind;

use crate::{by_input, dual_quaternion, options::HandEyeInfo};

const TABLE: &[HandEyeInfo] = &[by_input::INFO, dual_quaternion::INFO];

calib_estimator::offers!(
    Kind::HandEye,
    TABLE: HandEyeInfo,
    "All estimators of hand-eye transforms."
    estimators,
    estimator
);
