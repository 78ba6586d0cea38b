//! Hot spot over all ratios of orientation to position noise, for few poses.
//!
//! ```text
//! o = Σ_λ w_λ o_λ,   p = Σ_λ w_λ p_λ            (crate::noise_ratio, 2)
//! ```
//!
//! [`crate::hotspot_ml`] takes the most likely ratio. With six to sixteen poses that is often one at which half of the residuals vanish; the
//! mean over all ratios is not drawn there, and its covariance holds. With hundreds of poses both are the same.

use calib_estimator::{EstimatorError, Input, InputKind, Options};
use nalgebra::Vector3;

use crate::{
    hotspot::{HotSpot, Spread, finish, poses_of, prepare, single_axis, weighed},
    noise_ratio,
    options::{EstimatorInfo, POSES},
    outcome::{Noise, Outcome},
};

/// What `hotspot_mixture` is and needs.
pub(crate) const INFO: EstimatorInfo = EstimatorInfo {
    id: "hotspot_mixture",
    name: "hot spot, over all noise ratios",
    input: InputKind::Poses,
    options: POSES,
    summary: "hotspot_ml with the ratio of both noises integrated over, for few poses",
    source: "joint likelihood, half-Cauchy prior on the ratio, see the book",
    fit,
};

const ID: &str = "hotspot_mixture";

/// The mean over the grid of noise ratios.
///
/// # Errors
/// [`EstimatorError`] for poses that are no rotations or not finite, or another kind of data.
pub fn fit(input: &Input<'_>, options: &Options) -> Result<Outcome, EstimatorError> {
    options.check()?;
    let poses = poses_of(input)?;
    let sums = match prepare(ID, poses, options)? {
        Ok(sums) => sums,
        Err(answer) => return Ok(answer),
    };
    let body_point = sums.body_point(0);
    let center = sums.center(&body_point);
    let mut spot = HotSpot {
        sums,
        body_point,
        center,
    };
    let spread_at =
        |spot: &HotSpot| Spread::of(weighed(poses, options), &spot.body_point, &spot.center);
    let spread = spread_at(&spot);
    if let Some(answer) = single_axis(ID, &spot, &spread, options) {
        return Ok(answer);
    }
    let seen: Vec<_> = weighed(poses, options).collect();
    let Some(mixture) = noise_ratio::mixture(&seen, &spot, options) else {
        let of = "poses";
        return Ok(Outcome::too_few(ID, spot.sums.n, 4, of));
    };
    let center: Vector3<f64> = mixture.mean.fixed_rows::<3>(0).into_owned();
    spot.center = center + spot.sums.mean_t;
    spot.body_point = mixture.mean.fixed_rows::<3>(3).into_owned();
    let spread = spread_at(&spot);
    let (along, across) = spread.sigmas(spot.sums.n);
    let reach = spot.body_point.norm();
    let of_rotation = (across * across - along * along).max(0.0).sqrt() / reach;
    let noise = Noise {
        sigma_t: options.sigma_t.unwrap_or(along),
        sigma_r: Some(options.sigma_r.unwrap_or(of_rotation)).filter(|s| s.is_finite()),
        estimated: options.sigma_t.is_none() || options.sigma_r.is_none(),
        contradicts: None,
    };
    let covariance = mixture.about(&spot);
    let noise = (noise, mixture.degrees_of_freedom);
    Ok(finish(
        ID,
        &spot,
        &spread,
        covariance,
        noise,
        Vec::new(),
        options,
    ))
}
