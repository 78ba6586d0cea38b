//! Hot spot: the point of a body that stands still in the world (HSE, HSA).
//!
//! ```text
//! R_i p − o = −t_i,        A x = b with A = [R_i  −I], x = [p; o]        (paper Eq. 2)
//! HSE: x = A⁺ b             HSA: min ‖b − Ax‖² by conjugate gradients     (paper Eqs. 3–5)
//! ```
//!
//! Both are the same least-squares point. It is inconsistent: noise in R_i enters the matrix, and the answer
//! is drawn towards the mean position by about σ_r² over the spread of the rotations (7 mm at ±10° and 1°).
//! [`crate::hotspot_ml`] has no such bias. The covariance is that of the noise the residuals show along and across p, and of the bias:
//!
//! ```text
//! noise lengthens M = Σ(R_i − R̄)ᵀ(R_i − R̄) by 2(n − 1)σ_r²:   δp = −Σ_k v_k (v_k·p) shift/(λ_k − shift)      (6)
//! ```

use crate::options::{EstimatorInfo, ROTATIONS};
use calib_estimator::pose_sums::PoseSums;
use calib_estimator::{
    InputKind, Verdict,
    measured::{Pose, RowWeights},
};
use calib_geometry::Line;
use nalgebra::{Matrix3, Matrix6, Point3, Vector3, Vector6};

use crate::outcome::{CorEstimate, Known, Noise, NotObservable, Outcome, Rejected, Shape};
use calib_estimator::{EstimatorError, Input, Options};

/// A gradient this much smaller than at the start is rounding of the sums it is made of.
const ROUNDING: f64 = 1e-14;
/// Conjugate gradients may rise on the way; from here on a rise is rounding.
const SMALL: f64 = 1e-8;
/// Conjugate gradients end after as many steps as there are unknowns; twice for rounding.
const CG_STEPS: usize = 24;

/// A body point and a center, with the sums they came from.
#[derive(Debug, Clone)]
pub(crate) struct HotSpot {
    pub sums: PoseSums,
    pub body_point: Vector3<f64>,
    pub center: Vector3<f64>,
}

/// Poses with their rows and weights; lost rows and those of weight 0 are left out.
pub(crate) fn weighed<'a>(
    poses: &'a [Option<Pose>],
    options: &'a Options,
) -> impl Iterator<Item = (&'a Pose, f64)> + Clone {
    let weights = RowWeights(&options.weights);
    poses
        .iter()
        .enumerate()
        .filter_map(move |(row, pose)| Some((pose.as_ref()?, weights.of(row))))
        .filter(|(_, w)| *w > 0.0)
}

/// Residuals `R_iᵀ(o − t_i) − p` split along and across p.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Spread {
    /// Weighted sum of squares along p.
    pub along: f64,
    /// Weighted sum of squares across p.
    pub across: f64,
    /// Σ w (R_i p̂)(R_i p̂)ᵀ.
    pub directions: Matrix3<f64>,
}

impl Spread {
    pub fn of<'a>(
        poses: impl Iterator<Item = (&'a Pose, f64)>,
        body_point: &Vector3<f64>,
        center: &Vector3<f64>,
    ) -> Self {
        let unit = body_point.try_normalize(0.0).unwrap_or_else(Vector3::x);
        let (mut along, mut total) = (0.0, 0.0);
        let mut directions = Matrix3::zeros();
        for (pose, w) in poses {
            let turned = pose.rotation * unit;
            let e = center - pose.translation - pose.rotation * body_point;
            let a = e.dot(&turned);
            along += w * a * a;
            total += w * e.norm_squared();
            directions += turned * (turned * w).transpose();
        }
        Self {
            along,
            across: (total - along).max(0.0),
            directions,
        }
    }

    /// (σ along, σ across) with the degrees of freedom n − 2 and 2n − 4.
    pub fn sigmas(&self, n: usize) -> (f64, f64) {
        let dof = (n as f64 - 2.0).max(1.0);
        (
            (self.along / dof).sqrt(),
            (self.across / (2.0 * dof)).sqrt(),
        )
    }
}

/// What `hse` is and needs.
pub(crate) const HSE: EstimatorInfo = EstimatorInfo {
    id: "hse",
    name: "hot spot, exact",
    input: InputKind::Poses,
    options: ROTATIONS,
    summary: "linear least squares by singular values; biased by orientation noise",
    source: "Tuceryan et al. 1995; paper §3.1.1",
    fit: hse,
};

