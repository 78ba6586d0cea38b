//! What the estimators of centers, axes, frames and hand-eye transforms share.
//!
//! * [`measured`]: samples with gaps, poses, marker tracks and the gathered cloud, checked once.
//! * [`verdict`]: why an estimate is trusted, or what stands in its way.
//! * [`mod@factor`], [`pose_sums`]: the sums that planes, spheres and shared axes need.
//! * [`levenberg`]: the minimizer of small problems on a manifold. [`chance`]: tail probabilities.

pub mod chance;
pub mod factor;
pub mod levenberg;
pub mod measured;
pub mod pose_sums;
pub mod verdict;

pub use verdict::Verdict;
