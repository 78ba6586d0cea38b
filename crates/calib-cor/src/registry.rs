//! All estimators in one table, and how to call one by name. What each is and needs stands in its file.

use calib_estimator::{EstimatorError, Input, Kind, Options};

use crate::{
    algebraic, ball_bundle, gamage, hotspot, hotspot_mixture, hotspot_ml, hyper_n,
    options::EstimatorInfo, outcome::Outcome, robust, score, sfa, sphere_eiv, sphere_ml,
};

const TABLE: &[EstimatorInfo] = &[
    hotspot::HSE,
    hotspot::HSA,
    algebraic::SFE,
    sfa::INFO,
    algebraic::KASA,
    algebraic::TAUBIN,
    algebraic::HYPER,
    hyper_n::INFO,
    gamage::GAMAGE_LASENBY,
    gamage::HALVORSEN,
    sphere_ml::INFO,
    sphere_eiv::INFO,
    hotspot_ml::INFO,
    hotspot_mixture::INFO,
    score::INFO,
    ball_bundle::INFO,
    robust::ROBUST,
    robust::CONSENSUS,
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
