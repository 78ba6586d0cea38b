//! Sphere by errors in variables: foot points in the metric of each sample, and the bias of the center corrected.
//!
//! ```text
//! minimize Σ (x_k − f_k)ᵀ Σ_k⁻¹ (x_k − f_k)   over the center m, the radii and feet |f_k − m| = r_p          (1)
//! foot:    (I + μ Σ_k)(f − m) = x − m,  |f − m| = r;   ν = (f − m)/r,  v = νᵀ Σ_k ν,  h = ν·(x − m) − r        (2)
//! (1) = Σ h_k²/v_k,   ∂/∂m = −2 Σ h ν/v,   ∂/∂r = −2 Σ h/v                                                 (3)
//! bias:    E[m̂ − m] = ½ C Σ (ν_k − ν̄_p)/v_k · tr((I − ν_k ν_kᵀ) C)/r_p,     C = covariance of m̂             (4)
//! ```
//!
//! [`crate::sphere_ml`] weighs each sample by its noise along its own radius; where the noise is long across it, that radius
//! is not where the sample came from. (1) knows; its gradient (3) is exact because the feet are optimal. With equal, isotropic noise (1) is the
//! sphere of least squares. (4) is the second-order bias of least squares (Box 1971), what makes a short arc seem larger than it is:
//! a center known to 6 % of the radius is 0.4 % of it too far.
//!
//! Noise so long that the sphere bends under it ([`crate::bend`]) pushes each height by its mean, which depends on the direction, and the center by
//!
//! ```text
//! β = H⁻¹ Σ D_k E[h_k]/v_k,   H = Σ D_k D_kᵀ/v_k,  D = ν − ν̄;      m̂ − c β,   c = ρ²/(1 + ρ²),  ρ² = βᵀ H β    (5)
//! cov = H⁻¹ + H⁻¹ E H⁻¹ + (1 − c)² β βᵀ,   E: (3) there                                                     (6)
//! ```
//!
//! β does not fall with the number of samples, the uncertainty does. Taking off all of it makes the score of every foot unbiased and costs
//! more than it gives while β is the smaller one (1.5 % of efficiency against 0.3 % with 25 mm along the sight at 250 mm): c is the share that is best
//! where the correction is as uncertain as the estimate. What of it is left stands in the covariance. Information that the bend takes away, no estimator gets back:
//! [`crate::bounds::sphere_center_weighted`].

use calib_estimator::{
    InputKind,
    levenberg::{Problem, Stop, minimize},
    measured::Cloud,
};
use calib_geometry::decompose::symmetric_eigen_small;
use nalgebra::{Matrix3, Vector3};

use crate::{
    algebraic::{Algebraic, solve},
    bend::Bend,
    options::{EstimatorInfo, WEIGHING},
    outcome::Outcome,
    sphere::{Candidate, judge, mean_radii, prepare},
    sphere_ml::{isotropic, weighted_radii, with_noise_per_marker},
};
use calib_estimator::{EstimatorError, Input, Options, cloud_of};

/// What `sphere_eiv` is and needs.
pub(crate) const INFO: EstimatorInfo = EstimatorInfo {
    id: "sphere_eiv",
    name: "several markers, errors in variables",
    input: InputKind::Points,
    options: WEIGHING,
    summary: "ml_sphere with foot points in the metric of the covariances, the bias of the center corrected",
    source: "Box 1971; Kanatani 2008",
    fit,
};

/// Levenberg–Marquardt steps; from an algebraic start about ten suffice.
const MAX_STEPS: usize = 100;
/// Newton steps on the secular equation (2); it is nearly linear in 1/|f|.
const FOOT_STEPS: usize = 60;

