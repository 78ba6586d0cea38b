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

use calib_estimator::{Estimate, FrameAxes, FrameAxis, FrameSample, Verdict};
use calib_geometry::{Line, so3};
use nalgebra::{Isometry3, Matrix3, Matrix6, Point3, Rotation3, Unit, Vector3};
use serde::Serialize;

use crate::outcome::Known;

/// Angle between two axes below which no frame can be built from them whatever their noise.
const PARALLEL: f64 = 1e-6;

/// The frame of a joint.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
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
    /// Rows with rejected samples.
    pub rejected: Vec<usize>,
    /// [`Verdict::Ok`], or [`Verdict::Weak`] with the reason beside it.
    pub verdict: Verdict,
    /// Why the verdict is not `ok`, with numbers.
    pub reason: Option<String>,
}

/// A frame with its covariance, or the reason why not.
pub type FrameOutcome = calib_estimator::Outcome<FrameEstimate>;

impl Estimate for FrameEstimate {
    type Known = Known;

    const NOTHING: Known = Known::Nothing;

    calib_estimator::estimate_fields!();

    fn is_finite(&self) -> bool {
        let isometry = |x: &Isometry3<f64>| x.to_homogeneous().iter().all(|v| v.is_finite());
        isometry(&self.body_from_joint)
            && isometry(&self.world_from_joint)
            && self.covariance.iter().all(|v| v.is_finite())
            && [
                self.sigma_t,
                self.sigma_r,
                self.rms_t,
                self.rms_r,
                self.orthogonality_defect,
            ]
            .iter()
            .all(|v| v.is_finite())
    }
}

/// A rotation from two measured axes.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
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
    first: (FrameAxis, Unit<Vector3<f64>>),
    second: (FrameAxis, Unit<Vector3<f64>>),
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
        let Some([t, r]) = squares(sample, axes, world_from_joint, &joint_from_body) else {
            continue;
        };
        let w = sample.weight;
        t2 += w * t;
        r2 += w * r;
        total += w;
    }
    let total = total.max(f64::MIN_POSITIVE);
    ((t2 / total).sqrt(), (r2 / total).sqrt())
}

/// Squared position and orientation residuals of one sample against (2); `None` where the body was not seen.
pub(crate) fn squares(
    sample: &FrameSample,
    axes: FrameAxes,
    world_from_joint: &Isometry3<f64>,
    joint_from_body: &Isometry3<f64>,
) -> Option<[f64; 2]> {
    let pose = sample.seen()?;
    let turn = axes.turned(sample.proximal, sample.distal);
    let predicted = world_from_joint * turn * joint_from_body;
    let measured = so3::quaternion_of(&Rotation3::from_matrix_unchecked(pose.rotation));
    Some([
        (predicted.translation.vector - pose.translation).norm_squared(),
        so3::log(&(predicted.rotation.inverse() * measured)).norm_squared(),
    ])
}

/// Both axes in the body.
pub(crate) fn axes_in_body(axes: FrameAxes, body_from_joint: &Isometry3<f64>) -> (Line, Line) {
    let point = Point3::from(body_from_joint.translation.vector);
    let line = |letter: FrameAxis| Line {
        point,
        direction: body_from_joint.rotation * letter.axis(),
    };
    (line(axes.proximal), line(axes.distal))
}
