//! What all sphere fits share: the judgment of a fitted center.
//!
//! ```text
//! σ̂² = Σ w (|x − m| − r_p)² / (n − P − 3)      σ is the noise of a sample of weight 1            (1)
//! κ = (s₃² / (n − P − 2)) / σ̂²  ~  F(n − P − 2, n − P − 3)   if every marker stays in a plane   (2)
//! C = σ² (JᵀJ)⁻¹ + b bᵀ,  J = −(u − ū_p),   the weakest variance divided by 1 − 1/κ              (3)
//! ```
//!
//! b is a bias that the estimator is known to have (Kåsa's). With noise J has full rank even for a sweep about one axis, and (3) alone would look trustworthy; the test
//! (2) compares the spread across the best planes (s₃, [`calib_estimator::factor`]) with the noise.

use calib_estimator::factor::{Factor, rank_verdict};
use calib_estimator::noise::Level;
use calib_estimator::{
    Verdict,
    chance::{chi2_tail, f_tail},
    measured::Cloud,
};
use calib_geometry::{
    Line,
    decompose::{SymmetricEigenSmall, symmetric_eigen_small},
};
use nalgebra::{Matrix3, Point3, Unit, Vector3};

use crate::outcome::{CorEstimate, Known, Noise, NotObservable, Outcome, Rejected, Shape};
use crate::systematic::Systematic;
use calib_estimator::Options;

/// Chance, in units of the significance, up to which a doubtful recording still gets its answer, called weak, where it has fewer than
/// [`ENOUGH_DOF`] degrees of freedom: no test separates a sweep from a grid both ways there, so what is between the two is said to be.
const DOUBT: f64 = 50.0;

/// Residual degrees of freedom from which the residuals say more about the noise than the tracker does, and enough to test it.
const ENOUGH_DOF: usize = 10;

/// Rank check of a cloud; `Err` carries the answer.
pub(crate) fn prepare(
    estimator: &'static str,
    cloud: &Cloud,
    equal_markers: bool,
) -> Result<Factor, Outcome> {
    let needed = cloud.markers().max(1) + 3;
    if cloud.points.len() < needed {
        return Err(Outcome::too_few(
            estimator,
            cloud.points.len(),
            needed,
            "samples (of markers seen at least twice)",
        ));
    }
    let factor = Factor::of(cloud, equal_markers);
    if let Some(verdict) = rank_verdict(cloud, &factor) {
        let s = factor.s;
        let reason = format!(
            "the points are {verdict}: singular values {:.3e}, {:.3e}, {:.3e}",
            s[0], s[1], s[2]
        );
        return Err(not_observable(estimator, verdict, reason, cloud, &factor));
    }
    Ok(factor)
}

fn not_observable(
    estimator: &'static str,
    verdict: Verdict,
    reason: String,
    cloud: &Cloud,
    factor: &Factor,
) -> Outcome {
    let known = match verdict {
        Verdict::Coplanar => {
            // Centers that explain the points equally well lie on the normal through the circle's center.
            let center = cloud.origin + factor.truncated_center(0.0, 2);
            Line::new(Point3::from(center), factor.v.column(2).into_owned())
                .map_or(Known::Nothing, Known::AxisLine)
        }
        Verdict::Collinear => Known::Plane {
            point: Point3::from(cloud.origin),
            normal: Unit::new_normalize(factor.v.column(0).into_owned()),
        },
        _ => Known::Nothing,
    };
    Outcome::NotObservable(NotObservable {
        estimator,
        verdict,
        reason,
        known,
    })
}

/// Mean distance of each marker's samples from the center: the radius of least squares.
pub(crate) fn mean_radii(cloud: &Cloud, center: &Vector3<f64>) -> Vec<f64> {
    (0..cloud.markers())
        .map(|p| {
            let lengths = cloud.samples(p).map(|(x, w)| w * (x - center).norm());
            lengths.sum::<f64>() / cloud.total(cloud.range(p))
        })
        .collect()
}

