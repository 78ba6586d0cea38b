//! Outliers: consensus, then Huber, then Geman–McClure by graduated non-convexity, then a χ² gate and a
//! plain maximum-likelihood fit of what is left, so that the covariance is valid.
//!
//! ```text
//! consensus   draw subsets; MSAC  Σ min(d²/σ², T)  with a stated σ, else least median of squares
//! Huber       w = min(1, k/d), 0 far off         d: residual in σ; k = 1.345 (1 dof), 2.8 (3 dof)
//! GNC         w = (μT / (d² + μT))²,   μ = 8 … 1,   T = χ²_dof(0.999)
//! gate        d² ≤ T,  σ re-estimated from the inliers, until the set stands still
//! ```
//!
//! A residual vector is weighted as a whole. The threshold is in units of the noise: metres or millimetres do
//! not matter, nor the seed beyond the choice of subsets. More than half of outliers need a stated σ.
//! Huber 1964; Yang et al. 2020 (GNC); Torr & Zisserman 2000 (MSAC); Rousseeuw 1984 (LMedS).

use calib_geometry::{
    Verdict,
    decompose::symmetric_eigen_small,
    measured::{Cloud, Pose},
};
use nalgebra::{Matrix3, Matrix4, Vector3, Vector4};

use crate::{
    hotspot, hotspot_ml,
    input::{Input, cloud_of},
    options::Options,
    outcome::{CorError, Outcome, RejectReason, Rejected},
    seeded::Seeded,
    sphere::prepare,
    sphere_ml,
};

/// χ²(0.999) for 1 and 3 degrees of freedom.
const GATE: [f64; 2] = [10.828, 16.266];
/// χ²(0.5) for 1 and 3 degrees of freedom: turns a median square into a variance.
const MEDIAN: [f64; 2] = [0.4549, 2.3660];
/// Huber's constants: 95 % efficiency at the normal for one, the same for three degrees of freedom.
const HUBER: [f64; 2] = [1.345, 2.8];
/// Samples that score a subset; more would not rank subsets better.
const SCORED: usize = 1000;
/// Rounds of Huber's weights, enough to forget which four samples the consensus drew.
const HUBER_ROUNDS: usize = 8;
/// Huber's weights end at this multiple of the gate (25: five times its distance).
const FAR: f64 = 25.0;
/// Graduation of Geman & McClure's weights; the last ones repeat until they stand still.
const MU: [f64; 9] = [8.0, 5.0, 3.0, 2.0, 1.5, 1.0, 1.0, 1.0, 1.0];
/// Rounds of the gate.
const ROUNDS: usize = 30;
/// Part of the largest squared residual that counts as rounding on exact data.
const EXACT: f64 = 1e-24;

/// Robust fit: spheres for points and markers, hot spot for poses.
///
/// # Errors
/// [`CorError`] for data that are not finite, not rotations, or of another kind.
pub fn robust(input: &Input<'_>, options: &Options) -> Result<Outcome, CorError> {
    dispatch("robust", input, options, true)
}

/// Consensus alone, inliers refitted: spheres for points and markers, the linear hot spot for poses
/// (what the field calls RANSAC pivot calibration).
///
/// # Errors
/// As [`robust`].
pub fn consensus(input: &Input<'_>, options: &Options) -> Result<Outcome, CorError> {
    dispatch("consensus", input, options, false)
}

fn dispatch(
    estimator: &'static str,
    input: &Input<'_>,
    options: &Options,
    reweight: bool,
) -> Result<Outcome, CorError> {
    options.check()?;
    match input {
        Input::Poses(poses) => poses_fit(estimator, poses, options, reweight),
        _ => points_fit(estimator, input, options, reweight),
    }
}

