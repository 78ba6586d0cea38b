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
    Verdict,
    levenberg::{Problem, Stop, minimize},
    measured::Pose,
};
use nalgebra::{Matrix3, Matrix6, Vector3, Vector6};

use crate::{
    hotspot::{HotSpot, Spread, finish, poses_of, prepare, single_axis, stack, weighed},
    outcome::{Known, Noise, NotObservable, Outcome, Rejected},
};
use calib_estimator::{EstimatorError, Input, Options};

/// Levenberg–Marquardt steps; the Hessian is approximate, so some dozens at 5° of noise.
const MAX_STEPS: usize = 200;
/// Rounds of re-estimating σ_t and σ_r.
const NOISE_ROUNDS: usize = 200;
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
    let covariance = covariance(&normal, spot.sums.n, options);
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
        estimated: options.sigma_t.is_none() || options.sigma_r.is_none(),
    };
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

struct Likelihood<'a> {
    poses: Vec<(&'a Pose, f64)>,
    /// Centers are relative to it.
    origin: Vector3<f64>,
    sigma_t: f64,
    sigma_r: f64,
    /// Size of the unknowns.
    scale: f64,
}

struct Normal {
    hessian: Matrix6<f64>,
    /// The part of the Hessian that the distances |q| contribute.
    of_radial: Matrix6<f64>,
    gradient: Vector6<f64>,
    cost: f64,
    /// Σ (|q| − |p|)².
    radial: f64,
    /// Σ ∠² |q||p|: squared arcs.
    arc: f64,
}

impl Problem for Likelihood<'_> {
    type Point = Vector6<f64>;
    type Normal = Normal;
    type Step = Vector6<f64>;

    fn linearize(&self, x: &Vector6<f64>) -> Normal {
        let (o, p): (Vector3<f64>, Vector3<f64>) =
            (x.fixed_rows::<3>(0).into(), x.fixed_rows::<3>(3).into());
        let (t2, r2) = (self.sigma_t * self.sigma_t, self.sigma_r * self.sigma_r);
        let length_p = p.norm();
        let unit_p = p / length_p;
        let across_p = Matrix3::identity() - unit_p * unit_p.transpose();
        let (mut turned, mut turned2) = (Vector3::zeros(), Matrix3::zeros());
        let (mut sum_b, mut sum_bww) = (0.0, Matrix3::zeros());
        let (mut sum_cr, mut sum_w) = (Matrix3::zeros(), 0.0);
        let (mut g_o, mut g_q, mut along_p) = (Vector3::zeros(), Vector3::zeros(), 0.0);
        let (mut n, mut cost, mut radial, mut arc, mut sum_e) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for &(pose, row) in &self.poses {
            // In the world: ŵ = R q̂ needs no rotation.
            let d = o - (pose.translation - self.origin);
            let length_q = d.norm();
            let unit_w = d / length_q;
            let unit_q = pose.rotation.tr_mul(&unit_w);
            let e = length_q - length_p;
            // ∠ from sine and cosine: accurate at both ends
            let (sine, cosine) = (unit_q.cross(&unit_p).norm(), unit_q.dot(&unit_p));
            let phi = sine.atan2(cosine);
            let ratio = if sine > 1e-9 { phi / sine } else { 1.0 };
            let product = length_q * length_p;
            // A row of weight `row` has both noises smaller by its root.
            let e_row = row * e;
            let w_alone = 1.0 / (r2 + t2 / product);
            let w = row * w_alone;
            n += row;
            cost += e_row * e / t2 + phi * phi * w;
            radial += e_row * e;
            arc += row * phi * phi * product;
            // ∇_q ∠²/2 = φ/sin φ (cos φ q̂ − p̂)/|q|, and likewise for p; ∂w/∂|q| = w² σ_t²/(|q|²|p|)
            let pull = 0.5 * phi * phi * w * w_alone * t2 / product;
            let swing = ratio * w;
            g_o += unit_w * (e_row / t2 + (pull + swing * cosine) / length_q)
                - pose.rotation * unit_p * (swing / length_q);
            g_q += unit_q * swing;
            along_p += pull + swing * cosine;
            // Gauss–Newton blocks: radial q̂, p̂; tangential (I − q̂q̂ᵀ)/|q|, (I − p̂p̂ᵀ)/|p|
            let b = w / (length_q * length_q);
            let c = w / product;
            let ww = unit_w * unit_w.transpose();
            turned += unit_w * row;
            turned2 += ww * row;
            sum_b += b;
            sum_bww += ww * b;
            sum_cr += (pose.rotation - unit_w * unit_q.transpose()) * c;
            sum_w += w;
            sum_e += e_row;
        }
        let g_p = unit_p * (along_p / length_p - sum_e / t2) - g_q / length_p;
        let h_oo = turned2 / t2 + Matrix3::identity() * sum_b - sum_bww;
        let h_op = -(turned * unit_p.transpose()) / t2 - sum_cr * across_p;
        let h_pp =
            unit_p * unit_p.transpose() * (n / t2) + across_p * (sum_w / (length_p * length_p));
        let mut hessian = Matrix6::zeros();
        hessian.fixed_view_mut::<3, 3>(0, 0).copy_from(&h_oo);
        hessian.fixed_view_mut::<3, 3>(0, 3).copy_from(&h_op);
        hessian
            .fixed_view_mut::<3, 3>(3, 0)
            .copy_from(&h_op.transpose());
        hessian.fixed_view_mut::<3, 3>(3, 3).copy_from(&h_pp);
        // Σ (R q̂, −p̂)(R q̂, −p̂)ᵀ / σ_t²
        let mut of_radial = Matrix6::zeros();
        let side = -turned * unit_p.transpose() / t2;
        of_radial
            .fixed_view_mut::<3, 3>(0, 0)
            .copy_from(&(turned2 / t2));
        of_radial.fixed_view_mut::<3, 3>(0, 3).copy_from(&side);
        of_radial
            .fixed_view_mut::<3, 3>(3, 0)
            .copy_from(&side.transpose());
        of_radial
            .fixed_view_mut::<3, 3>(3, 3)
            .copy_from(&(unit_p * unit_p.transpose() * (n / t2)));
        Normal {
            hessian,
            of_radial,
            gradient: stack(&g_o, &g_p),
            cost,
            radial,
            arc,
        }
    }

    fn cost(&self, normal: &Normal) -> f64 {
        normal.cost
    }

    fn solve(&self, normal: &Normal, damping: f64) -> Option<(Vector6<f64>, f64)> {
        let mut h = normal.hessian;
        for k in 0..6 {
            h[(k, k)] *= 1.0 + damping;
        }
        let step = -h.cholesky()?.solve(&normal.gradient);
        Some((
            step,
            -(step.dot(&normal.gradient) * 2.0 + step.dot(&(normal.hessian * step))),
        ))
    }

    fn retract(&self, x: &Vector6<f64>, step: &Vector6<f64>) -> Vector6<f64> {
        x + step
    }

    fn is_negligible(&self, _: &Vector6<f64>, step: &Vector6<f64>) -> bool {
        step.norm() <= 1e-15 * self.scale
    }
}