/// A center to be judged.
pub(crate) struct Candidate {
    pub estimator: &'static str,
    /// Relative to the cloud's origin.
    pub center: Vector3<f64>,
    /// Radii as the estimator states them.
    pub radii: Vec<f64>,
    /// Bias of those radii in units of σ²/r (second-order noise analysis).
    pub radius_bias: f64,
    /// Inverse noise variance of each sample, relative to a unit variance; empty: all 1. The cloud's weights multiply them.
    pub weights: Vec<f64>,
    /// True where the weights are inverse variances in the points' unit: nothing is left to estimate.
    pub absolute: bool,
    /// What the center is known to be off by and was not taken off: it counts as uncertainty.
    pub known_bias: Vector3<f64>,
    pub rejected: Vec<Rejected>,
}

/// Residuals, noise, covariance and the observability test around a fitted center.
pub(crate) fn judge(
    cloud: &Cloud,
    factor: &Factor,
    candidate: Candidate,
    options: &Options,
) -> Outcome {
    let Candidate {
        estimator,
        center,
        radii,
        radius_bias,
        weights,
        absolute,
        known_bias,
        rejected,
    } = candidate;
    let (n, markers) = (cloud.points.len(), cloud.markers());
    if let Some(answer) = diverged(estimator, &center, factor.s[0]) {
        return answer;
    }
    let Sums {
        information,
        rss,
        weighted_rss,
    } = sums(cloud, &center, &radii, &weights);
    let dof = n - markers - 3;
    let seen = (weighted_rss / dof.max(1) as f64).sqrt();
    let Some(level) = level(cloud, absolute, seen, dof, options) else {
        // As many samples as unknowns: any noise would fit.
        let of = "samples where no noise is stated (of markers seen at least twice)";
        return Outcome::too_few(estimator, n, n + 1, of);
    };
    let sigma = level.sigma;
    let eigen = symmetric_eigen_small(&information);
    if eigen.values[0] <= 0.0 || !eigen.values[0].is_finite() {
        let reason = "the directions from the center to the points span no volume".to_string();
        return not_observable(estimator, Verdict::Coplanar, reason, cloud, factor);
    }

    let plain_sigma = (rss / dof.max(1) as f64).sqrt();
    let Spread { kappa, doubt } =
        match leaves_its_plane(estimator, cloud, factor, plain_sigma, dof, options) {
            Ok(spread) => spread,
            Err(answer) => return answer,
        };

    // Noise that differs by direction bends a sphere itself, to second order.
    let systematic = if cloud.covariances.is_empty() {
        Systematic::of(cloud, &center, &weights, dof, options.significance)
    } else {
        None
    };
    let shift = systematic.as_ref().map_or(Vector3::zeros(), |s| s.shift);
    let covariance = inflated(&eigen, sigma, kappa)
        + known_bias * known_bias.transpose()
        + shift * shift.transpose();
    // σ_weakest² = σ²/(λ₀(1 − 1/κ)) + (bias · v₀)²
    let weakest = sigma / (eigen.values[0] * (1.0 - 1.0 / kappa)).sqrt();
    let weakest = weakest
        .hypot(known_bias.dot(&eigen.vectors.column(0)))
        .hypot(shift.norm());
    let radius = radii.iter().sum::<f64>() / markers as f64;
    let imprecise = (weakest > options.weak_fraction * radius).then(|| {
        let axis = eigen.vectors.column(0).into_owned();
        too_weak(weakest, &axis, radius, options)
    });
    let reason = imprecise
        .or(doubt)
        .or_else(|| systematic.and_then(|s| s.reason()));
    let point_sigma = if absolute { plain_sigma } else { sigma };
    let bias: Vec<f64> = radii
        .iter()
        .map(|r| bias_of_radius(radius_bias, point_sigma, *r))
        .collect();
    Outcome::Estimate(Box::new(CorEstimate {
        estimator,
        center: Point3::from(cloud.origin + center),
        covariance,
        shape: Shape::Radii {
            radii: radii.iter().zip(&bias).map(|(r, b)| r - b).collect(),
            bias,
        },
        noise: Noise {
            sigma_t: point_sigma,
            sigma_r: None,
            estimated: level.degrees_of_freedom.is_some(),
            contradicts: level.contradicts,
        },
        degrees_of_freedom: level.degrees_of_freedom,
        rms: (rss / cloud.total(0..n)).sqrt(),
        used: n,
        rejected,
        verdict: if reason.is_some() {
            Verdict::Weak
        } else {
            Verdict::Ok
        },
        reason,
    }))
}

