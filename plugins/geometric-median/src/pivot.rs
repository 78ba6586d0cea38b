//! Poses: the body point whose images have the least sum of distances to one place.
//!
//! ```text
//! min over p, o   Σ_i ‖R_i p + t_i − o‖
//! ```

use calib_geometry::decompose::symmetric_eigen_small;
use calib_plugin::{Answer, BodyPose, Call, CorFit, Failure, Motion, Shape};
use nalgebra::{Matrix3, Matrix6, SMatrix, Vector3};

use crate::lines::{SETTLED, SMOOTHING, WEAK_FRACTION, inverse, largest_sigma, median, rows};

/// Orientation noise that is taken for granted where the tracker states none: 0.1°, a usual marker cluster.
const USUAL_SIGMA_R: f64 = 2e-3;
/// The motion about the weakest axis must exceed what noise alone shows by this factor, in standard deviations.
const EXCITATION_FACTOR: f64 = 3.0;

/// `reference_from_body`: tracker or parent from the moving body.
struct Pose {
    r: Matrix3<f64>,
    t: Vector3<f64>,
}

impl From<BodyPose> for Pose {
    fn from(pose: BodyPose) -> Self {
        let r = pose.rotation;
        Self {
            r: Matrix3::from_fn(|i, j| r[i][j]),
            t: pose.translation_m.into(),
        }
    }
}

struct Pivot {
    p: Vector3<f64>,
    o: Vector3<f64>,
}

/// The center of a body's motion, or of one body's motion in the other.
pub fn fit(motion: &Motion<'_>, call: &Call<'_>) -> Result<Answer<CorFit>, Failure> {
    let poses: Vec<Pose> = if motion.shape == Shape::TwoBodies {
        motion
            .poses(0)
            .zip(motion.poses(1))
            .filter_map(|(parent, child)| {
                let (a, b) = (Pose::from(parent?), Pose::from(child?));
                // parent_from_child = (tracker_from_parent)⁻¹ · tracker_from_child
                Some(Pose {
                    r: a.r.tr_mul(&b.r),
                    t: a.r.tr_mul(&(b.t - a.t)),
                })
            })
            .collect()
    } else {
        motion.poses(0).flatten().map(Pose::from).collect()
    };
    let n = poses.len();
    if n < 3 {
        return Ok(Answer::NotObservable(format!(
            "{n} poses, at least 3 are needed"
        )));
    }

    // The rotations' spread about each body axis: Σ (R − R̄)ᵀ (R − R̄) / n
    let spread = symmetric_eigen_small(&(normal(&poses, &vec![1.0; n]).0 / n as f64));
    let sigma_r = motion.sigma_r_rad.unwrap_or(USUAL_SIGMA_R);
    // Noise alone gives 2 σ_r² in the direction of a single axis.
    let weakest = spread.values[0].max(0.0).sqrt();
    let noise = EXCITATION_FACTOR * std::f64::consts::SQRT_2 * sigma_r;
    if weakest <= noise {
        return Ok(Answer::NotObservable(format!(
            "all rotations share one axis: off it they spread by {weakest:.1e} rad, {noise:.1e} are needed"
        )));
    }

    let iterations = call.integer("iterations")?;
    let Some((pivot, settled)) = reweighted(&poses, iterations, call)? else {
        return Ok(Answer::NotObservable(
            "the rotations do not determine a point".into(),
        ));
    };
    let distances = distances(&poses, &pivot);
    let rms = (distances.iter().map(|d| d * d).sum::<f64>() / (3 * n) as f64).sqrt();
    // A lever no longer than the residuals measures noise.
    let lever = pivot.p.norm();
    let typical = median(&distances);
    if lever * weakest <= typical && lever * sigma_r > 0.1 * typical {
        return Ok(Answer::NotObservable(format!(
            "off one axis the body moves by {:.1e} m, the residuals are {typical:.1e} m",
            lever * weakest
        )));
    }
    let Some(covariance) = covariance(&poses, &pivot) else {
        return Ok(Answer::NotObservable(
            "the center has no finite covariance".into(),
        ));
    };
    let of_o = covariance.fixed_view::<3, 3>(3, 3).into_owned();
    let sigma = largest_sigma(&of_o);
    let size = lever.max(typical);
    let weak = if !settled {
        Some(format!("still moving after {iterations} iterations"))
    } else if sigma > WEAK_FRACTION * size {
        Some(format!(
            "σ of the weakest direction is {sigma:.1e} m, the lever {lever:.1e} m"
        ))
    } else {
        None
    };
    let (p, o) = (<[f64; 3]>::from(pivot.p), <[f64; 3]>::from(pivot.o));
    Ok(Answer::Found(CorFit {
        center_m: o,
        covariance_m2: Some(rows(&of_o)),
        body_points_m: if motion.shape == Shape::TwoBodies {
            vec![o, p]
        } else {
            vec![p]
        },
        radii_m: Vec::new(),
        rms_m: rms,
        used: n,
        rejected: Vec::new(),
        weak,
    }))
}

