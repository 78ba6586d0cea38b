//! Noise of where a body is that states where it sees the tracker.
//!
//! A camera on the robot measures p = −Rᵀt and R of `tracker_from_body` = (R, t). Errors of R move t = −R p by the lever |p|:
//!
//! ```text
//! var t = σ² + ⅔ σ_R² |p|²        per axis, of three of which two lie across the lever            (1)
//! ```

use std::collections::BTreeSet;

use calib_profile::Tracker;
use calib_recording::Poses;
use nalgebra::Isometry3;

/// √ of equation (1), m, over the poses whose inverses were measured; `None` where no σ is stated.
pub(crate) fn position_sigma<'a>(
    tracker: &Tracker,
    inverse: impl Iterator<Item = &'a Isometry3<f64>>,
) -> Option<f64> {
    let levers = inverse.map(|pose| pose.translation.vector.norm_squared());
    let (sum, count) = levers.fold((0.0, 0.0), |(sum, n), lever| (sum + lever, n + 1.0));
    let lever = if count > 0.0 { sum / count } else { 0.0 };
    let of_angles = 2.0 / 3.0 * lever * tracker.body_sigma_rad.unwrap_or(0.0).powi(2);
    let sigma = tracker.body_coordinate()?;
    Some((sigma * sigma + of_angles).sqrt())
}

/// The tracker with the σ of where bodies are, some of which see it, instead of that of where they see it.
pub(crate) fn as_seen(tracker: &Tracker, poses: &Poses, inverse: &BTreeSet<String>) -> Tracker {
    let seen = inverse.iter().filter_map(|name| poses.bodies.get(name));
    Tracker {
        body_sigma: position_sigma(tracker, seen.flatten().flatten()),
        ..tracker.clone()
    }
}
