//! Hot spot by maximum likelihood: rotation noise is weighed against position noise.
//!
//! ```text
//! q_i = R_iᵀ (o − t_i)      where sample i sees the center in the body
//! minimize Σ (|q_i| − |p|)² / σ_t² + ∠(q_i, p)² / (σ_r² + σ_t² / (|q_i||p|))              (1)
//! ```
//!
//! The distance from body to center carries position noise alone, the direction mostly orientation noise.
//! For σ_r → 0 this is the hot spot of least squares, for σ_r → ∞ a sphere fit: it contains both and beats both.
//! The gradient of (1) is exact, weights included; the Hessian is Gauss–Newton's. Where σ are not stated
//! they follow from the residuals: σ_t² = Σ(|q|−|p|)²/(n−2) and
//! σ_t² + |p|² σ_r² = Σ∠²|q||p|/(2n−4).
//! Without the test of one axis it diverges along the axis; the test is part of it.

use calib_estimator::{
    InputKind, Verdict,
    levenberg::{Stop, minimize},
    measured::Pose,
};
use nalgebra::Matrix6;

use crate::{
    hotspot::{HotSpot, Spread, finish, poses_of, prepare, single_axis, stack, weighed},
    noise_ratio,
    options::{EstimatorInfo, POSES},
    outcome::{Known, Noise, NotObservable, Outcome, Rejected},
    pivot::{Likelihood, Normal},
};
use calib_estimator::{EstimatorError, Input, Options};

/// What `hotspot_ml` is and needs.
pub(crate) const INFO: EstimatorInfo = EstimatorInfo {
    id: "hotspot_ml",
    name: "hot spot, errors in variables",
    input: InputKind::Poses,
    options: POSES,
    summary: "weighs orientation against position noise, stated or estimated",
    source: "joint likelihood, see the book",
    fit,
};

/// Levenberg–Marquardt steps; the Hessian is approximate, so some dozens at 5° of noise.
const MAX_STEPS: usize = 200;
/// Rounds of re-estimating σ_t and σ_r.
const NOISE_ROUNDS: usize = 200;
/// Poses up to which the ratio of both noises is integrated over ([`crate::noise_ratio`]); beyond, their maximum likelihood is as good.
const FEW: usize = 64;
/// Distance between body and center, in σ_t, below which the angle at the center means nothing.
const AT_THE_CENTER: f64 = 5.0;
/// σ_t as a part of the geometry's size below which data count as exact.
const EXACT: f64 = 1e-12;

/// The maximum-likelihood hot spot; σ_t and σ_r from [`Options`] or estimated.
///
/// # Errors
/// [`EstimatorError`] for poses that are no rotations or not finite, or another kind of data.
pub fn fit(input: &Input<'_>, options: &Options) -> Result<Outcome, EstimatorError> {
    fit_poses("hotspot_ml", poses_of(input)?, options, Vec::new())
}

