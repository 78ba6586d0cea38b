//! Settings of both frame estimators, what they refuse to read, and when a frame is weak.

use calib_estimator::{Verdict, measured::RowWeights};
use nalgebra::Matrix6;

use crate::{
    frame::{FrameAxes, FrameSample, Letter},
    options::Options,
    outcome::AorError,
};

/// How each plane's axis is fitted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PlaneFit {
    /// Planar and radial cost with the center held: the paper's.
    PlanarRadial,
    /// The plane's normal.
    Plane,
    /// One line for all circles around the proximal axis, which does not move; orthogonal-distance circles around
    /// the distal one.
    CommonLine,
}

/// Settings of Algorithm 1.
#[derive(Debug, Clone, Copy)]
pub struct FrameOptions {
    /// Which coordinate axes the joints turn about.
    pub axes: FrameAxes,
    /// How each plane's axis is fitted.
    pub fit: PlaneFit,
    /// Angles closer than this count as the same grid line, rad. 0.01 (0.6°): above encoder noise,
    /// below any sensible grid step.
    pub same_angle: f64,
    /// Position noise where the tracker states it.
    pub sigma_t: Option<f64>,
    /// Orientation noise where the tracker states it, rad.
    pub sigma_r: Option<f64>,
    /// σ of a rotation above which the verdict is `weak`, rad.
    pub weak_angle: f64,
    /// σ of the origin, as a part of its distance from the body, above which the verdict is `weak`.
    pub weak_fraction: f64,
}

impl Default for FrameOptions {
    fn default() -> Self {
        Self {
            axes: FrameAxes::default(),
            fit: PlaneFit::PlanarRadial,
            same_angle: 0.01,
            sigma_t: None,
            sigma_r: None,
            weak_angle: Options::default().weak_angle,
            weak_fraction: 0.1,
        }
    }
}

/// Letters of the paper's hand: z proximal, x distal.
#[must_use]
pub fn hand_axes() -> FrameAxes {
    FrameAxes {
        proximal: Letter::Z,
        distal: Letter::X,
    }
}

/// Letters of the paper's head: z (pan) proximal, y (tilt) distal.
#[must_use]
pub fn head_axes() -> FrameAxes {
    FrameAxes {
        proximal: Letter::Z,
        distal: Letter::Y,
    }
}

/// # Errors
/// [`AorError`] for poses that are no rotations, numbers that are not finite, or unusable options.
pub(crate) fn check(samples: &[FrameSample], options: &FrameOptions) -> Result<(), AorError> {
    for (name, value) in [
        ("sigma_t", options.sigma_t),
        ("sigma_r", options.sigma_r),
        ("same_angle", Some(options.same_angle)),
        ("weak_angle", Some(options.weak_angle)),
        ("weak_fraction", Some(options.weak_fraction)),
    ] {
        if let Some(value) = value
            && !(value.is_finite() && value > 0.0)
        {
            return Err(AorError::BadOption { name, value });
        }
    }
    if options.axes.proximal == options.axes.distal {
        let value = options.axes.distal.index() as f64;
        return Err(AorError::BadOption {
            name: "axes (both joints turn about the same letter)",
            value,
        });
    }
    for (row, sample) in samples.iter().enumerate() {
        if let Some(value) = [sample.proximal, sample.distal]
            .into_iter()
            .find(|angle| !angle.is_finite())
        {
            return Err(AorError::BadOption {
                name: "joint angle",
                value,
            });
        }
        RowWeights(&[sample.weight])
            .check(1)
            .map_err(|_| AorError::BadOption {
                name: "weight of a sample",
                value: sample.weight,
            })?;
        if let Some(pose) = sample.seen() {
            pose.check(row)?;
        }
    }
    Ok(())
}

/// `weak` where the orientation or the origin is known too badly, or the model does not explain the motion.
pub(crate) fn judge(
    covariance: &Matrix6<f64>,
    reach: f64,
    (rms_t, rms_r): (f64, f64),
    (sigma_t, sigma_r): (f64, f64),
    options: &FrameOptions,
) -> (Verdict, Option<String>) {
    /// Residuals this many times the stated noise are not noise.
    const MISFIT: f64 = 5.0;
    /// Orientation residuals of this size mean that the joint angles belong to another motion, rad (15°).
    const FOREIGN: f64 = 0.26;
    let misfit = (rms_t / (3.0_f64.sqrt() * sigma_t)).max(rms_r / (3.0_f64.sqrt() * sigma_r));
    if rms_r > FOREIGN || misfit > MISFIT {
        let text = format!(
            "the joint angles do not explain the motion: residuals of {rms_t:.2e} and {:.2}° rms, {misfit:.1} times \
             the noise (angles exchanged, of another sign or unit, or axes that do not meet?)",
            rms_r.to_degrees()
        );
        return (Verdict::Weak, Some(text));
    }
    let worst = |at: usize| {
        covariance
            .fixed_view::<3, 3>(at, at)
            .into_owned()
            .symmetric_eigenvalues()
            .max()
            .max(0.0)
            .sqrt()
    };
    let (turn, shift) = (worst(0), worst(3));
    if turn > options.weak_angle {
        let text = format!(
            "σ of the orientation is {:.2}°, more than {:.1}°",
            turn.to_degrees(),
            options.weak_angle.to_degrees()
        );
        (Verdict::Weak, Some(text))
    } else if shift > (options.weak_fraction * reach).max(sigma_t) {
        let text = format!(
            "σ of the origin is {shift:.2e}, more than {:.0} % of its distance {reach:.2e} from the body",
            100.0 * options.weak_fraction
        );
        (Verdict::Weak, Some(text))
    } else {
        (Verdict::Ok, None)
    }
}
