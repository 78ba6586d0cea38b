//! The frame of a joint with two axes through one center: what goes in, what comes out.
//!
//! ```text
//! world_from_joint(α, β) = [R_J, O] · Rot(proximal, α) · Rot(distal, β)                     (1)
//! world_from_body_i = world_from_joint(α_i, β_i) · joint_from_body                           (2)
//! ```
//!
//! The proximal axis stands still in the tracker's frame; the distal axis turns with the proximal joint and stands
//! still in the body, which sits on the distal side. `world_from_joint` at α = β = 0 is the reference configuration.
//! [`crate::frame_planes`] is the paper's Algorithm 1, [`crate::frame_ml`] its maximum-likelihood counterpart.

use calib_estimator::{Verdict, measured::Pose};
use calib_geometry::{Line, so3};
use nalgebra::{Isometry3, Matrix3, Matrix6, Point3, Rotation3, Unit, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use crate::outcome::{Known, NotObservable};

/// Angle between two axes below which no frame can be built from them whatever their noise.
const PARALLEL: f64 = 1e-6;

/// One row of a frame recording.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct FrameSample {
    /// Pose of the body in the tracker's frame; `None` where it was not seen.
    pub world_from_body: Option<Pose>,
    /// Angle of the proximal joint, rad.
    pub proximal: f64,
    /// Angle of the distal joint, rad.
    pub distal: f64,
    /// How many single samples it is worth: its noise variance is σ²/w. A sample of weight 0 counts as not seen.
    pub weight: f64,
}

impl FrameSample {
    /// The pose, where it was seen and counts.
    pub(crate) fn seen(&self) -> Option<&Pose> {
        self.world_from_body.as_ref().filter(|_| self.weight != 0.0)
    }
}

/// A coordinate axis of the joint's frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Letter {
    /// First.
    X,
    /// Second.
    Y,
    /// Third.
    Z,
}

impl Letter {
    pub(crate) fn index(self) -> usize {
        match self {
            Self::X => 0,
            Self::Y => 1,
            Self::Z => 2,
        }
    }

    /// The unit vector.
    #[must_use]
    pub fn axis(self) -> Unit<Vector3<f64>> {
        Unit::new_unchecked(Vector3::ith(self.index(), 1.0))
    }
}

/// Which coordinate axis each joint turns about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct FrameAxes {
    /// The axis of the joint nearer to the base: the paper's z for the hand, pan for the head.
    pub proximal: Letter,
    /// The axis of the joint nearer to the body: the paper's x for the hand, tilt (y) for the head.
    pub distal: Letter,
}

impl Default for FrameAxes {
    fn default() -> Self {
        Self {
            proximal: Letter::Z,
            distal: Letter::X,
        }
    }
}

impl FrameAxes {
    /// Rot(proximal, α) · Rot(distal, β).
    #[must_use]
    pub fn turned(&self, proximal: f64, distal: f64) -> UnitQuaternion<f64> {
        UnitQuaternion::from_axis_angle(&self.proximal.axis(), proximal)
            * UnitQuaternion::from_axis_angle(&self.distal.axis(), distal)
    }
}

/// The frame of a joint.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FrameEstimate {
    /// Id of the estimator.
    pub estimator: &'static str,
    /// The joint's frame in the body, at the reference configuration of the distal joint: what the
    /// calibration is for. With distal angle β it is `body_from_joint` turned by it, see (1).
    pub body_from_joint: Isometry3<f64>,
    /// Covariance of `body_from_joint` as `[ω; v]` (rad, unit of length) in the joint's frame.
    pub covariance: Matrix6<f64>,
    /// The joint's frame in the tracker at α = β = 0.
    pub world_from_joint: Isometry3<f64>,
    /// The proximal axis in the body at distal angle 0.
    pub proximal_in_body: Line,
    /// The distal axis in the body.
    pub distal_in_body: Line,
    /// Angle between the two measured axes less 90°, rad (0 by construction for the ML frame).
    pub orthogonality_defect: f64,
    /// Position noise, one coordinate.
    pub sigma_t: f64,
    /// Orientation noise about one axis, rad.
    pub sigma_r: f64,
    /// True when both were estimated from the residuals.
    pub noise_estimated: bool,
    /// Root mean square of the position residuals of all samples (vectors).
    pub rms_t: f64,
    /// Root mean square of the orientation residuals of all samples, rad.
    pub rms_r: f64,
    /// Planes around the proximal and the distal axis (0 for the ML frame).
    pub planes: (usize, usize),
    /// Samples used.
    pub used: usize,
    /// [`Verdict::Ok`], or [`Verdict::Weak`] with the reason beside it.
    pub verdict: Verdict,
    /// Why the verdict is not `ok`, with numbers.
    pub reason: Option<String>,
}

/// Estimate, or the reason why not.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub enum FrameOutcome {
    /// A frame with its covariance.
    Estimate(Box<FrameEstimate>),
    /// No frame.
    NotObservable(NotObservable),
}

