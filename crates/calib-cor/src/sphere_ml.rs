//! Maximum likelihood sphere: a common center, own radii, optionally a noise of each marker or sample.
//!
//! ```text
//! minimize Σ_p Σ_k (|x_pk − m| − r_p)² / σ_pk²,      r_p = weighted mean of |x_pk − m|            (1)
//! σ_pk² = uᵀ Σ_pk u,   u = (x_pk − m)/|x_pk − m|     for samples with a 3 × 3 covariance           (2)
//! ```
//!
//! The radii are eliminated, three unknowns are left. The variances (2) are those at the solution and
//! are not differentiated: a center must not be drawn to where its samples look noisier. The noise of a marker is
//! re-estimated with its share of the degrees of freedom (restricted maximum likelihood).

use calib_estimator::{
    InputKind,
    levenberg::{Problem, Stop, minimize},
    measured::Cloud,
};
use nalgebra::{Matrix3, Vector3};

use crate::{
    algebraic::{Algebraic, solve},
    options::{EstimatorInfo, WEIGHING},
    outcome::{Outcome, Rejected},
    sphere::{Candidate, judge, mean_radii, prepare},
};
use calib_estimator::{EstimatorError, Input, Options, cloud_of};

/// What `ml_sphere` is and needs.
pub(crate) const INFO: EstimatorInfo = EstimatorInfo {
    id: "ml_sphere",
    name: "several markers, maximum likelihood",
    input: InputKind::Points,
    options: WEIGHING,
    summary: "common center, own radii; per-marker noise and 3 × 3 covariances on request",
    source: "orthogonal-distance sphere, joint likelihood, see the book",
    fit,
};

/// Levenberg–Marquardt steps; from an algebraic start four or five suffice.
const MAX_STEPS: usize = 100;
/// Rounds of re-estimating the noise of each marker.
const NOISE_ROUNDS: usize = 50;

/// Maximum likelihood sphere.
///
/// With [`Options::covariances`] samples are weighed by them; with [`Options::noise_per_marker`] by the
/// noise of their marker; otherwise all alike.
///
/// # Errors
/// [`EstimatorError`] for data that are non-finite, covariances that are none, or another kind of data.
pub fn fit(input: &Input<'_>, options: &Options) -> Result<Outcome, EstimatorError> {
    options.check()?;
    let cloud = cloud_of(input, options)?;
    Ok(fit_cloud("ml_sphere", &cloud, options, Vec::new()))
}

/// The same on a gathered cloud, on behalf of `estimator`.
pub(crate) fn fit_cloud(
    estimator: &'static str,
    cloud: &Cloud,
    options: &Options,
    rejected: Vec<Rejected>,
) -> Outcome {
    let factor = match prepare(estimator, cloud, false) {
        Ok(factor) => factor,
        Err(answer) => return answer,
    };
    let (start, _) = solve(cloud, &factor, Algebraic::Pratt);
    let mut weights = Vec::new();
    let mut absolute = false;
    let (center, radii);
    if !cloud.covariances.is_empty() {
        let m = anisotropic(cloud, start);
        weights = radial_weights(cloud, &m);
        absolute = true;
        (center, radii) = (m, weighted_radii(cloud, &m, &weights));
    } else {
        let mut m = isotropic(cloud, start, &[]);
        if options.noise_per_marker && cloud.markers() > 1 {
            (m, weights) = with_noise_per_marker(cloud, m);
            absolute = true;
        }
        (center, radii) = (m, mean_radii(cloud, &m));
    }
    let candidate = Candidate {
        estimator,
        center,
        radii,
        radius_bias: 1.0,
        weights,
        absolute,
        known_bias: Vector3::zeros(),
        rejected,
    };
    judge(cloud, &factor, candidate, options)
}

/// Center of least weighted radial squares; the radii are eliminated.
pub(crate) fn isotropic(cloud: &Cloud, start: Vector3<f64>, weights: &[f64]) -> Vector3<f64> {
    let problem = Radial { cloud, weights };
    let end = minimize(&problem, start, MAX_STEPS);
    if end.stop == Stop::Broken {
        Vector3::repeat(f64::NAN)
    } else {
        end.x
    }
}

struct Radial<'a> {
    cloud: &'a Cloud,
    /// One for each sample beside the cloud's own, or empty for all alike.
    weights: &'a [f64],
}

struct Normal3 {
    hessian: Matrix3<f64>,
    gradient: Vector3<f64>,
    cost: f64,
}