fn distances(poses: &[Pose], pivot: &Pivot) -> Vec<f64> {
    poses
        .iter()
        .map(|pose| (pose.r * pivot.p + pose.t - pivot.o).norm())
        .collect()
}

/// `Σ w (R − R̄)ᵀ(R − R̄)`, `−Σ w (R − R̄)ᵀ(t − t̄)`, and the weighted means.
fn normal(
    poses: &[Pose],
    weights: &[f64],
) -> (Matrix3<f64>, Vector3<f64>, Matrix3<f64>, Vector3<f64>) {
    let total: f64 = weights.iter().sum();
    let (mut mean_r, mut mean_t) = (Matrix3::zeros(), Vector3::zeros());
    for (pose, w) in poses.iter().zip(weights) {
        mean_r += pose.r * (w / total);
        mean_t += pose.t * (w / total);
    }
    let (mut m, mut b) = (Matrix3::zeros(), Vector3::zeros());
    for (pose, w) in poses.iter().zip(weights) {
        let d = pose.r - mean_r;
        m += d.tr_mul(&d) * *w;
        b -= d.tr_mul(&(pose.t - mean_t)) * *w;
    }
    (m, b, mean_r, mean_t)
}

/// Iteratively reweighted least squares; true when it has settled.
fn reweighted(
    poses: &[Pose],
    iterations: i64,
    call: &Call<'_>,
) -> Result<Option<(Pivot, bool)>, Failure> {
    let mut weights = vec![1.0; poses.len()];
    let mut last: Option<Pivot> = None;
    for _ in 0..iterations {
        call.keep_going()?;
        let (m, b, mean_r, mean_t) = normal(poses, &weights);
        let Some(inverse) = inverse(&m) else {
            return Ok(None);
        };
        let p = inverse * b;
        let pivot = Pivot {
            o: mean_r * p + mean_t,
            p,
        };
        let size = pivot.p.norm() + pivot.o.norm();
        let step = last.map_or(f64::INFINITY, |l| {
            (l.p - pivot.p).norm() + (l.o - pivot.o).norm()
        });
        if step <= SETTLED * size {
            return Ok(Some((pivot, true)));
        }
        let d = distances(poses, &pivot);
        let epsilon = SMOOTHING * median(&d) + SETTLED * size + f64::MIN_POSITIVE.sqrt();
        for (weight, d) in weights.iter_mut().zip(&d) {
            // 1 / √(d² + ε²)
            *weight = epsilon / d.hypot(epsilon);
        }
        last = Some(pivot);
    }
    Ok(last.map(|pivot| (pivot, false)))
}

/// Of `[p; o]`: `A⁻¹ B A⁻¹` with the curvature A of the sum of distances and the outer product B of its gradients.
fn covariance(poses: &[Pose], pivot: &Pivot) -> Option<Matrix6<f64>> {
    let d = distances(poses, pivot);
    let size = pivot.p.norm() + pivot.o.norm();
    let epsilon = SMOOTHING * median(&d) + SETTLED * size + f64::MIN_POSITIVE.sqrt();
    let (mut a, mut b) = (Matrix6::zeros(), Matrix6::zeros());
    for (pose, d) in poses.iter().zip(&d) {
        // J = [R, −I];  s = √(d² + ε²);  u = r / s
        let mut j = SMatrix::<f64, 3, 6>::zeros();
        j.fixed_columns_mut::<3>(0).copy_from(&pose.r);
        j.fixed_columns_mut::<3>(3).copy_from(&-Matrix3::identity());
        let s = d.hypot(epsilon);
        let u = (pose.r * pivot.p + pose.t - pivot.o) / s;
        // In units of ε, so that A is of order one for exact data too.
        a += j.tr_mul(&((Matrix3::identity() - u * u.transpose()) * (epsilon / s) * j));
        let gradient = j.tr_mul(&u);
        b += gradient * gradient.transpose();
    }
    let n = poses.len() as f64;
    let inverse = a.try_inverse()? * epsilon;
    // Six numbers were fitted to 3 n.
    let covariance = inverse * b * inverse.transpose() * (n / (n - 2.0));
    covariance
        .iter()
        .all(|x| x.is_finite())
        .then_some(covariance)
}