impl FrameOutcome {
    /// An estimate, unless a number in it is not finite: then that is said instead.
    pub(crate) fn estimated(e: FrameEstimate) -> Self {
        let isometry = |x: &Isometry3<f64>| x.to_homogeneous().iter().all(|v| v.is_finite());
        let finite = isometry(&e.body_from_joint)
            && isometry(&e.world_from_joint)
            && e.covariance.iter().all(|v| v.is_finite())
            && [
                e.sigma_t,
                e.sigma_r,
                e.rms_t,
                e.rms_r,
                e.orthogonality_defect,
            ]
            .iter()
            .all(|v| v.is_finite());
        if finite {
            Self::Estimate(Box::new(e))
        } else {
            Self::NotObservable(NotObservable {
                estimator: e.estimator,
                verdict: Verdict::Diverged,
                reason: "the result is beyond the range of numbers".into(),
                known: Known::Nothing,
            })
        }
    }

    /// The verdict of either branch.
    #[must_use]
    pub fn verdict(&self) -> Verdict {
        match self {
            Self::Estimate(e) => e.verdict,
            Self::NotObservable(n) => n.verdict,
        }
    }

    /// The estimate, weak or not.
    #[must_use]
    pub fn estimate(&self) -> Option<&FrameEstimate> {
        match self {
            Self::Estimate(e) => Some(e),
            Self::NotObservable(_) => None,
        }
    }

    /// Why the verdict is not `ok`.
    #[must_use]
    pub fn reason(&self) -> Option<&str> {
        match self {
            Self::Estimate(e) => e.reason.as_deref(),
            Self::NotObservable(n) => Some(&n.reason),
        }
    }
}

/// A rotation from two measured axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrameFromAxes {
    /// Columns are the frame's axes: the rotation nearest to the two measured ones and their cross product.
    pub rotation: Rotation3<f64>,
    /// Angle between the measured axes less 90°, rad.
    pub orthogonality_defect: f64,
}

/// The frame of two axes: the third is their cross product (`AoR_y = AoR_z × AoR_x`), and all three are
/// projected onto SO(3), so that neither measured axis is preferred.
///
/// # Errors
/// [`Verdict::Parallel`] where the axes are parallel, [`Verdict::NotUnique`] where both have the same letter.
pub fn frame_from_axes(
    first: (Letter, Unit<Vector3<f64>>),
    second: (Letter, Unit<Vector3<f64>>),
) -> Result<FrameFromAxes, Verdict> {
    let (i, j) = (first.0.index(), second.0.index());
    if i == j {
        return Err(Verdict::NotUnique);
    }
    let cross = first.1.cross(&second.1);
    let sine = cross.norm();
    if sine <= PARALLEL {
        return Err(Verdict::Parallel);
    }
    // e_i × e_j = ± e_k, + for cyclic order
    let k = 3 - i - j;
    let sign = if (i + 1) % 3 == j { 1.0 } else { -1.0 };
    let mut m = Matrix3::zeros();
    m.set_column(i, &first.1);
    m.set_column(j, &second.1);
    m.set_column(k, &(cross * (sign / sine)));
    let rotation = so3::nearest_rotation(&m).ok_or(Verdict::Parallel)?;
    let angle = sine.atan2(first.1.dot(&second.1));
    Ok(FrameFromAxes {
        rotation: rotation.to_rotation_matrix(),
        orthogonality_defect: angle - std::f64::consts::FRAC_PI_2,
    })
}

/// Position and orientation residuals of all samples against (2), root mean square.
pub(crate) fn residuals(
    samples: &[FrameSample],
    axes: FrameAxes,
    world_from_joint: &Isometry3<f64>,
    body_from_joint: &Isometry3<f64>,
) -> (f64, f64) {
    let joint_from_body = body_from_joint.inverse();
    let (mut t2, mut r2, mut total) = (0.0, 0.0, 0.0_f64);
    for sample in samples {
        let Some(pose) = sample.seen() else {
            continue;
        };
        let w = sample.weight;
        let turn = axes.turned(sample.proximal, sample.distal);
        let predicted = world_from_joint * turn * joint_from_body;
        t2 += w * (predicted.translation.vector - pose.translation).norm_squared();
        let measured = so3::quaternion_of(&Rotation3::from_matrix_unchecked(pose.rotation));
        r2 += w * so3::log(&(predicted.rotation.inverse() * measured)).norm_squared();
        total += w;
    }
    let total = total.max(f64::MIN_POSITIVE);
    ((t2 / total).sqrt(), (r2 / total).sqrt())
}

/// Both axes in the body.
pub(crate) fn axes_in_body(axes: FrameAxes, body_from_joint: &Isometry3<f64>) -> (Line, Line) {
    let point = Point3::from(body_from_joint.translation.vector);
    let line = |letter: Letter| Line {
        point,
        direction: body_from_joint.rotation * letter.axis(),
    };
    (line(axes.proximal), line(axes.distal))
}
