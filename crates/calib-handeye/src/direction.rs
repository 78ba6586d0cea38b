//! The direction of the measured poses: `tracker_from_body`, or its inverse.
//!
//! ```text
//! P(F(f, f) > (rms'/rms)²) < 10⁻³   of the positions or of the orientations,   f = 3n − 6      (10)
//! ```
//!
//! One direction is shown where the residuals of the other are larger by more than noise makes them. Three poses never show it: the relative motions
//! of three inverted poses have the angles and the pitches of those of the three poses, and these determine a triangle of motions.

use calib_estimator::chance::f_tail;
use serde::Serialize;

use crate::residuals::Residuals;

/// Chance below which (10) shows a direction.
const SHOWN: f64 = 1e-3;
/// Residuals, m and rad, below which data count as exact.
pub(crate) const EXACT: f64 = 1e-9;
/// Poses of which the direction never shows.
const NEVER: usize = 3;

/// The measured poses fit as they were used, and inverted.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[non_exhaustive]
pub struct OpenDirection {
    /// As they were used.
    pub as_used: Residuals,
    /// Inverted.
    pub inverted: Residuals,
}

/// (10): the residuals of `rows` poses speak for the direction that left `these`, and against the one that left `others`.
pub(crate) fn shown(these: &Residuals, others: &Residuals, rows: usize) -> bool {
    let freedom = 3.0 * rows as f64 - 6.0;
    let chance = |this: f64, other: f64| {
        let ratio = other.max(EXACT) / this.max(EXACT);
        f_tail(ratio * ratio, freedom, freedom)
    };
    let of_positions = chance(these.rms_translation, others.rms_translation);
    let of_rotations = chance(these.rms_rotation, others.rms_rotation);
    rows > NEVER && of_positions.min(of_rotations) < SHOWN
}
