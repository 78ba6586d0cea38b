//! Settings of both frame estimators, what they refuse to read, and when a frame is weak.

use calib_estimator::{Verdict, measured::RowWeights};
use nalgebra::Matrix6;

use calib_estimator::{EstimatorError, FrameAxes, FrameAxis, FrameSample, Options, Rule};

/// Axes of the paper's hand: z proximal, x distal.
#[must_use]
pub fn hand_axes() -> FrameAxes {
    FrameAxes {
        proximal: FrameAxis::Z,
        distal: FrameAxis::X,
    }
}

/// Axes of the paper's head: z (pan) proximal, y (tilt) distal.
#[must_use]
pub fn head_axes() -> FrameAxes {
    FrameAxes {
        proximal: FrameAxis::Z,
        distal: FrameAxis::Y,
    }
}

/// # Errors
/// [`EstimatorError`] for poses that are no rotations, numbers that are not finite, or unusable options.
pub(crate) fn check(samples: &[FrameSample], options: &Options) -> Result<(), EstimatorError> {
    options.check()?;
    for (row, sample) in samples.iter().enumerate() {
        if let Some(value) = [sample.proximal, sample.distal]
            .into_iter()
            .find(|angle| !angle.is_finite())
        {
            return Err(EstimatorError::BadOption {
                name: "joint angle",
                rule: Rule::Finite,
                value,
            });
        }
        RowWeights(&[sample.weight])
            .check(1)
            .map_err(|_| EstimatorError::BadOption {
                name: "weight of a sample",
                rule: Rule::Weight,
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
    options: &Options,
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
