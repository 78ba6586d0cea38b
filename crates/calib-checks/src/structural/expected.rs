//! The residual of a registration that nominal errors explain, with C = σ_prior² per column and K = A_gᵀ(I − A_r A_r⁺)A_g:
//!
//! ```text
//! E f = tr(C K) + σ² ν,   var f = 2 tr((C K)²) + 2 σ⁴ ν           quantile of the matched gamma distribution
//! ```
//!
//! Where the noise is most of it (one joint that turns leaves nothing to the errors of the robot), its own scatter counts; where it is little, the
//! quantile of the robot's errors on top of the mean of the noise is the larger one, and is taken.

use nalgebra::DMatrix;

use super::data::Data;
use super::ids::SampleIndex;
use super::linear::{Model, prior_precision, projected};
use super::{Expected, Options};

/// Standard normal quantile of 99 %.
const Z99: f64 = 2.326;
/// What nominal errors within the priors make of the registration residual.
pub(crate) fn expected(
    data: &Data,
    screened: &[SampleIndex],
    options: &Options,
) -> Option<Expected> {
    let model = Model::new(data, &[], screened);
    let sums = model.sums(0.0);
    let (m, g) = (model.registration, 6 * model.geometry.len());
    let cross = sums.gram.view((0, m), (m, g)).into_owned();
    let own = sums.gram.view((m, m), (g, g)).into_owned();
    let k = projected(&sums.gram, cross, own)?;
    let c = prior_precision(&model, options);
    // C^½ K C^½
    let scaled = DMatrix::from_fn(g, g, |a, b| k[(a, b)] / (c[a] * c[b]).sqrt());
    let (_, freedom) = model.scan.freedom();
    if freedom <= 0.0 {
        return None;
    }
    let noise = options.sigma * options.sigma * freedom;
    let (mean, variance) = (scaled.trace(), 2.0 * scaled.norm_squared());
    let of_noise = 2.0 * noise * noise / freedom;
    let high = (quantile(mean, variance) + noise).max(quantile(mean + noise, variance + of_noise));
    let rms = |f: f64| (3.0 * f / freedom).sqrt();
    Some(Expected {
        rms: rms(mean + noise),
        limit: rms(high),
    })
}

/// 99 % of the gamma distribution with this mean and variance, by Wilson and Hilferty: its shape is mean²/variance.
fn quantile(mean: f64, variance: f64) -> f64 {
    let shape = (mean * mean / variance.max(f64::MIN_POSITIVE)).max(1e-3);
    let root = 1.0 - 1.0 / (9.0 * shape) + Z99 / (3.0 * shape.sqrt());
    mean * root.powi(3)
}