/// Sphere by errors in variables, with [`Options::covariances`] or [`Options::noise_per_marker`] or equal noise.
///
/// # Errors
/// [`EstimatorError`] for data that are non-finite, covariances that are none, or another kind of data.
pub fn fit(input: &Input<'_>, options: &Options) -> Result<Outcome, EstimatorError> {
    const ID: &str = "sphere_eiv";
    options.check()?;
    let cloud = cloud_of(input, options)?;
    let factor = match prepare(ID, &cloud, false) {
        Ok(factor) => factor,
        Err(answer) => return Ok(answer),
    };
    let (start, _) = solve(&cloud, &factor, Algebraic::Pratt);
    let mut weights = Vec::new();
    let mut normals = Vec::new();
    let mut absolute = false;
    let mut center;
    let mut added = Matrix3::zeros();
    if cloud.covariances.is_empty() {
        center = isotropic(&cloud, start, &[]);
        if options.noise_per_marker && cloud.markers() > 1 {
            (center, weights) = with_noise_per_marker(&cloud, center);
            absolute = true;
        }
    } else {
        let problem = Feet::of(&cloud);
        let begin = State {
            center: start,
            radii: mean_radii(&cloud, &start),
        };
        let end = minimize(&problem, begin, MAX_STEPS);
        center = if end.stop == Stop::Broken {
            Vector3::repeat(f64::NAN)
        } else {
            end.x.center
        };
        for p in 0..cloud.markers() {
            for k in cloud.starts[p]..cloud.starts[p + 1] {
                let foot = problem.foot(k, &end.x.center, end.x.radii[p]);
                // The cloud's own weights stand in the foot's variance already, and multiply these.
                weights.push(1.0 / (foot.variance * cloud.weight(k)));
                normals.push(foot.normal);
            }
        }
        if let Some((bias, covariance)) = bent(&cloud, &normals, &weights, &end.x.radii) {
            center -= bias;
            added = covariance;
        }
        absolute = true;
    }
    if normals.is_empty() {
        normals = cloud
            .points
            .iter()
            .map(|x| (x - center).try_normalize(0.0).unwrap_or_default())
            .collect();
    }
    let radii = |center: &Vector3<f64>| {
        if weights.is_empty() {
            mean_radii(&cloud, center)
        } else {
            weighted_radii(&cloud, center, &weights)
        }
    };
    let variance = if absolute {
        1.0
    } else {
        options.sigma_t.map_or_else(
            || residual_variance(&cloud, &center, &radii(&center)),
            |s| s * s,
        )
    };
    if let Some(bias) = bias(&cloud, &normals, &weights, &radii(&center), variance) {
        center -= bias;
    }
    let candidate = Candidate {
        estimator: ID,
        center,
        radii: radii(&center),
        radius_bias: 1.0,
        weights,
        absolute,
        known_bias: Vector3::zeros(),
        rejected: Vec::new(),
    };
    let mut outcome = judge(&cloud, &factor, candidate, options);
    if let Outcome::Estimate(estimate) = &mut outcome {
        estimate.covariance += added;
    }
    Ok(outcome)
}

/// What a sample says about the center.
struct Direction {
    marker: usize,
    /// D: its normal off the weighted mean of its marker's.
    off: Vector3<f64>,
    weight: f64,
}

/// D and weight of every sample; `weights` multiply the cloud's own, none are all 1.
fn directions(cloud: &Cloud, normals: &[Vector3<f64>], weights: &[f64]) -> Vec<Direction> {
    let weight = |k: usize| weights.get(k).copied().unwrap_or(1.0) * cloud.weight(k);
    let mut out = Vec::with_capacity(cloud.points.len());
    for marker in 0..cloud.markers() {
        let (mut sum, mut total) = (Vector3::zeros(), 0.0);
        for k in cloud.range(marker) {
            sum += normals[k] * weight(k);
            total += weight(k);
        }
        out.extend(cloud.range(marker).map(|k| Direction {
            marker,
            off: normals[k] - sum / total,
            weight: weight(k),
        }));
    }
    out
}

/// c β of (5), and what (6) adds to H⁻¹. `None` where the directions span no volume or the numbers are none.
fn bent(
    cloud: &Cloud,
    normals: &[Vector3<f64>],
    weights: &[f64],
    radii: &[f64],
) -> Option<(Vector3<f64>, Matrix3<f64>)> {
    let (mut information, mut excess) = (Matrix3::zeros(), Matrix3::zeros());
    let mut push = Vector3::zeros();
    for (k, one) in directions(cloud, normals, weights).iter().enumerate() {
        let covariance = cloud.covariances[k] / cloud.weight(k);
        let bend = Bend::of(&covariance, &normals[k], radii[one.marker]);
        information += one.off * (one.off * one.weight).transpose();
        push += one.off * (one.weight * bend.mean_height());
        excess += bend.excess(&one.off);
    }
    let inverse = information.cholesky()?.inverse();
    let bias = inverse * push;
    let size = bias.dot(&push);
    let share = size / (1.0 + size);
    let left = bias * (1.0 - share);
    let added = inverse * excess * inverse + left * left.transpose();
    let fine = bias.iter().chain(added.iter()).all(|x| x.is_finite());
    fine.then_some((bias * share, added))
}

