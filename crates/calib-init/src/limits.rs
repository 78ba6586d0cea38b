//! Limits of the verdict from the noise: what a good calibration reaches, with room for what no model has.

use crate::proposal::Noise;

/// Times the noise of a coordinate that the rms error of a held-out position may have: 1.7 are noise, the rest is the robot.
const RMS: f64 = 5.0;
/// The same for the largest error of some tens of poses.
const MOST: f64 = 14.0;

/// Largest accepted errors of held-out positions, m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// rms.
    pub rms: f64,
    /// Largest.
    pub most: f64,
}

/// Limits; `None` where the noise is not known.
#[must_use]
pub fn of(noise: &Noise) -> Option<Limits> {
    let sigma = noise.marker.or(noise.body.map(|b| b.0))?;
    Some(Limits {
        rms: RMS * sigma,
        most: MOST * sigma,
    })
}
