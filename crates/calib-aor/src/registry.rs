//! All estimators in one table: what each needs and how to call it by name.

use crate::{
    frame::FrameEstimate,
    frame_ml, frame_planes, halvorsen, hinge_bundle, hinge_poses, line_ml,
    outcome::{AorEstimate, Outcome},
    planar_radial, plane, robust_frame, robust_line, shared_axis,
};
use calib_estimator::{
    EstimatorError, Input, InputKind, Kind, OptionId,
    OptionId::{
        Angles, Axes, Center, PlaneFit, SameAngle, Seed, Separation, SigmaR, SigmaT, Significance,
        Subsets, Towards, WeakAngle, WeakFraction, Weights,
    },
    Options,
};

/// One estimator of an axis.
pub type EstimatorInfo = calib_estimator::EstimatorInfo<AorEstimate>;

/// What every estimator on circles uses.
const COMMON: &[OptionId] = &[SigmaT, Weights, Angles, Towards, Significance, WeakAngle];
/// Circles with a center that may be held.
const CENTERED: &[OptionId] = &[
    SigmaT,
    Weights,
    Center,
    Angles,
    Towards,
    Significance,
    WeakAngle,
];
/// Random subsets of samples.
const RANDOM: &[OptionId] = &[
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
const PAIRS: &[OptionId] = &[
    SigmaT,
    Weights,
    Angles,
    Towards,
    Separation,
    Significance,
    WeakAngle,
];
/// Linear estimators on poses: only the orientation noise enters their test.
const ROTATIONS: &[OptionId] = &[SigmaR, Weights, Angles, Towards, Significance, WeakAngle];
/// Poses, errors in variables.
const POSES: &[OptionId] = &[
    SigmaT,
    SigmaR,
    Weights,
    Angles,
    Towards,
    Significance,
    WeakAngle,
];

const TABLE: &[EstimatorInfo] = &[
    EstimatorInfo {
        id: "plane",
        name: "plane fit",
        input: InputKind::Points,
        options: CENTERED,
        summary: "normal of the best plane, circle center in it: the two-step baseline",
        source: "Gamage & Lasenby 2002; Cerveri et al. 2005",
        fit: plane::fit,
    },
    EstimatorInfo {
        id: "planar_radial",
        name: "planar and radial cost, downhill simplex",
        input: InputKind::Points,
        options: CENTERED,
        summary: "the paper's AoR; center held where given, else free",
        source: "Chang & Pollard 2007; paper §4",
        fit: planar_radial::simplex,
    },
    EstimatorInfo {
        id: "planar_radial_gn",
        name: "planar and radial cost, Gauss–Newton",
        input: InputKind::Points,
        options: CENTERED,
        summary: "the same minimum in a few steps",
        source: "paper §4",
        fit: planar_radial::gauss_newton,
    },
    EstimatorInfo {
        id: "circle_ml",
        name: "orthogonal-distance circle",
        input: InputKind::Points,
        options: COMMON,
        summary: "maximum likelihood circle in space; several markers share the direction",
        source: "Gander, Golub & Strebel 1994, in space",
        fit: line_ml::circle,
    },
    EstimatorInfo {
        id: "dir_ml",
        name: "common direction",
        input: InputKind::Points,
        options: COMMON,
        summary: "several markers, one direction, own centers",
        source: "orthogonal-distance circles, see the book",
        fit: line_ml::direction,
    },
    EstimatorInfo {
        id: "line_ml",
        name: "common line",
        input: InputKind::Points,
        options: COMMON,
        summary: "several markers around one line",
        source: "orthogonal-distance circles, see the book",
        fit: line_ml::line,
    },
    EstimatorInfo {
        id: "hinge_bundle",
        name: "markers of a rigid body on a hinge, jointly",
        input: InputKind::Markers,
        options: COMMON,
        summary: "axis, marker layout and all joint angles at once; markers may be occluded",
        source: "joint likelihood, see the book",
        fit: hinge_bundle::fit,
    },
    EstimatorInfo {
        id: "sara",
        name: "symmetrical axis of rotation",
        input: InputKind::OneOrTwoBodies,
        options: ROTATIONS,
        summary: "axis that stands still in one or two moving bodies",
        source: "Ehrig et al. 2007 (SARA)",
        fit: shared_axis::sara,
    },
    EstimatorInfo {
        id: "rotation_axis",
        name: "axis of the rotations",
        input: InputKind::OneOrTwoBodies,
        options: ROTATIONS,
        summary: "direction from orientations alone",
        source: "top singular pair of the mean rotation",
        fit: shared_axis::rotation_axis,
    },
    EstimatorInfo {
        id: "hinge_poses",
        name: "axis of poses, errors in variables",
        input: InputKind::OneOrTwoBodies,
        options: POSES,
        summary: "weighs orientations against positions, of one or two moving bodies",
        source: "joint likelihood, see the book",
        fit: hinge_poses::fit,
    },
    EstimatorInfo {
        id: "halvorsen_line",
        name: "line of the displacements",
        input: InputKind::Points,
        options: PAIRS,
        summary: "bisecting planes of pairs of samples",
        source: "Halvorsen et al. 1999",
        fit: halvorsen::fit,
    },
    EstimatorInfo {
        id: "robust_line",
        name: "common line with outliers",
        input: InputKind::Points,
        options: RANDOM,
        summary: "least trimmed squares over random subsets, then maximum likelihood of the samples that belong",
        source: "Rousseeuw & Van Driessen 1999",
        fit: robust_line::fit,
    },
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

/// One estimator of a frame.
pub type FrameInfo = calib_estimator::EstimatorInfo<FrameEstimate>;

/// What every frame estimator uses.
const FRAMED: &[OptionId] = &[
    SigmaT,
    SigmaR,
    Axes,
    PlaneFit,
    SameAngle,
    WeakAngle,
    WeakFraction,
];

const FRAMES: &[FrameInfo] = &[
    FrameInfo {
        id: "algorithm1",
        name: "circles around both axes",
        input: InputKind::TwoJoints,
        options: FRAMED,
        summary: "circles around both axes, axes rotated back by the joint angles; the paper's Algorithm 1",
        source: "Chang & Pollard 2007; paper §4, Algorithm 1",
        fit: frame_planes::fit,
    },
    FrameInfo {
        id: "frame_ml",
        name: "both axes by maximum likelihood",
        input: InputKind::TwoJoints,
        options: FRAMED,
        summary: "all poses and joint angles at once by maximum likelihood",
        source: "joint likelihood, see the book",
        fit: frame_ml::by_poses,
    },
    FrameInfo {
        id: "robust_frame",
        name: "both axes by maximum likelihood, with outliers",
        input: InputKind::TwoJoints,
        options: &[
            SigmaT,
            SigmaR,
            Axes,
            PlaneFit,
            SameAngle,
            WeakAngle,
            WeakFraction,
            Seed,
            Subsets,
        ],
        summary: "least trimmed squares over random subsets, then frame_ml of the poses that belong",
        source: "Rousseeuw & Van Driessen 1999",
        fit: robust_frame::fit,
    },
];

calib_estimator::offers!(
    Kind::Frame,
    FRAMES: FrameInfo,
    "All frame estimators, the paper's first."
    frame_estimators,
    frame_estimator
);