/// Second-order bias of a radius, m; a stated noise as large as the radius leaves nothing of it.
fn bias_of_radius(factor: f64, sigma: f64, radius: f64) -> f64 {
    (factor * sigma * sigma / radius.max(f64::MIN_POSITIVE)).min(radius)
}

fn diverged(estimator: &'static str, center: &Vector3<f64>, scatter: f64) -> Option<Outcome> {
    if center.iter().all(|x| x.is_finite()) && center.norm() <= 1e6 * scatter {
        return None;
    }
    let reason = format!(
        "the estimate diverged: the center is {:.1e} away from points that spread {scatter:.1e}",
        center.norm()
    );
    Some(Outcome::none(
        estimator,
        Verdict::Diverged,
        reason,
        Known::Nothing,
    ))
}

/// The noise in units of the weights: stated, or `seen` with `dof` degrees of freedom; `None` where neither is there.
fn level(cloud: &Cloud, absolute: bool, seen: f64, dof: usize, options: &Options) -> Option<Level> {
    let stated = match (absolute, cloud.covariances.is_empty()) {
        (true, false) => Some(1.0),
        // One noise for each marker was estimated so that the residuals have the variance 1.
        (true, true) => {
            return (dof > 0).then(|| Level::of(None, 1.0, dof as f64, options.significance));
        }
        (false, _) => options.sigma_t,
    };
    match (dof, stated) {
        (0, stated) => stated.map(Level::stated),
        _ => Some(Level::of(stated, seen, dof as f64, options.significance)),
    }
}

/// Information of the center and sums of squares about the fitted spheres.
struct Sums {
    information: Matrix3<f64>,
    rss: f64,
    weighted_rss: f64,
}

/// JᵀWJ with J = −(u − ū_p): the radii are eliminated by centering each marker's directions.
fn sums(cloud: &Cloud, center: &Vector3<f64>, radii: &[f64], weights: &[f64]) -> Sums {
    let weight = |k: usize| weights.get(k).copied().unwrap_or(1.0);
    let mut information = Matrix3::zeros();
    let (mut rss, mut weighted_rss) = (0.0, 0.0);
    for p in 0..cloud.markers() {
        let range = cloud.range(p);
        let (mut sum, mut sum_u, mut sum_d) = (0.0, Vector3::zeros(), 0.0);
        let (mut scatter_u, mut sum_dd, mut plain_d) = (Matrix3::zeros(), 0.0, 0.0);
        let guess = radii[p];
        let mut plain_dd = 0.0;
        for k in range.clone() {
            let d = cloud.points[k] - center;
            let length = d.norm();
            let u = if length > 0.0 {
                d / length
            } else {
                Vector3::zeros()
            };
            let plain = cloud.weight(k);
            let w = weight(k) * plain;
            let e = length - guess;
            sum += w;
            sum_u += u * w;
            scatter_u += u * (u * w).transpose();
            sum_d += w * e;
            sum_dd += w * e * e;
            plain_d += plain * e;
            plain_dd += plain * e * e;
        }
        let mean_u = sum_u / sum;
        information += scatter_u - mean_u * mean_u.transpose() * sum;
        // Residuals about the least-squares radius, whatever radius the estimator states.
        weighted_rss += (sum_dd - sum_d * sum_d / sum).max(0.0);
        rss += (plain_dd - plain_d * plain_d / cloud.total(range)).max(0.0);
    }
    Sums {
        information,
        rss,
        weighted_rss,
    }
}