/// σ̂² of the radial residuals.
fn residual_variance(cloud: &Cloud, center: &Vector3<f64>, radii: &[f64]) -> f64 {
    let dof = cloud.points.len() - cloud.markers() - 3;
    let rss: f64 = (0..cloud.markers())
        .flat_map(|p| {
            cloud.range(p).map(move |k| {
                cloud.weight(k) * ((cloud.points[k] - center).norm() - radii[p]).powi(2)
            })
        })
        .sum();
    if dof > 0 { rss / dof as f64 } else { 0.0 }
}

/// (4); `None` where the bias is no small part of the uncertainty: the expansion means nothing there.
fn bias(
    cloud: &Cloud,
    normals: &[Vector3<f64>],
    weights: &[f64],
    radii: &[f64],
    variance: f64,
) -> Option<Vector3<f64>> {
    let directions = directions(cloud, normals, weights);
    let information: Matrix3<f64> = directions
        .iter()
        .map(|one| one.off * (one.off * one.weight).transpose())
        .sum();
    let covariance = information.cholesky()?.inverse() * variance;
    let mut pull = Vector3::zeros();
    for (nu, one) in normals.iter().zip(&directions) {
        let bend = (covariance.trace() - nu.dot(&(covariance * nu))) / radii[one.marker];
        pull += one.off * (one.weight * bend);
    }
    let bias = covariance * pull * (0.5 / variance.max(f64::MIN_POSITIVE));
    let small = bias.norm_squared() < 0.25 * covariance.trace();
    (small && bias.iter().all(|x| x.is_finite())).then_some(bias)
}

#[derive(Clone)]
struct State {
    center: Vector3<f64>,
    radii: Vec<f64>,
}

struct Foot {
    normal: Vector3<f64>,
    /// νᵀΣν.
    variance: f64,
    /// h of (2).
    height: f64,
}

struct Feet<'a> {
    cloud: &'a Cloud,
    /// Eigenvalues and directions of each covariance.
    axes: Vec<(Vector3<f64>, Matrix3<f64>)>,
}

struct Normal {
    /// For each marker Σ1/v, Σν/v, Σh/v.
    sums: Vec<(f64, Vector3<f64>, f64)>,
    hessian: Matrix3<f64>,
    gradient: Vector3<f64>,
    cost: f64,
}

impl<'a> Feet<'a> {
    fn of(cloud: &'a Cloud) -> Self {
        let axes = cloud
            .covariances
            .iter()
            .enumerate()
            .map(|(k, c)| {
                let eigen = symmetric_eigen_small(c);
                (eigen.values / cloud.weight(k), eigen.vectors)
            })
            .collect();
        Self { cloud, axes }
    }

    /// (2): the nearest point of the sphere, in the metric of the sample.
    fn foot(&self, k: usize, center: &Vector3<f64>, radius: f64) -> Foot {
        let (s, axes) = &self.axes[k];
        let d = axes.tr_mul(&(self.cloud.points[k] - center));
        let at = |mu: f64| Vector3::from_fn(|i, _| d[i] / (1.0 + mu * s[i]));
        // |f(μ)| falls from ∞ at −1/s_max to 0.
        let (mut low, mut high) = (-1.0 / s[2], f64::INFINITY);
        let mut mu = (d.norm() - radius) / radius / s[2];
        mu = mu.max(0.5 * low);
        for _ in 0..FOOT_STEPS {
            let f = at(mu);
            let length = f.norm();
            if length > radius {
                low = mu;
            } else {
                high = mu;
            }
            // Newton on 1/|f| = 1/r
            let slope: f64 = (0..3).map(|i| f[i] * f[i] * s[i] / (1.0 + mu * s[i])).sum();
            let next = mu + (length - radius) * length * length / (radius * slope);
            let next = if next > low && next < high {
                next
            } else if high.is_finite() {
                0.5 * (low + high)
            } else {
                2.0 * mu.abs() + 1.0 / s[2]
            };
            let moved = (next - mu).abs();
            mu = next;
            if moved <= 1e-15 * (mu.abs() + 1.0 / s[2]) || !mu.is_finite() {
                break;
            }
        }
        let f = at(mu);
        let nu = f / f.norm();
        Foot {
            normal: axes * nu,
            variance: nu.dot(&s.component_mul(&nu)),
            height: nu.dot(&d) - radius,
        }
    }
}

