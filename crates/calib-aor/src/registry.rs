//! All estimators in one table: what each needs and how to call it by name.

use serde::Serialize;

use crate::{
    halvorsen, hinge_bundle, hinge_poses,
    input::{Input, InputKind},
    line_ml,
    options::Options,
    outcome::{AorError, Outcome},
    planar_radial, plane, shared_axis,
};

/// The entry point all axis estimators share.
pub type Fit = fn(&Input<'_>, &Options) -> Result<Outcome, AorError>;

/// One estimator.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct EstimatorInfo {
    /// Name in profiles and on the command line.
    pub id: &'static str,
    /// Its full name.
    pub name: &'static str,
    /// The data it needs.
    pub input: InputKind,
    /// What it does, in a line.
    pub summary: &'static str,
    /// Where it was published.
    pub source: &'static str,
    /// The function.
    #[serde(skip)]
    pub fit: Fit,
}

const TABLE: &[EstimatorInfo] = &[
    EstimatorInfo {
        id: "plane",
        name: "plane fit",
        input: InputKind::Points,
        summary: "normal of the best plane, circle center in it: the two-step baseline",
        source: "Gamage & Lasenby 2002; Cerveri et al. 2005",
        fit: plane::fit,
    },
    EstimatorInfo {
        id: "planar_radial",
        name: "planar and radial cost, downhill simplex",
        input: InputKind::Points,
        summary: "the paper's AoR; center held where given, else free",
        source: "Chang & Pollard 2007; paper §4",
        fit: planar_radial::simplex,
    },
    EstimatorInfo {
        id: "planar_radial_gn",
        name: "planar and radial cost, Gauss–Newton",
        input: InputKind::Points,
        summary: "the same minimum in a few steps",
        source: "paper §4",
        fit: planar_radial::gauss_newton,
    },
    EstimatorInfo {
        id: "circle_ml",
        name: "orthogonal-distance circle",
        input: InputKind::Points,
        summary: "maximum likelihood circle in space; several markers share the direction",
        source: "Gander, Golub & Strebel 1994, in space",
        fit: line_ml::circle,
    },
    EstimatorInfo {
        id: "dir_ml",
        name: "common direction",
        input: InputKind::Points,
        summary: "several markers, one direction, own centers",
        source: "orthogonal-distance circles, see the book",
        fit: line_ml::direction,
    },
    EstimatorInfo {
        id: "line_ml",
        name: "common line",
        input: InputKind::Points,
        summary: "several markers around one line",
        source: "orthogonal-distance circles, see the book",
        fit: line_ml::line,
    },
    EstimatorInfo {
        id: "hinge_bundle",
        name: "markers of a rigid body on a hinge, jointly",
        input: InputKind::Markers,
        summary: "axis, marker layout and all joint angles at once; markers may be occluded",
        source: "joint likelihood, see the book",
        fit: hinge_bundle::fit,
    },
    EstimatorInfo {
        id: "sara",
        name: "symmetrical axis of rotation",
        input: InputKind::Poses,
        summary: "axis that stands still in one or two moving bodies",
        source: "Ehrig et al. 2007 (SARA)",
        fit: shared_axis::sara,
    },
    EstimatorInfo {
        id: "rotation_axis",
        name: "axis of the rotations",
        input: InputKind::Poses,
        summary: "direction from orientations alone",
        source: "top singular pair of the mean rotation",
        fit: shared_axis::rotation_axis,
    },
    EstimatorInfo {
        id: "hinge_poses",
        name: "axis of poses, errors in variables",
        input: InputKind::Poses,
        summary: "weighs orientations against positions, of one or two moving bodies",
        source: "joint likelihood, see the book",
        fit: hinge_poses::fit,
    },
    EstimatorInfo {
        id: "halvorsen_line",
        name: "line of the displacements",
        input: InputKind::Points,
        summary: "bisecting planes of pairs of samples",
        source: "Halvorsen et al. 1999",
        fit: halvorsen::fit,
    },
];

/// All axis estimators, the paper's first. The frame has its own functions:
/// [`crate::frame_planes::algorithm1`] and [`crate::frame_ml::fit`].
#[must_use]
pub fn estimators() -> &'static [EstimatorInfo] {
    TABLE
}

/// The estimator called `id`.
///
/// # Errors
/// [`AorError::Unknown`] with the names there are.
pub fn estimator(id: &str) -> Result<&'static EstimatorInfo, AorError> {
    TABLE
        .iter()
        .find(|e| e.id == id)
        .ok_or_else(|| AorError::Unknown {
            id: id.to_string(),
            known: TABLE.iter().map(|e| e.id).collect(),
        })
}

/// Runs the estimator called `id`.
///
/// # Errors
/// [`AorError`] for an unknown name, data of another kind, or data that are no numbers.
pub fn fit(id: &str, input: &Input<'_>, options: &Options) -> Result<Outcome, AorError> {
    let info = estimator(id)?;
    if !input.serves(info.input) {
        return Err(AorError::WrongInput {
            expects: info.input,
            got: input.word(),
        });
    }
    Ok((info.fit)(input, options)?.checked())
}

/// Ids of the frame estimators, for lists that show all.
pub const FRAME_ESTIMATORS: [(&str, &str); 2] = [
    (
        "algorithm1",
        "circles around both axes, axes turned back by the joint angles; the paper's Algorithm 1",
    ),
    (
        "frame_ml",
        "all poses and joint angles at once by maximum likelihood",
    ),
];
