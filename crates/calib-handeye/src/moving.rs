//! `A_i X = Z B_i` by least squares, for typed callers.

use calib_estimator::Options;
use nalgebra::Isometry3;

use crate::{
    input::{HandEyeError, check, check_axes},
    judge::judged,
    minimum::minimized,
    outcome::HandEye,
    problem::{HandEyeWeights, Weights},
};

/// Solves `A_i X = Z B_i` by least squares over all poses.
///
/// # Errors
/// [`HandEyeError`] for unusable input and for motions about a single axis.
pub fn solve_ax_zb(
    a: &[Isometry3<f64>],
    b: &[Isometry3<f64>],
    weights: HandEyeWeights,
) -> Result<HandEye, HandEyeError> {
    check(a, b, 3)?;
    check_axes(a)?;
    let w = Weights::of(weights);
    let found = minimized(a, b, w);
    Ok(judged("handeye", [a, b], &found, w, &Options::default()))
}