/// HSE.
///
/// # Errors
/// [`EstimatorError`] for poses that are no rotations or not finite, or another kind of data.
pub fn hse(input: &Input<'_>, options: &Options) -> Result<Outcome, EstimatorError> {
    let poses = poses_of(input)?;
    linear("hse", poses, options, Vec::new(), |sums, _| {
        sums.body_point(0)
    })
}

/// What `hsa` is and needs.
pub(crate) const HSA: EstimatorInfo = EstimatorInfo {
    id: "hsa",
    name: "hot spot, iterative",
    input: InputKind::Poses,
    options: ROTATIONS,
    summary: "the same least squares by conjugate gradients",
    source: "paper §3.1.2",
    fit: hsa,
};

/// HSA: the same by conjugate gradients on the normal equations, without factorizing them.
///
/// # Errors
/// As [`hse`].
pub fn hsa(input: &Input<'_>, options: &Options) -> Result<Outcome, EstimatorError> {
    let poses = poses_of(input)?;
    linear("hsa", poses, options, Vec::new(), |sums, poses| {
        conjugate_gradients(sums, weighed(poses, options))
    })
}

pub(crate) fn poses_of<'a>(input: &Input<'a>) -> Result<&'a [Option<Pose>], EstimatorError> {
    match *input {
        Input::Poses(poses) => Ok(poses),
        _ => Err(input.wrong(InputKind::Poses)),
    }
}

pub(crate) fn linear(
    estimator: &'static str,
    poses: &[Option<Pose>],
    options: &Options,
    rejected: Vec<Rejected>,
    solve: impl Fn(&PoseSums, &[Option<Pose>]) -> Vector3<f64>,
) -> Result<Outcome, EstimatorError> {
    options.check()?;
    let sums = match prepare(estimator, poses, options)? {
        Ok(sums) => sums,
        Err(answer) => return Ok(answer),
    };
    let body_point = solve(&sums, poses);
    let center = sums.center(&body_point);
    let spot = HotSpot {
        sums,
        body_point,
        center,
    };
    let spread = Spread::of(weighed(poses, options), &spot.body_point, &spot.center);
    if let Some(answer) = single_axis(estimator, &spot, &spread, options) {
        return Ok(answer);
    }
    let (sigma_along, sigma_across) = noise_levels(&spot, &spread);
    let reach = spot.body_point.norm();
    let sigma_r2 = (sigma_across * sigma_across - sigma_along * sigma_along) / (reach * reach);
    let drawn = drawn(&spot, options.sigma_r.map_or(sigma_r2.max(0.0), |s| s * s));
    let covariance =
        sandwich(&spot, &spread, sigma_along, sigma_across) + drawn * drawn.transpose();
    let of_rotation = (sigma_r2 > 0.0 && sigma_r2.is_finite()).then(|| sigma_r2.sqrt());
    let noise = Noise::seen(sigma_along, of_rotation);
    let noise = (noise, Some(3.0 * spot.sums.n as f64 - 6.0));
    Ok(finish(
        estimator, &spot, &spread, covariance, noise, rejected, options,
    ))
}

/// Sums and rank; the inner `Err` is the answer where the rank already says no.
pub(crate) fn prepare(
    estimator: &'static str,
    poses: &[Option<Pose>],
    options: &Options,
) -> Result<Result<PoseSums, Outcome>, EstimatorError> {
    let sums = PoseSums::weighted(poses, RowWeights(&options.weights))?;
    Ok(match sums.rank_verdict() {
        None => Ok(sums),
        Some(Verdict::TooFew) => Err(Outcome::too_few(estimator, sums.n, 3, "poses")),
        Some(verdict) => {
            let (s1, s6) = sums.extreme_singular_values();
            let reason = match verdict {
                Verdict::NoRotation => format!(
                    "the body does not turn: its rotations differ by {:.1e} rad rms",
                    (sums.lambda.sum().max(0.0) / 2.0 / sums.total).sqrt()
                ),
                _ if sums.n == 2 => "two poses always share one axis of rotation".to_string(),
                _ => format!(
                    "all rotations share one axis (smallest singular value {s6:.1e} of {s1:.1e}): every \
                     point of the axis fits equally well"
                ),
            };
            Err(not_observable(estimator, &sums, verdict, reason))
        }
    })
}