impl Problem for Radial<'_> {
    type Point = Vector3<f64>;
    type Normal = Normal3;
    type Step = Vector3<f64>;

    fn linearize(&self, center: &Vector3<f64>) -> Normal3 {
        let mut normal = Normal3 {
            hessian: Matrix3::zeros(),
            gradient: Vector3::zeros(),
            cost: 0.0,
        };
        for p in 0..self.cloud.markers() {
            let range = self.cloud.starts[p]..self.cloud.starts[p + 1];
            let reference = (self.cloud.points[range.start] - center).norm();
            let (mut sum, mut sum_e, mut sum_ee) = (0.0, 0.0, 0.0);
            let (mut sum_u, mut sum_ue) = (Vector3::zeros(), Vector3::zeros());
            let mut sum_uu = Matrix3::zeros();
            for k in range {
                let w = self.cloud.weight(k) * self.weights.get(k).copied().unwrap_or(1.0);
                let d = self.cloud.points[k] - center;
                let length = d.norm();
                let u = if length > 0.0 {
                    d / length
                } else {
                    Vector3::zeros()
                };
                // Relative to one sample's length: the differences keep their digits.
                let e = length - reference;
                sum += w;
                sum_e += w * e;
                sum_ee += w * e * e;
                sum_u += u * w;
                sum_ue += u * (w * e);
                sum_uu += u * (u * w).transpose();
            }
            // r_k = e_k − ē,  ∂r_k/∂m = −(u_k − ū)
            let mean_u = sum_u / sum;
            let mean_e = sum_e / sum;
            normal.hessian += sum_uu - mean_u * sum_u.transpose();
            normal.gradient -= sum_ue - sum_u * mean_e;
            normal.cost += sum_ee - sum_e * mean_e;
        }
        normal
    }

    fn cost(&self, normal: &Normal3) -> f64 {
        normal.cost
    }

    fn solve(&self, normal: &Normal3, damping: f64) -> Option<(Vector3<f64>, f64)> {
        let mut h = normal.hessian;
        for k in 0..3 {
            h[(k, k)] *= 1.0 + damping;
        }
        let step = -h.cholesky()?.solve(&normal.gradient);
        Some((
            step,
            -(step.dot(&normal.gradient) * 2.0 + step.dot(&(normal.hessian * step))),
        ))
    }

    fn retract(&self, x: &Vector3<f64>, step: &Vector3<f64>) -> Vector3<f64> {
        x + step
    }

    fn is_negligible(&self, x: &Vector3<f64>, step: &Vector3<f64>) -> bool {
        step.norm() <= 1e-14 * (x.norm() + self.cloud.points[0].norm())
    }
}

/// Restricted maximum likelihood over one variance for each marker; returns the center and the inverse
/// variance of each sample.
pub(crate) fn with_noise_per_marker(
    cloud: &Cloud,
    start: Vector3<f64>,
) -> (Vector3<f64>, Vec<f64>) {
    let mut center = start;
    let mut variances = vec![1.0; cloud.markers()];
    let mut weights = vec![1.0; cloud.points.len()];
    for _ in 0..NOISE_ROUNDS {
        let information = Radial {
            cloud,
            weights: &weights,
        }
        .linearize(&center)
        .hessian;
        let mut change: f64 = 0.0;
        for p in 0..cloud.markers() {
            let one = select_marker(cloud, p);
            let at = Radial {
                cloud: &one,
                weights: &[],
            }
            .linearize(&center);
            let n = one.points.len() as f64;
            // Degrees of freedom that the common center takes from this marker: tr(H⁻¹ H_p/σ_p²).
            let share = information
                .cholesky()
                .map_or(3.0 / cloud.markers() as f64, |h| {
                    (h.inverse() * at.hessian).trace() * weights[cloud.starts[p]]
                });
            let dof = (n - 1.0 - share).max(0.5);
            // A marker must not explain the data alone by being exact.
            let floor = 1e-6 * variances.iter().copied().fold(0.0, f64::max);
            let variance = (at.cost / dof).max(floor).max(f64::MIN_POSITIVE);
            change = change.max((variance / variances[p] - 1.0).abs());
            variances[p] = variance;
        }
        for p in 0..cloud.markers() {
            weights[cloud.starts[p]..cloud.starts[p + 1]].fill(1.0 / variances[p]);
        }
        center = isotropic(cloud, center, &weights);
        if change < 1e-10 {
            break;
        }
    }
    (center, weights)
}

fn select_marker(cloud: &Cloud, p: usize) -> Cloud {
    let range = cloud.range(p);
    Cloud {
        origin: cloud.origin,
        points: cloud.points[range.clone()].to_vec(),
        starts: vec![0, range.len()],
        labels: cloud.labels[range.clone()].to_vec(),
        covariances: Vec::new(),
        weights: cloud
            .weights
            .get(range)
            .map_or_else(Vec::new, <[f64]>::to_vec),
        magnitude: cloud.magnitude,
    }
}

/// 1 / (uᵀ Σ u) of each sample, u its direction from the center.
fn radial_weights(cloud: &Cloud, center: &Vector3<f64>) -> Vec<f64> {
    cloud
        .points
        .iter()
        .zip(&cloud.covariances)
        .map(|(x, covariance)| {
            let u = (x - center).normalize();
            1.0 / u.dot(&(covariance * u))
        })
        .collect()
}

/// The fixed point of (1) and (2).
fn anisotropic(cloud: &Cloud, start: Vector3<f64>) -> Vector3<f64> {
    let mut center = start;
    for _ in 0..MAX_STEPS {
        let next = isotropic(cloud, center, &radial_weights(cloud, &center));
        let moved = (next - center).norm();
        center = next;
        if moved <= 1e-14 * cloud.points[0].norm() || !moved.is_finite() {
            break;
        }
    }
    center
}

/// Weighted mean distance of each marker's samples; the cloud's weights multiply those given.
pub(crate) fn weighted_radii(cloud: &Cloud, center: &Vector3<f64>, weights: &[f64]) -> Vec<f64> {
    (0..cloud.markers())
        .map(|p| {
            let range = cloud.range(p);
            let sum: f64 = range.clone().map(|k| weights[k] * cloud.weight(k)).sum();
            range
                .map(|k| weights[k] * cloud.weight(k) * (cloud.points[k] - center).norm())
                .sum::<f64>()
                / sum
        })
        .collect()
}
