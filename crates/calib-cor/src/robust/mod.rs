//! Outliers: which samples belong to the joint is decided by the evidence for each choice, then they are fitted plainly.
//!
//! ```text
//! h of n samples are within the noise, the others either off by any order of magnitude alike, or anywhere as far as the farthest:
//! density 1/(S_q |d|^q D) or 1/(V_q d_max^q), whichever explains them better. Residuals of q components, p unknowns, ν = qh − p, RSS their squares.  σ integrated out with the prior 1/σ:
//! cost(h) = ν/2 ln(π RSS) − ln Γ(ν/2) − Σ_out ln density + ln C(n, h)                              (1)
//! cost(h) = RSS/2σ² + ν ln(σ√2π)      − Σ_out ln density + ln C(n, h)        where σ is stated        (2)
//! S₁ = V₁ = 2,  S₃ = 4π,  V₃ = 4π/3,  D = ln 10⁴: four decades;   h ≥ (n + p/q + 1)/2
//! ```
//!
//! Subsets give candidates; each is refitted to the samples of least cost until they stand still, the cheapest wins (`consensus`).
//! `robust` then lets every sample belong in part (expectation and maximization over the same two classes) before it decides, and fits by
//! maximum likelihood, so that the covariance is valid. For `consensus` every sample belongs in the end whose residual would not surprise among n (χ², one
//! recording in twenty). Meters or millimeters do not matter.
//!
//! Where another center explains the samples almost as well (cost within `RIVAL`) the answer is that there is none: this is where the
//! method breaks down, and it says so (nine points with three outliers leave two degrees of freedom). Likewise where, with some left out, fewer degrees of
//! freedom are left than there are unknowns and the noise is not stated; and where the center rests on one sample that no other confirms: with redundancy
//! 1 − h_k (leverage h_k) an error of σ/√(1 − h_k) hides in the noise and takes the center |C J_k|σ/√(1 − h_k) away (external reliability, Baarda 1968);
//! beyond `weak_fraction` of the size nobody can know which sample is the wrong one. A choice of h among n samples makes a circle look
//! less planar by chance: the test of one axis is therefore made at `significance / C(n, h)`.
//! Torr & Zisserman 2000 (MSAC); Moisan & Stival 2004 (a threshold from the data); Dempster et al. 1977.

mod choice;
mod evidence;
mod hot_spots;
mod spheres;

use calib_estimator::{EstimatorError, Input, InputKind, Options};
use nalgebra::Vector3;

use crate::{
    options::{EstimatorInfo, RANDOM},
    outcome::Outcome,
    seeded::Seeded,
};

/// What `robust` is and needs.
pub(crate) const ROBUST: EstimatorInfo = EstimatorInfo {
    id: "robust",
    name: "center with outliers",
    input: InputKind::PointsOrPoses,
    options: RANDOM,
    summary: "consensus, then weighted by membership, maximum likelihood of the inliers",
    source: "Dempster et al. 1977; evidence for each choice, see the book",
    fit: robust,
};

/// Robust fit: spheres for points and markers, hot spot for poses.
///
/// # Errors
/// [`EstimatorError`] for data that are not finite, not rotations, or of another kind.
pub fn robust(input: &Input<'_>, options: &Options) -> Result<Outcome, EstimatorError> {
    dispatch("robust", input, options, true)
}

fn dispatch(
    estimator: &'static str,
    input: &Input<'_>,
    options: &Options,
    reweight: bool,
) -> Result<Outcome, EstimatorError> {
    options.check()?;
    match input {
        Input::Poses(poses) => hot_spots::fit(estimator, poses, options, reweight),
        _ => spheres::fit(estimator, input, options, reweight),
    }
}

/// What `consensus` is and needs.
pub(crate) const CONSENSUS: EstimatorInfo = EstimatorInfo {
    id: "consensus",
    name: "center by random subsets",
    input: InputKind::PointsOrPoses,
    options: RANDOM,
    summary: "inliers selected by marginal likelihood, noise stated or not; inliers refitted",
    source: "Torr & Zisserman 2000; Moisan & Stival 2004",
    fit: consensus,
};

/// Consensus alone, inliers refitted: spheres for points and markers, the linear hot spot for poses
/// (what the field calls RANSAC pivot calibration).
///
/// # Errors
/// As [`robust`].
pub fn consensus(input: &Input<'_>, options: &Options) -> Result<Outcome, EstimatorError> {
    dispatch("consensus", input, options, false)
}

/// A model that can be fitted with weights and measured against each sample.
trait Model {
    type Estimate: Clone;
    /// Components of a residual.
    const COMPONENTS: usize;
    /// Unknowns.
    fn unknowns(&self) -> usize;
    fn samples(&self) -> usize;
    /// Where sample k is.
    fn place(&self, k: usize) -> Vector3<f64>;
    fn subset_fit(&self, random: &mut Seeded) -> Option<Self::Estimate>;
    /// `|residual|²` of sample k, as of one of weight 1.
    fn square(&self, estimate: &Self::Estimate, k: usize) -> f64;
    fn weighted(&self, start: &Self::Estimate, weights: &[f64]) -> Option<Self::Estimate>;
    /// What an error of one of the samples that are kept does, where a single one may decide: for each (sample, redundancy, shift).
    /// Redundancy is the part of the error's square that its own residual shows, shift how far an error of one unit takes the center.
    fn influence(&self, estimate: &Self::Estimate, keep: &[bool]) -> Vec<(usize, f64, f64)>;
    /// The center, and the size of the joint: a center further off than a tenth of it is another one.
    fn center(&self, estimate: &Self::Estimate) -> (Vector3<f64>, f64);
}