/// The statistical tests, with the noise that the residuals of a fit allow.
pub(crate) fn single_axis(
    estimator: &'static str,
    spot: &HotSpot,
    spread: &Spread,
    options: &Options,
) -> Option<Outcome> {
    let (_, sigma_across) = spread.sigmas(spot.sums.n);
    let bound = sigma_across / spot.body_point.norm();
    let (verdict, reason) =
        spot.sums
            .noise_verdict(options.sigma_r, bound, 1.0, options.significance)?;
    Some(not_observable(estimator, &spot.sums, verdict, reason))
}

fn not_observable(
    estimator: &'static str,
    sums: &PoseSums,
    verdict: Verdict,
    reason: String,
) -> Outcome {
    let known = if verdict == Verdict::SingleAxis {
        let (_, world) = sums.axis();
        let point = sums.center(&sums.body_point(1));
        Known::AxisLine(Line {
            point: Point3::from(point),
            direction: world,
        })
    } else {
        Known::Nothing
    };
    Outcome::NotObservable(NotObservable {
        estimator,
        verdict,
        reason,
        known,
    })
}

/// (σ along, σ across) with the degrees of freedom that each kind of residual loses to the six unknowns:
/// `tr((A'A)⁻¹ Σ A_iᵀ R_i p̂p̂ᵀ R_iᵀ A_i)` for those along p, the rest across.
fn noise_levels(spot: &HotSpot, spread: &Spread) -> (f64, f64) {
    let n = spot.sums.n as f64;
    let share = (inverse_normal(&spot.sums) * middle(spot, spread, 1.0, 0.0)).trace();
    let along = spread.along / (n - share).max(0.5);
    let across = spread.across / (2.0 * n - (6.0 - share)).max(0.5);
    (along.sqrt(), across.sqrt())
}

/// Σ w A_iᵀ Σ_i A_i over [o; p], Σ_i = R_i (σ_a² p̂p̂ᵀ + σ_x² (I − p̂p̂ᵀ)) R_iᵀ.
fn middle(spot: &HotSpot, spread: &Spread, sigma_along: f64, sigma_across: f64) -> Matrix6<f64> {
    let n = spot.sums.total;
    let unit = spot
        .body_point
        .try_normalize(0.0)
        .unwrap_or_else(Vector3::x);
    let (a2, x2) = (sigma_along * sigma_along, sigma_across * sigma_across);
    let body = unit * unit.transpose() * (a2 - x2) + Matrix3::identity() * x2;
    let world = spread.directions * (a2 - x2) + Matrix3::identity() * (x2 * n);
    // A_i over [o; p] is [I  −R_i]
    let mut middle = Matrix6::zeros();
    middle.fixed_view_mut::<3, 3>(0, 0).copy_from(&world);
    middle.fixed_view_mut::<3, 3>(3, 3).copy_from(&(body * n));
    // Σ_i A_i couples through Σ R_i S
    let cross = -(spot.sums.mean_r * n) * body;
    middle.fixed_view_mut::<3, 3>(0, 3).copy_from(&cross);
    middle
        .fixed_view_mut::<3, 3>(3, 0)
        .copy_from(&cross.transpose());
    middle
}

/// (A'A)⁻¹ (Σ A_iᵀ Σ_i A_i) (A'A)⁻¹ over [o; p].
fn sandwich(spot: &HotSpot, spread: &Spread, sigma_along: f64, sigma_across: f64) -> Matrix6<f64> {
    let bread = inverse_normal(&spot.sums);
    bread * middle(spot, spread, sigma_along, sigma_across) * bread
}

/// (6) over [o; p]: what orientation noise of variance `sigma_r2` takes from the least-squares point. Where the noise is most of the
/// rotations' spread the point is ten times as uncertain as it is long.
fn drawn(spot: &HotSpot, sigma_r2: f64) -> Vector6<f64> {
    let sums = &spot.sums;
    if !sigma_r2.is_finite() {
        return Vector6::zeros();
    }
    let shift = 2.0 * (sums.n as f64 - 1.0) * sigma_r2;
    let in_body: Vector3<f64> = (0..3)
        .map(|k| {
            let v = sums.directions.column(k);
            let left = (sums.lambda[k] - shift).max(0.1 * sums.lambda[k]);
            v * (v.dot(&spot.body_point) * shift / left)
        })
        .sum();
    stack(&(sums.mean_r * in_body), &in_body)
}

