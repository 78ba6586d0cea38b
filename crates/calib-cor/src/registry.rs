//! All estimators in one table: what each needs and how to call it by name.

use crate::{
    algebraic::{self, Algebraic},
    ball_bundle, gamage, hotspot, hotspot_mixture, hotspot_ml, hyper_n,
    outcome::{CorEstimate, Outcome},
    robust, score, sfa, sphere_eiv, sphere_ml,
};
use calib_estimator::{
    EstimatorError, Input, InputKind, Kind, OptionId,
    OptionId::{
        Covariances, NoisePerMarker, Seed, SigmaR, SigmaT, Significance, Subsets, WeakFraction,
        Weights,
    },
    Options,
};

/// One estimator of a center.
pub type EstimatorInfo = calib_estimator::EstimatorInfo<CorEstimate>;

/// What every sphere uses.
const COMMON: &[OptionId] = &[SigmaT, Weights, Significance, WeakFraction];
/// Random starts.
const SEEDED: &[OptionId] = &[SigmaT, Weights, Significance, WeakFraction, Seed];
/// Spheres that weigh samples by their covariance, or markers by a noise of their own.
const WEIGHING: &[OptionId] = &[
    SigmaT,
    Covariances,
    Weights,
    NoisePerMarker,
    Significance,
    WeakFraction,
];
/// Linear estimators on poses: only the orientation noise enters their test.
const ROTATIONS: &[OptionId] = &[SigmaR, Weights, Significance, WeakFraction];
/// Poses, errors in variables.
const POSES: &[OptionId] = &[SigmaT, SigmaR, Weights, Significance, WeakFraction];
/// Random subsets of points or poses.
const RANDOM: &[OptionId] = &[
    SigmaT,
    SigmaR,
    Weights,
    Significance,
    WeakFraction,
    Seed,
    Subsets,
];

