//! Rules of every recording.

use calib_profile::{RecordingSpec, TimedPoses};

/// How near a measured joint must come to its target: 1°, 2 mm.
pub(super) const NEAR: (f64, f64) = (0.017_453_292_519_943_295, 2e-3);

/// Whether a motion is recorded instead of poses.
pub(super) fn is_continuous(spec: &RecordingSpec) -> bool {
    spec.timing
        .as_ref()
        .is_some_and(|timing| timing.poses == TimedPoses::Continuous)
}