/// (A'A)⁻¹ over [o; p], by eliminating o: the block of p is M⁻¹.
fn inverse_normal(sums: &PoseSums) -> Matrix6<f64> {
    let n = sums.total;
    let mut m_inverse = Matrix3::zeros();
    for k in 0..3 {
        let v = sums.directions.column(k);
        m_inverse += v * v.transpose() / sums.lambda[k];
    }
    let r = &sums.mean_r;
    let mut out = Matrix6::zeros();
    let top = Matrix3::identity() / n + r * m_inverse * r.transpose();
    let side = r * m_inverse;
    out.fixed_view_mut::<3, 3>(0, 0).copy_from(&top);
    out.fixed_view_mut::<3, 3>(0, 3).copy_from(&side);
    out.fixed_view_mut::<3, 3>(3, 0)
        .copy_from(&side.transpose());
    out.fixed_view_mut::<3, 3>(3, 3).copy_from(&m_inverse);
    out
}

/// The estimate, `weak` where its worst direction is.
pub(crate) fn finish(
    estimator: &'static str,
    spot: &HotSpot,
    spread: &Spread,
    covariance: Matrix6<f64>,
    (noise, degrees_of_freedom): (Noise, Option<f64>),
    rejected: Vec<Rejected>,
    options: &Options,
) -> Outcome {
    let of_center: Matrix3<f64> = covariance.fixed_view::<3, 3>(0, 0).into_owned();
    let eigen = calib_geometry::decompose::symmetric_eigen_small(&of_center);
    let weakest = eigen.values[2].max(0.0).sqrt();
    let reach = spot.body_point.norm();
    let n = spot.sums.n;
    // A body whose origin sits in the center needs no lever: σ of one position is then the measure.
    let limit = (options.weak_fraction * reach).max(noise.sigma_t);
    let (verdict, reason) = if weakest > limit {
        let axis = eigen.vectors.column(2);
        let text = format!(
            "σ = {weakest:.3e} along ({:.2}, {:.2}, {:.2}) exceeds {:.0} % of the distance {reach:.3e} \
             between body and center",
            axis[0],
            axis[1],
            axis[2],
            100.0 * options.weak_fraction
        );
        (Verdict::Weak, Some(text))
    } else {
        (Verdict::Ok, None)
    };
    Outcome::Estimate(Box::new(CorEstimate {
        estimator,
        center: Point3::from(spot.center),
        covariance: of_center,
        shape: Shape::BodyPoint {
            body_point: Point3::from(spot.body_point),
            covariance,
        },
        noise,
        degrees_of_freedom,
        rms: ((spread.along + spread.across) / (3.0 * spot.sums.total)).sqrt(),
        used: n,
        rejected,
        verdict,
        reason,
    }))
}

/// CGLS (Hestenes & Stiefel) on the rows `(R_i − R̄) p = −(t_i − t̄)`: the center is eliminated, since the
/// mean of the rows gives it.
fn conjugate_gradients<'a>(
    sums: &PoseSums,
    poses: impl Iterator<Item = (&'a Pose, f64)> + Clone,
) -> Vector3<f64> {
    let apply = |p: &Vector3<f64>, f: &mut dyn FnMut(&Pose, f64, Vector3<f64>)| {
        for (pose, w) in poses.clone() {
            f(pose, w, pose.rotation * p - sums.mean_r * p);
        }
    };
    let mut x = Vector3::zeros();
    // gradient: s = Aᵀ(b − A x)
    let gradient = |x: &Vector3<f64>| {
        let mut s = Vector3::zeros();
        apply(x, &mut |pose, w, ax| {
            let residual = (sums.mean_t - pose.translation - ax) * w;
            s += (pose.rotation - sums.mean_r).tr_mul(&residual);
        });
        s
    };
    let mut s = gradient(&x);
    let mut direction = s;
    let start = s.norm();
    for _ in 0..CG_STEPS {
        let gamma = s.norm_squared();
        if gamma.sqrt() <= ROUNDING * start {
            break;
        }
        let mut curvature = 0.0;
        apply(&direction, &mut |_, w, ad| {
            curvature += w * ad.norm_squared();
        });
        if curvature <= 0.0 {
            break;
        }
        let next = x + direction * (gamma / curvature);
        let gradient = gradient(&next);
        // A small gradient that no longer falls is rounding: another step would amplify it.
        if gradient.norm_squared() >= gamma && gamma.sqrt() <= SMALL * start {
            break;
        }
        x = next;
        s = gradient;
        direction = s + direction * (s.norm_squared() / gamma);
    }
    x
}

/// Unknowns `[o; p]` as one vector.
pub(crate) fn stack(center: &Vector3<f64>, body_point: &Vector3<f64>) -> Vector6<f64> {
    Vector6::new(
        center.x,
        center.y,
        center.z,
        body_point.x,
        body_point.y,
        body_point.z,
    )
}