impl Problem for Feet<'_> {
    type Point = State;
    type Normal = Normal;
    type Step = (Vector3<f64>, Vec<f64>);

    fn linearize(&self, x: &State) -> Normal {
        let mut normal = Normal {
            sums: Vec::with_capacity(x.radii.len()),
            hessian: Matrix3::zeros(),
            gradient: Vector3::zeros(),
            cost: 0.0,
        };
        for p in 0..self.cloud.markers() {
            let (mut total, mut mean, mut height) = (0.0, Vector3::zeros(), 0.0);
            for k in self.cloud.starts[p]..self.cloud.starts[p + 1] {
                let foot = self.foot(k, &x.center, x.radii[p]);
                let w = 1.0 / foot.variance;
                total += w;
                mean += foot.normal * w;
                height += foot.height * w;
                normal.hessian += foot.normal * (foot.normal * w).transpose();
                normal.gradient -= foot.normal * (foot.height * w);
                normal.cost += foot.height * foot.height * w;
            }
            // The radius is eliminated.
            normal.hessian -= mean * mean.transpose() / total;
            normal.gradient += mean * (height / total);
            normal.sums.push((total, mean, height));
        }
        normal
    }

    fn cost(&self, normal: &Normal) -> f64 {
        normal.cost
    }

    fn solve(&self, normal: &Normal, damping: f64) -> Option<(Self::Step, f64)> {
        let mut h = normal.hessian;
        for k in 0..3 {
            h[(k, k)] *= 1.0 + damping;
        }
        let step = -h.cholesky()?.solve(&normal.gradient);
        let mut predicted =
            -(step.dot(&normal.gradient) * 2.0 + step.dot(&(normal.hessian * step)));
        let radii = normal
            .sums
            .iter()
            .map(|(total, mean, height)| {
                predicted += height * height / total;
                (height - mean.dot(&step)) / total
            })
            .collect();
        Some(((step, radii), predicted))
    }

    fn retract(&self, x: &State, (center, radii): &Self::Step) -> State {
        State {
            center: x.center + center,
            radii: x.radii.iter().zip(radii).map(|(r, d)| r + d).collect(),
        }
    }

    fn is_negligible(&self, x: &State, (center, _): &Self::Step) -> bool {
        center.norm() <= 1e-14 * (x.center.norm() + self.cloud.points[0].norm())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    /// The mean and the variance of the heights over a sphere, from many samples of one foot, against (2) of `bend`.
    #[test]
    fn heights_have_the_mean_of_the_bend() {
        const TRIALS: usize = 40_000;
        let radius = 0.1;
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(1);
        for (normal, sigmas) in [
            (Vector3::new(0.3, -0.5, 0.8), [2e-3, 5e-3, 8e-3]),
            (Vector3::new(1.0, 0.0, 0.0), [2e-3, 2e-3, 10e-3]),
            (Vector3::new(0.2, 0.2, -1.0), [3e-3, 3e-3, 3e-3]),
        ] {
            let normal = normal.normalize();
            let root = Matrix3::from_diagonal(&Vector3::from(sigmas));
            let covariance = root * root;
            let points: Vec<Vector3<f64>> = (0..TRIALS)
                .map(|_| {
                    let z = Vector3::from_fn(|_, _| StandardNormal.sample(&mut random));
                    normal * radius + root * z
                })
                .collect();
            let cloud = Cloud {
                origin: Vector3::zeros(),
                starts: vec![0, TRIALS],
                labels: vec![(0, 0); TRIALS],
                covariances: vec![covariance; TRIALS],
                weights: Vec::new(),
                magnitude: 1.0,
                points,
            };
            let feet = Feet::of(&cloud);
            let heights: Vec<f64> = (0..TRIALS)
                .map(|k| feet.foot(k, &Vector3::zeros(), radius).height)
                .collect();
            let mean = heights.iter().sum::<f64>() / TRIALS as f64;
            let spread = heights.iter().map(|h| (h - mean).powi(2)).sum::<f64>() / TRIALS as f64;
            let bend = Bend::of(&covariance, &normal, radius);
            let expected = bend.mean_height();
            let error = (spread / TRIALS as f64).sqrt();
            // Fourth order in the noise.
            let next = expected * bend.added_share();
            assert!(
                (mean - expected).abs() < 3.5 * error + next,
                "{mean:e} ± {error:e}, expected {expected:e}"
            );
            assert!(expected > 4.0 * error, "the test must be able to fail");
        }
    }
}