pub(crate) fn fit_poses(
    estimator: &'static str,
    poses: &[Option<Pose>],
    options: &Options,
    rejected: Vec<Rejected>,
) -> Result<Outcome, EstimatorError> {
    options.check()?;
    let sums = match prepare(estimator, poses, options)? {
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
    let spread = Spread::of(weighed(poses, options), &spot.body_point, &spot.center);
    if let Some(answer) = single_axis(estimator, &spot, &spread, options) {
        return Ok(answer);
    }
    if spot.body_point.norm()
        <= AT_THE_CENTER * options.sigma_t.unwrap_or(spread.sigmas(spot.sums.n).0)
    {
        // The direction to the center is noise: orientations carry no lever, and least squares is the likelihood.
        return crate::hotspot::linear(estimator, poses, options, rejected, |sums, _| {
            sums.body_point(0)
        });
    }
    let (sigma_t, sigma_r, normal) = maximize(poses, &mut spot, &spread, options);
    let reach = spot.body_point.norm();
    let start_reach = body_point.norm() + spread.sigmas(spot.sums.n).1;
    let estimated = options.sigma_t.is_none() || options.sigma_r.is_none();
    let (covariance, freedom) = if estimated && spot.sums.n <= FEW {
        let seen: Vec<(&Pose, f64)> = weighed(poses, options).collect();
        let mixture = noise_ratio::mixture(&seen, &spot, options);
        mixture.map_or((None, None), |m| {
            (Some(m.about(&spot)), m.degrees_of_freedom)
        })
    } else {
        let freedom = estimated.then_some(3.0 * spot.sums.n as f64 - 6.0);
        (covariance(&normal, spot.sums.n, options), freedom)
    };
    let (Some(covariance), true) = (covariance, reach.is_finite() && reach < 100.0 * start_reach)
    else {
        return Ok(Outcome::NotObservable(NotObservable {
            estimator,
            verdict: Verdict::Diverged,
            reason: format!("the estimate diverged: the center is {reach:.1e} away from the body"),
            known: Known::Nothing,
        }));
    };
    let noise = Noise {
        sigma_t,
        sigma_r: Some(sigma_r),
        estimated,
        contradicts: None,
    };
    let noise = (noise, freedom);
    let spread = Spread::of(weighed(poses, options), &spot.body_point, &spot.center);
    Ok(finish(
        estimator, &spot, &spread, covariance, noise, rejected, options,
    ))
}

/// Moves `spot` to the maximum; returns σ_t, σ_r and the normal equations there.
fn maximize(
    poses: &[Option<Pose>],
    spot: &mut HotSpot,
    spread: &Spread,
    options: &Options,
) -> (f64, f64, Normal) {
    let n = spot.sums.n as f64;
    let scale = spot.body_point.norm() + spread.sigmas(spot.sums.n).1;
    let floor = EXACT * scale.max(f64::MIN_POSITIVE);
    let (along, across) = spread.sigmas(spot.sums.n);
    let mut sigma_t = options.sigma_t.unwrap_or(along.max(floor));
    let mut sigma_r = options.sigma_r.unwrap_or_else(|| {
        ((across * across - along * along).max(0.0)).sqrt() / spot.body_point.norm().max(floor)
    });
    let mut x = stack(&(spot.center - spot.sums.mean_t), &spot.body_point);
    let mut last;
    let mut round = 0;
    let fixed = options.sigma_t.is_some() && options.sigma_r.is_some();
    let mut change = f64::INFINITY;
    let mut seen: Vec<(&Pose, f64)> = Vec::with_capacity(spot.sums.n);
    seen.extend(weighed(poses, options));
    loop {
        let problem = Likelihood {
            poses: std::mem::take(&mut seen),
            origin: spot.sums.mean_t,
            sigma_t,
            sigma_r,
            scale,
        };
        // While the noise levels still move, a few steps for each round are enough.
        let steps = if fixed || change < 1e-7 { MAX_STEPS } else { 2 };
        let end = minimize(&problem, x, steps);
        if end.stop == Stop::Broken {
            x.fill(f64::NAN);
        } else {
            x = end.x;
        }
        last = end.normal;
        seen = problem.poses;
        round += 1;
        let (old_t, old_r) = (sigma_t, sigma_r);
        if options.sigma_t.is_none() {
            sigma_t = (last.radial / (n - 2.0)).sqrt().max(floor);
        }
        if options.sigma_r.is_none() {
            let across2 = last.arc / (2.0 * n - 4.0);
            let reach = x.fixed_rows::<3>(3).norm().max(floor);
            sigma_r = (across2 - sigma_t * sigma_t).max(0.0).sqrt() / reach;
        }
        let last_change = change;
        change = (sigma_t / old_t - 1.0)
            .abs()
            .max((sigma_r - old_r).abs() / (sigma_r + sigma_t / scale));
        if fixed
            || (change < 1e-11 && last_change < 1e-7)
            || round >= NOISE_ROUNDS
            || !x.iter().all(|v| v.is_finite())
        {
            break;
        }
    }
    spot.center = x.fixed_rows::<3>(0) + spot.sums.mean_t;
    spot.body_point = x.fixed_rows::<3>(3).into_owned();
    (sigma_t, sigma_r, last)
}

/// H⁻¹; estimated noise levels are first raised by the degrees of freedom that each kind of residual loses to
/// the unknowns (few poses spend most of the radial residuals on the center).
fn covariance(normal: &Normal, n: usize, options: &Options) -> Option<Matrix6<f64>> {
    let inverse = normal.hessian.cholesky()?.inverse();
    let n = n as f64;
    let share = (inverse * normal.of_radial).trace();
    // As estimated: n − 2 and 2n − 4.
    let radial = if options.sigma_t.is_none() {
        (n - share).max(0.5) / (n - 2.0)
    } else {
        1.0
    };
    let across = if options.sigma_r.is_none() {
        (2.0 * n - 6.0 + share).max(0.5) / (2.0 * n - 4.0)
    } else {
        1.0
    };
    let of_across = normal.hessian - normal.of_radial;
    Some(
        (normal.of_radial * radial + of_across * across)
            .cholesky()?
            .inverse(),
    )
}