const TABLE: &[EstimatorInfo] = &[
    EstimatorInfo {
        id: "hse",
        name: "hot spot, exact",
        input: InputKind::Poses,
        options: ROTATIONS,
        summary: "linear least squares by singular values; biased by orientation noise",
        source: "Tuceryan et al. 1995; paper §3.1.1",
        fit: hotspot::hse,
    },
    EstimatorInfo {
        id: "hsa",
        name: "hot spot, iterative",
        input: InputKind::Poses,
        options: ROTATIONS,
        summary: "the same least squares by conjugate gradients",
        source: "paper §3.1.2",
        fit: hotspot::hsa,
    },
    EstimatorInfo {
        id: "sfe",
        name: "sphere fit, Pratt's constraint, exact",
        input: InputKind::Points,
        options: COMMON,
        summary: "closed form on centered data",
        source: "Pratt 1987; Chang & Pollard 2007; paper §3.2.1",
        fit: |input, options| algebraic::fit(Algebraic::Pratt, input, options),
    },
    EstimatorInfo {
        id: "sfa",
        name: "sphere fit, Pratt's constraint, COBYLA",
        input: InputKind::Points,
        options: SEEDED,
        summary: "constrained linear approximation from ten seeded starts",
        source: "Powell 1994; paper §3.2.2",
        fit: sfa::fit,
    },
    EstimatorInfo {
        id: "kasa",
        name: "sphere fit, linear",
        input: InputKind::Points,
        options: COMMON,
        summary: "one linear solve; radius and center shrink on small ranges of motion",
        source: "Kåsa 1976",
        fit: |input, options| algebraic::fit(Algebraic::Kasa, input, options),
    },
    EstimatorInfo {
        id: "taubin",
        name: "sphere fit, gradient-weighted",
        input: InputKind::Points,
        options: COMMON,
        summary: "closed form, radius bias 3/5 of Pratt's",
        source: "Taubin 1991",
        fit: |input, options| algebraic::fit(Algebraic::Taubin, input, options),
    },
    EstimatorInfo {
        id: "hyper",
        name: "sphere fit without second-order bias",
        input: InputKind::Points,
        options: COMMON,
        summary: "closed form with the constraint (5T − 3P)/2",
        source: "Al-Sharadqah & Chernov 2009, in three dimensions",
        fit: |input, options| algebraic::fit(Algebraic::Hyper, input, options),
    },
    EstimatorInfo {
        id: "hyper_n",
        name: "sphere fit without second-order bias, for few samples",
        input: InputKind::Points,
        options: COMMON,
        summary: "hyper with the terms of order 1/n",
        source: "Rangarajan & Kanatani 2009 (HyperLS)",
        fit: hyper_n::fit,
    },
    EstimatorInfo {
        id: "gamage_lasenby",
        name: "several markers, linear",
        input: InputKind::Points,
        options: COMMON,
        summary: "each marker weighs the same; the several-marker Kåsa fit",
        source: "Gamage & Lasenby 2002",
        fit: gamage::gamage_lasenby,
    },
    EstimatorInfo {
        id: "halvorsen",
        name: "several markers, bias-compensated",
        input: InputKind::Points,
        options: COMMON,
        summary: "Gamage & Lasenby with the noise taken off; one marker: Taubin",
        source: "Halvorsen 2003",
        fit: gamage::halvorsen,
    },
    EstimatorInfo {
        id: "ml_sphere",
        name: "several markers, maximum likelihood",
        input: InputKind::Points,
        options: WEIGHING,
        summary: "common center, own radii; per-marker noise and 3 × 3 covariances on request",
        source: "orthogonal-distance sphere, joint likelihood, see the book",
        fit: sphere_ml::fit,
    },
    EstimatorInfo {
        id: "sphere_eiv",
        name: "several markers, errors in variables",
        input: InputKind::Points,
        options: WEIGHING,
        summary: "ml_sphere with foot points in the metric of the covariances, the bias of the center taken off",
        source: "Box 1971; Kanatani 2008",
        fit: sphere_eiv::fit,
    },
    EstimatorInfo {
        id: "hotspot_ml",
        name: "hot spot, errors in variables",
        input: InputKind::Poses,
        options: POSES,
        summary: "weighs orientation against position noise, stated or estimated",
        source: "joint likelihood, see the book",
        fit: hotspot_ml::fit,
    },
    EstimatorInfo {
        id: "hotspot_mixture",
        name: "hot spot, over all noise ratios",
        input: InputKind::Poses,
        options: POSES,
        summary: "hotspot_ml with the ratio of both noises integrated over, for few poses",
        source: "joint likelihood, half-Cauchy prior on the ratio, see the book",
        fit: hotspot_mixture::fit,
    },
    EstimatorInfo {
        id: "score",
        name: "center between two moving bodies",
        input: InputKind::TwoBodies,
        options: ROTATIONS,
        summary: "least squares over both local centers",
        source: "Ehrig et al. 2006 (SCoRE)",
        fit: score::fit,
    },
    EstimatorInfo {
        id: "ball_bundle",
        name: "markers of a rigid body, jointly",
        input: InputKind::Markers,
        options: COMMON,
        summary: "center, marker layout and all orientations at once; markers may be occluded",
        source: "joint likelihood, see the book",
        fit: ball_bundle::fit,
    },
    EstimatorInfo {
        id: "robust",
        name: "center with outliers",
        input: InputKind::PointsOrPoses,
        options: RANDOM,
        summary: "consensus, then each sample belongs in part, maximum likelihood of the inliers",
        source: "Dempster et al. 1977; evidence for each choice, see the book",
        fit: robust::robust,
    },
    EstimatorInfo {
        id: "consensus",
        name: "center by random subsets",
        input: InputKind::PointsOrPoses,
        options: RANDOM,
        summary: "the choice of inliers with the greatest evidence, noise stated or not; inliers refitted",
        source: "Torr & Zisserman 2000; Moisan & Stival 2004",
        fit: robust::consensus,
    },
];

calib_estimator::offers!(
    Kind::Center,
    TABLE: EstimatorInfo,
    "All estimators, the paper's four first."
    estimators,
    estimator
);

/// Runs the estimator called `id`.
///
/// # Errors
/// [`EstimatorError`] for an unknown name, data of another kind, data that are not finite, or an option that the estimator does not
/// use ([`Options::only`] keeps those that it uses).
pub fn fit(id: &str, input: &Input<'_>, options: &Options) -> Result<Outcome, EstimatorError> {
    estimator(id)?.run(input, options)
}
