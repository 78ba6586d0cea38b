//! Two clocks: static holds, which need none, and the offset between a tracker's clock and a robot's.
//!
//! An error δt in the offset costs ω·r·δt: 0.5 rad/s × 1 m × 5 ms = 2.5 mm. Static poses cost nothing, so [`holds`]
//! come first; continuous motion is aligned by the angular speed, which needs no calibration because it is the same in
//! all frames of a body and its link ([`clock_offset`]):
//!
//! ```text
//! |ω_tracker(t)| = g·|ω_robot(τ)| + c,    t = τ + δ + ρ·(τ − τ̄)                                      (1)
//! ```

mod holds;
mod offset;
mod point;
mod rigid;

pub use holds::{Hold, HoldSettings, StaticPoses, holds, static_poses};
pub use offset::{ClockMap, OffsetOutcome, OffsetSettings, RotationTrack, clock_offset};
pub use point::{LinkTrack, PointTrack, clock_offset_of_point};
