//! All estimators in one table, and how to call one by name. What each is and needs stands in its file.

use calib_estimator::{EstimatorError, Input, Kind, Options};

use crate::{
    frame_ml, frame_planes, halvorsen, hinge_bundle, hinge_poses, line_ml,
    options::{EstimatorInfo, FrameInfo},
    outcome::Outcome,
    planar_radial, plane, robust_frame, robust_line, shared_axis,
};

const TABLE: &[EstimatorInfo] = &[
    plane::INFO,
    planar_radial::PLANAR_RADIAL,
    planar_radial::PLANAR_RADIAL_GN,
    line_ml::CIRCLE_ML,
    line_ml::DIR_ML,
    line_ml::LINE_ML,
    hinge_bundle::INFO,
    shared_axis::SARA,
    shared_axis::ROTATION_AXIS,
    hinge_poses::INFO,
    halvorsen::INFO,
    robust_line::INFO,
];

calib_estimator::offers!(
    Kind::Axis,
    TABLE: EstimatorInfo,
    "All axis estimators, the paper's first. Those of a frame are in [`frame_estimators`]."
    estimators,
    estimator
);

/// Runs the estimator called `id`.
///
/// # Errors
/// [`EstimatorError`] for an unknown name, data of another kind, data that are not finite, or an option that the estimator does not
/// use ([`Options::only`] keeps those that it uses).
pub fn fit(id: &str, input: &Input<'_>, options: &Options) -> Result<Outcome, EstimatorError> {
    estimator(id)?.run(input, options)
}

const FRAMES: &[FrameInfo] = &[frame_planes::INFO, frame_ml::INFO, robust_frame::INFO];

calib_estimator::offers!(
    Kind::Frame,
    FRAMES: FrameInfo,
    "All frame estimators, the paper's first."
    frame_estimators,
    frame_estimator
);
