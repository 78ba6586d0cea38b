//! The residual of a registration that nominal errors explain, with C = σ_prior² per column and K = A_gᵀ(I − A_r A_r⁺)A_g:
//!
//! ```text
//! E f = tr(C K) + σ² ν,   var f = 2 tr((C K)²) + 2 σ⁴ ν           quantile of the matched gamma distribution
//! ```
//!
//! Where the noise is most of it (one joint that turns leaves nothing to the errors of the robot), its own scatter counts; where it is little, the
//! quantile of the robot's errors on top of the mean of the noise is the larger one, and is taken.
//!
//! On a link that it does not follow, a body is registered at any distance (28 m were seen), and from there a degree explains anything: errors act on
//! no longer an arm than a mount can have.

use nalgebra::DMatrix;

use super::data::Data;
use super::ids::SampleIndex;
use super::linear::{Model, prior_precision, projected};
use super::{Expected, Options};

/// Standard normal quantile of 99 %.
const Z99: f64 = 2.326;
/// A mount is no longer than this many times the reach of the joints that carry it.
const MOUNT_BY_REACH: f64 = 2.0;
/// Nor than this, m, where their reach is short.
const LONGEST_MOUNT: f64 = 2.0;

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
    let shorter = arm_beyond_reach(&model).powi(2);
    let (mean, variance) = (
        scaled.trace() / shorter,
        2.0 * scaled.norm_squared() / shorter.powi(2),
    );
    let of_noise = 2.0 * noise * noise / freedom;
    let high = (quantile(mean, variance) + noise).max(quantile(mean + noise, variance + of_noise));
    let rms = |f: f64| (3.0 * f / freedom).sqrt();
    Some(Expected {
        rms: rms(mean + noise),
        limit: rms(high),
    })
}

/// By how much the longest mount exceeds what a mount can be; 1 where none does.
fn arm_beyond_reach(model: &Model<'_>) -> f64 {
    let data = model.scan.data;
    let channels = model.scan.channels.len();
    let times = |k: usize| {
        let path = data
            .chain
            .path(data.bodies[model.scan.channels[k].body].link);
        if !path.iter().any(|j| model.geometry.contains(&j.0)) {
            return 1.0;
        }
        let joints = data.chain.joints();
        let reach: f64 = path
            .iter()
            .map(|j| joints[j.0].parent_from_joint.translation.vector.norm())
            .sum();
        let most = f64::max(MOUNT_BY_REACH * reach, LONGEST_MOUNT);
        let of_recordings = (0..model.scan.recordings).map(|r| r * channels + k);
        of_recordings
            .map(|at| model.fit.points[at].norm() / most)
            .fold(1.0, f64::max)
    };
    (0..channels).map(times).fold(1.0, f64::max)
}

/// 99 % of the gamma distribution with this mean and variance, by Wilson and Hilferty: its shape is mean²/variance.
fn quantile(mean: f64, variance: f64) -> f64 {
    let shape = (mean * mean / variance.max(f64::MIN_POSITIVE)).max(1e-3);
    let root = 1.0 - 1.0 / (9.0 * shape) + Z99 / (3.0 * shape.sqrt());
    mean * root.powi(3)
}