/// A model that can be fitted with weights and measured against each sample.
trait Model {
    type Estimate: Clone;
    /// Index into the tables of constants: 0 for one, 1 for three residual components.
    const DOF: usize;
    /// Unknowns, for the finite-sample factor of the median.
    fn unknowns(&self) -> usize;
    fn samples(&self) -> usize;
    fn subset_fit(&self, random: &mut Seeded) -> Option<Self::Estimate>;
    /// `|residual|²` of sample k.
    fn square(&self, estimate: &Self::Estimate, k: usize) -> f64;
    fn weighted(&self, start: &Self::Estimate, weights: &[f64]) -> Option<Self::Estimate>;
}

/// Flags of the inliers, residuals and noise; `None` where no subset gave a model.
fn inliers<M: Model>(
    model: &M,
    options: &Options,
    reweight: bool,
) -> Option<(Vec<bool>, Vec<f64>)> {
    let n = model.samples();
    let gate = GATE[M::DOF];
    let squares = |e: &M::Estimate| -> Vec<f64> { (0..n).map(|k| model.square(e, k)).collect() };
    // σ² of one component from the median of squared residuals; Rousseeuw's factor for small samples.
    let finite = 1.0 + 5.0 / (n as f64 - model.unknowns() as f64).max(1.0);
    let scale = |squares: &[f64]| match options.sigma_t {
        Some(sigma) if M::DOF == 0 => sigma * sigma,
        _ => (median(squares) / MEDIAN[M::DOF]) * finite * finite,
    };

    let mut random = Seeded::new(options.seed);
    let stride = n.div_ceil(SCORED);
    let mut best: Option<(f64, M::Estimate)> = None;
    let mut scored = Vec::with_capacity(n / stride + 1);
    for _ in 0..options.subsets {
        let Some(candidate) = model.subset_fit(&mut random) else {
            continue;
        };
        scored.clear();
        scored.extend((0..n).step_by(stride).map(|k| model.square(&candidate, k)));
        let score = match options.sigma_t {
            Some(sigma) if M::DOF == 0 => {
                scored.iter().map(|d| (d / (sigma * sigma)).min(gate)).sum()
            }
            _ => median(&scored),
        };
        if score.is_finite() && best.as_ref().is_none_or(|(lowest, _)| score < *lowest) {
            best = Some((score, candidate));
        }
    }
    let mut estimate = best?.1;

    if reweight {
        // The consensus decides the noise; reweighting may lower it, never let outliers widen it again.
        let mut variance = f64::INFINITY;
        for (round, mu) in std::iter::repeat_n(None, HUBER_ROUNDS)
            .chain(MU.iter().copied().map(Some))
            .enumerate()
        {
            let d = squares(&estimate);
            let floor = EXACT * d.iter().copied().fold(0.0, f64::max);
            variance = variance.min(scale(&d)).max(floor).max(f64::MIN_POSITIVE);
            let weight = |d2: f64| match mu {
                // A bounded pull is not enough for a sphere: far samples would drag it out of the basin.
                None if d2 > FAR * gate => 0.0,
                None => (HUBER[M::DOF] / d2.sqrt()).min(1.0),
                Some(mu) => (mu * gate / (d2 + mu * gate)).powi(2),
            };
            let weights: Vec<f64> = d.iter().map(|d| weight(d / variance)).collect();
            match model.weighted(&estimate, &weights) {
                Some(next) => estimate = next,
                None if round == 0 => return None,
                None => break,
            }
        }
    }

    let mut variance = scale(&squares(&estimate)).max(f64::MIN_POSITIVE);
    let mut keep = vec![true; n];
    let mut d = squares(&estimate);
    for _ in 0..ROUNDS {
        let next: Vec<bool> = d.iter().map(|d| *d <= gate * variance).collect();
        let weights: Vec<f64> = next.iter().map(|k| f64::from(u8::from(*k))).collect();
        let count = next.iter().filter(|k| **k).count();
        if count <= model.unknowns() {
            return None;
        }
        let Some(fitted) = model.weighted(&estimate, &weights) else {
            break;
        };
        estimate = fitted;
        d = squares(&estimate);
        if !(options.sigma_t.is_some() && M::DOF == 0) {
            let components = (2 * M::DOF + 1) * count - model.unknowns();
            let rss: f64 = d.iter().zip(&weights).map(|(d, w)| d * w).sum();
            variance = (rss / components as f64).max(f64::MIN_POSITIVE);
        }
        let settled = next == keep;
        keep = next;
        if settled {
            break;
        }
    }
    Some((keep, d.iter().map(|d| (d / variance).sqrt()).collect()))
}

fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    let middle = sorted.len() / 2;
    if sorted.is_empty() {
        return f64::NAN;
    }
    *sorted.select_nth_unstable_by(middle, f64::total_cmp).1
}

fn rejected(
    keep: &[bool],
    sigmas: &[f64],
    dof: usize,
    label: impl Fn(usize) -> (usize, usize),
) -> Vec<Rejected> {
    let gate_sigmas = GATE[dof].sqrt();
    (0..keep.len())
        .filter(|&k| !keep[k])
        .map(|k| {
            let (marker, row) = label(k);
            let reason = RejectReason::Outlier {
                residual_sigmas: sigmas[k],
                gate_sigmas,
            };
            Rejected {
                marker,
                row,
                reason,
            }
        })
        .collect()
}

fn no_consensus(estimator: &'static str, n: usize) -> Outcome {
    Outcome::NotObservable(crate::outcome::NotObservable {
        estimator,
        verdict: Verdict::Diverged,
        reason: format!("no subset of the {n} samples gives a center that others agree with"),
        known: crate::outcome::Known::Nothing,
    })
}

// ---- spheres -------------------------------------------------------------------------------------------

struct Spheres<'a> {
    cloud: &'a Cloud,
    marker_of: Vec<usize>,
}

impl Model for Spheres<'_> {
    type Estimate = (Vector3<f64>, Vec<f64>);
    const DOF: usize = 0;

    fn unknowns(&self) -> usize {
        3 + self.cloud.markers()
    }

    fn samples(&self) -> usize {
        self.cloud.points.len()
    }

    /// Four samples of one marker give a center; the radii are the medians of the distances.
    fn subset_fit(&self, random: &mut Seeded) -> Option<Self::Estimate> {
        let marker = self.marker_of[random.below(self.samples())];
        let points = self.cloud.marker(marker);
        if points.len() < 4 {
            return None;
        }
        let chosen = random.subset::<4>(points.len());
        // 2 m·x − c = |x|²
        let a = Matrix4::from_fn(|i, j| {
            if j < 3 {
                2.0 * points[chosen[i]][j]
            } else {
                -1.0
            }
        });
        let b = Vector4::from_fn(|i, _| points[chosen[i]].norm_squared());
        let x = a.lu().solve(&b)?;
        let center: Vector3<f64> = x.fixed_rows::<3>(0).into();
        let radii = (0..self.cloud.markers())
            .map(|p| {
                let lengths: Vec<f64> = self
                    .cloud
                    .marker(p)
                    .iter()
                    .map(|x| (x - center).norm())
                    .collect();
                median(&lengths)
            })
            .collect();
        Some((center, radii))
    }

    fn square(&self, (center, radii): &Self::Estimate, k: usize) -> f64 {
        let e = (self.cloud.points[k] - center).norm() - radii[self.marker_of[k]];
        e * e
    }

    fn weighted(&self, (start, _): &Self::Estimate, weights: &[f64]) -> Option<Self::Estimate> {
        let center = sphere_ml::isotropic(self.cloud, *start, weights);
        let radii = sphere_ml::weighted_radii(self.cloud, &center, weights);
        (center.iter().chain(&radii).all(|x| x.is_finite())).then_some((center, radii))
    }
}

fn points_fit(
    estimator: &'static str,
    input: &Input<'_>,
    options: &Options,
    reweight: bool,
) -> Result<Outcome, CorError> {
    let cloud = cloud_of(input, &options.covariances)?;
    if let Err(answer) = prepare(estimator, &cloud, false) {
        return Ok(answer);
    }
    let marker_of = (0..cloud.markers())
        .flat_map(|p| vec![p; cloud.starts[p + 1] - cloud.starts[p]])
        .collect();
    let model = Spheres {
        cloud: &cloud,
        marker_of,
    };
    let Some((keep, sigmas)) = inliers(&model, options, reweight) else {
        return Ok(no_consensus(estimator, cloud.points.len()));
    };
    let out = rejected(&keep, &sigmas, 0, |k| cloud.labels[k]);
    Ok(sphere_ml::fit_cloud(
        estimator,
        &cloud.select(&keep),
        options,
        out,
    ))
}