/// C = σ² Σ v_k v_kᵀ/λ_k. Noise inflates the spread of the weakest direction: its share 1/κ is taken off the information.
fn inflated(eigen: &SymmetricEigenSmall<3>, sigma: f64, kappa: f64) -> Matrix3<f64> {
    let mut covariance = Matrix3::zeros();
    for k in 0..3 {
        let axis = eigen.vectors.column(k);
        let trust = if k == 0 { 1.0 - 1.0 / kappa } else { 1.0 };
        covariance += axis * axis.transpose() * (sigma * sigma / (eigen.values[k] * trust));
    }
    covariance
}

fn too_weak(weakest: f64, axis: &Vector3<f64>, radius: f64, options: &Options) -> String {
    format!(
        "σ = {weakest:.3e} along ({:.2}, {:.2}, {:.2}) exceeds {:.0} % of the radius {radius:.3e}",
        axis[0],
        axis[1],
        axis[2],
        100.0 * options.weak_fraction
    )
}

/// The spread across the planes.
pub(crate) struct Spread {
    /// In units of the noise variance.
    pub kappa: f64,
    /// Why H₀ is unlikely, but not excluded.
    pub doubt: Option<String>,
}

/// H₀: every marker stays in a plane, so that s₃² is noise alone. Returns the spread across the
/// planes, or the answer that H₀ cannot be excluded. With few degrees of freedom there is doubt between the two: H₀ is not excluded
/// at the significance, but at [`DOUBT`] times it.
///
/// `sigma` is the noise that the fit's own residuals show with `dof` degrees of freedom.
pub(crate) fn leaves_its_plane(
    estimator: &'static str,
    cloud: &Cloud,
    factor: &Factor,
    sigma: f64,
    dof: usize,
    options: &Options,
) -> Result<Spread, Outcome> {
    let (n, markers) = (cloud.points.len(), cloud.markers());
    let (noise, noise_dof, how) = match options.sigma_t {
        Some(stated) if dof < ENOUGH_DOF => (stated, None, "stated"),
        _ if dof == 0 => {
            return Ok(Spread {
                kappa: f64::INFINITY,
                doubt: None,
            });
        }
        _ => (sigma, Some(dof as f64), "estimated"),
    };
    // κ_k = (s_k² / degrees of freedom) / σ² and the chance of such a value from noise alone
    let test = |k: usize, test_dof: usize| {
        let d = test_dof as f64;
        let kappa = factor.s[k] * factor.s[k] / d / (noise * noise);
        let chance = match noise_dof {
            Some(noise_dof) => f_tail(kappa, d, noise_dof),
            None => chi2_tail(kappa * d, d),
        };
        (kappa, chance)
    };
    let (kappa, chance) = test(2, n - markers - 2);
    if chance <= options.significance {
        return Ok(Spread { kappa, doubt: None });
    }
    // A spread of no more than the noise is no answer even where chance says otherwise.
    let few = dof < ENOUGH_DOF;
    if few && chance <= (DOUBT * options.significance).min(0.5) && kappa > 1.0 {
        let doubt = format!(
            "the points may be coplanar: their spread across the best plane{} is {:.2} times the {how} noise of \
             {noise:.3e} (chance {chance:.1e}, beyond doubt below {:.0e})",
            if markers > 1 { "s" } else { "" },
            kappa.sqrt(),
            options.significance
        );
        return Ok(Spread {
            kappa,
            doubt: Some(doubt),
        });
    }
    let verdict = if test(1, n - markers - 1).1 <= options.significance {
        Verdict::Coplanar
    } else if test(0, n - markers).1 <= options.significance {
        Verdict::Collinear
    } else {
        Verdict::Coincident
    };
    let reason = format!(
        "the points are {verdict} within their noise: their spread across the best plane{} is {:.2} times \
         the {how} noise of {noise:.3e} (chance {chance:.1e}, accepted below {:.0e})",
        if markers > 1 { "s" } else { "" },
        kappa.sqrt(),
        options.significance
    );
    Err(not_observable(estimator, verdict, reason, cloud, factor))
}