// ---- hot spot ------------------------------------------------------------------------------------------

struct HotSpots<'a> {
    poses: Vec<(usize, &'a Pose)>,
}

impl Model for HotSpots<'_> {
    type Estimate = (Vector3<f64>, Vector3<f64>);
    const DOF: usize = 1;

    fn unknowns(&self) -> usize {
        6
    }

    fn samples(&self) -> usize {
        self.poses.len()
    }

    fn subset_fit(&self, random: &mut Seeded) -> Option<Self::Estimate> {
        let chosen = random.subset::<3>(self.samples());
        solve(chosen.iter().map(|&k| (self.poses[k].1, 1.0)))
    }

    fn square(&self, (center, body_point): &Self::Estimate, k: usize) -> f64 {
        (self.poses[k].1.transform(body_point) - center).norm_squared()
    }

    fn weighted(&self, _: &Self::Estimate, weights: &[f64]) -> Option<Self::Estimate> {
        solve(
            self.poses
                .iter()
                .zip(weights)
                .map(|((_, pose), w)| (*pose, *w)),
        )
    }
}

/// Weighted linear hot spot; `None` where the rotations share an axis.
fn solve<'a>(
    poses: impl Iterator<Item = (&'a Pose, f64)> + Clone,
) -> Option<(Vector3<f64>, Vector3<f64>)> {
    let (mut total, mut mean_r, mut mean_t) = (0.0, Matrix3::zeros(), Vector3::zeros());
    for (pose, w) in poses.clone() {
        total += w;
        mean_r += pose.rotation * w;
        mean_t += pose.translation * w;
    }
    mean_r /= total;
    mean_t /= total;
    let (mut m, mut b) = (Matrix3::zeros(), Vector3::zeros());
    for (pose, w) in poses {
        let d = pose.rotation - mean_r;
        m += d.tr_mul(&d) * w;
        b -= d.tr_mul(&(pose.translation - mean_t)) * w;
    }
    let eigen = symmetric_eigen_small(&m);
    // A shared axis to within 10⁻⁵ rad: what it determines is rounding.
    if eigen.values[0] <= 1e-10 * eigen.values[2] {
        return None;
    }
    let p: Vector3<f64> = (0..3)
        .map(|k| {
            let v = eigen.vectors.column(k);
            v * (v.dot(&b) / eigen.values[k])
        })
        .sum();
    let center = mean_r * p + mean_t;
    center.iter().all(|x| x.is_finite()).then_some((center, p))
}

fn poses_fit(
    estimator: &'static str,
    poses: &[Option<Pose>],
    options: &Options,
    reweight: bool,
) -> Result<Outcome, CorError> {
    if let Err(answer) = hotspot::prepare(estimator, poses)? {
        return Ok(answer);
    }
    let seen: Vec<(usize, &Pose)> = poses
        .iter()
        .enumerate()
        .filter_map(|(row, p)| Some((row, p.as_ref()?)))
        .collect();
    let model = HotSpots { poses: seen };
    let Some((keep, sigmas)) = inliers(&model, options, reweight) else {
        return Ok(no_consensus(estimator, model.samples()));
    };
    let mut kept = poses.to_vec();
    for (k, (row, _)) in model.poses.iter().enumerate() {
        if !keep[k] {
            kept[*row] = None;
        }
    }
    let out = rejected(&keep, &sigmas, 1, |k| (0, model.poses[k].0));
    if reweight {
        hotspot_ml::fit_poses(estimator, &kept, options, out)
    } else {
        hotspot::linear(estimator, &kept, options, out, |sums, _| sums.body_point(0))
    }
}
