//! The frame of a joint by maximum likelihood over all poses and joint angles at once.
//!
//! ```text
//! predicted_i = W · Rot(proximal, α_i) · Rot(distal, β_i) · Y,   W = world_from_joint, Y = joint_from_body
//! minimize Σ |t_i − t̂_i|² / σ_t² + |log(R̂_iᵀ R_i)|² / σ_r²         over W, Y (12 unknowns)        (1)
//! start: R_W A_i = R_i R_Yᵀ linear in 18 entries, projected; then R_W A_i p + O = t_i linear         (2)
//! ```
//!
//! No grid is needed, and rotations count: on the paper's 6 × 6 grid the axes come out three times better than by planes.
//! The two axes are orthogonal and meet by assumption. Noise levels that are not stated are estimated with the
//! degrees of freedom each kind of residual loses to the unknowns. The angles count as exact.

use calib_estimator::{
    Verdict,
    levenberg::{Problem, Stop, minimize},
    measured::Pose,
};
use calib_geometry::{
    decompose::{svd, symmetric_eigen_small},
    se3::{self, Twist},
    so3,
};
use nalgebra::{
    DMatrix, Isometry3, Matrix3, Matrix6, Rotation3, SMatrix, SVector, Translation3,
    UnitQuaternion, Vector3,
};

use crate::{
    frame::{FrameEstimate, FrameOutcome, axes_in_body, residuals},
    frame_settings::{check, judge},
    outcome::{Known, NotObservable},
};
use calib_estimator::{EstimatorError, FrameAxes, FrameSample, Input, InputKind, Options};

const ID: &str = "frame_ml";
const MAX_STEPS: usize = 100;
/// Rounds of re-estimating the two noise levels.
const NOISE_ROUNDS: usize = 50;
/// Samples that the linear start looks at; more would only cost time.
const START_SAMPLES: usize = 200;
/// Scaled information below which a direction of the unknowns is not seen at all.
const UNSEEN: f64 = 1e-10;

type Matrix12 = SMatrix<f64, 12, 12>;
type Vector12 = SVector<f64, 12>;

/// Which residuals count.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Residuals {
    /// Positions and orientations.
    Poses,
    /// Positions only; the body's orientation relative to the joint is then the mean of the samples.
    Points,
}

/// The maximum-likelihood frame on [`Input::TwoJoints`].
///
/// # Errors
/// As [`fit`]; also for another kind of data.
pub fn by_poses(input: &Input<'_>, options: &Options) -> Result<FrameOutcome, EstimatorError> {
    let Input::TwoJoints { samples, .. } = *input else {
        return Err(input.wrong(InputKind::TwoJoints));
    };
    fit(samples, Residuals::Poses, options)
}

/// The maximum-likelihood frame.
///
/// # Errors
/// [`EstimatorError`] for poses that are no rotations, numbers that are not finite, or unusable options.
pub fn fit(
    samples: &[FrameSample],
    which: Residuals,
    options: &Options,
) -> Result<FrameOutcome, EstimatorError> {
    check(samples, options)?;
    let none = |verdict, reason: String| {
        Ok(FrameOutcome::NotObservable(NotObservable {
            estimator: ID,
            verdict,
            reason,
            known: Known::Nothing,
        }))
    };
    let seen: Vec<Seen> = samples
        .iter()
        .filter_map(|s| {
            let pose = *s.seen()?;
            Some(Seen {
                turn: options.axes.turned(s.proximal, s.distal),
                pose,
                measured: so3::quaternion_of(&Rotation3::from_matrix_unchecked(pose.rotation)),
                weight: s.weight,
            })
        })
        .collect();
    let n = seen.len();
    if n < 3 {
        return none(Verdict::TooFew, format!("{n} poses, at least 3 are needed"));
    }
    for (name, other, range) in [
        ("proximal", "distal", range(samples, |s| s.proximal)),
        ("distal", "proximal", range(samples, |s| s.distal)),
    ] {
        if range <= options.same_angle {
            let reason = format!(
                "the {name} joint moves by {:.2}° only: the {other} axis alone is a line, and the frame's \
                 origin on it and turn about it stay free",
                range.to_degrees()
            );
            return none(Verdict::SingleAxis, reason);
        }
    }
    let Some(start) = linear_start(&seen) else {
        return none(
            Verdict::NotUnique,
            "the joint angles and the measured rotations do not fix one frame".into(),
        );
    };

    let scale = start.y.translation.vector.norm().max(start.spread);
    let floor = 1e-12 * scale.max(f64::MIN_POSITIVE);
    let mut problem = Joint {
        seen: &seen,
        sigma_t: options.sigma_t.unwrap_or(1.0_f64.max(floor)),
        sigma_r: options.sigma_r.unwrap_or(1.0),
        with_rotations: which == Residuals::Poses,
        scale,
    };
    if options.sigma_t.is_none() || options.sigma_r.is_none() {
        let normal = problem.linearize(&start.state());
        problem.sigma_t = options
            .sigma_t
            .unwrap_or((normal.t2 / (3 * n) as f64).sqrt().max(floor));
        problem.sigma_r = options
            .sigma_r
            .unwrap_or((normal.r2 / (3 * n) as f64).sqrt().max(1e-12));
    }
    let mut state = start.state();
    let mut end;
    let mut round = 0;
    loop {
        end = minimize(&problem, state, MAX_STEPS);
        state = end.x.clone();
        round += 1;
        if end.stop == Stop::Broken {
            return none(
                Verdict::Diverged,
                format!("no minimum after {} steps", end.iterations),
            );
        }
        let Some(inverse) = problem.inverse(&end.normal) else {
            break;
        };
        // Degrees of freedom that each kind of residual loses: tr(H⁻¹ H_t), tr(H⁻¹ H_r).
        let share_t = (inverse * end.normal.of_positions).trace();
        let share_r = (inverse * end.normal.of_rotations).trace();
        let dof = (3 * n) as f64;
        let t = (end.normal.t2 / (dof - share_t).max(1.0)).sqrt().max(floor);
        let r = (end.normal.r2 / (dof - share_r).max(1.0)).sqrt().max(1e-12);
        let (old_t, old_r) = (problem.sigma_t, problem.sigma_r);
        problem.sigma_t = options.sigma_t.unwrap_or(t);
        problem.sigma_r = options.sigma_r.unwrap_or(r);
        let change = (problem.sigma_t / old_t - 1.0)
            .abs()
            .max((problem.sigma_r / old_r - 1.0).abs());
        if change < 1e-10 || round >= NOISE_ROUNDS {
            break;
        }
    }
    let normal = problem.linearize(&state);
    let Some(inverse) = problem.inverse(&normal) else {
        return none(
            Verdict::NotUnique,
            "some turn or shift of the frame leaves all predictions unchanged".into(),
        );
    };
    let (mut joint_from_body, world_from_joint) = (state.y, state.w);
    let mut of_y: Matrix6<f64> = inverse.fixed_view::<6, 6>(6, 6).into();
    if which == Residuals::Points {
        // The rotation part of Y was not measured by positions: take the samples' mean.
        let turned = |s: &Seen| (world_from_joint.rotation * s.turn).inverse() * s.measured;
        let rotations = seen.iter().map(|s| (turned(s), s.weight));
        let Ok(rotation) = calib_geometry::mean::weighted_chordal_mean(rotations) else {
            return none(
                Verdict::NotUnique,
                "the body's orientations have no mean".into(),
            );
        };
        // Errors of W and of the place go together: R_W exp(a) turns sample i's orientation by −A_iᵀ a, the mean by −R_Yᵀ Ā a.
        let r = rotation.to_rotation_matrix();
        let turn = (rotation.inverse() * joint_from_body.rotation).to_rotation_matrix();
        let mean_turn = seen
            .iter()
            .map(|s| s.turn.to_rotation_matrix().into_inner() * s.weight)
            .sum::<Matrix3<f64>>()
            / total(&seen);
        let mut carried = SMatrix::<f64, 6, 12>::zeros();
        carried
            .fixed_view_mut::<3, 3>(0, 0)
            .copy_from(&-(mean_turn * r.matrix()).transpose());
        carried
            .fixed_view_mut::<3, 3>(3, 9)
            .copy_from(turn.matrix());
        joint_from_body.rotation = rotation;
        of_y = carried * inverse * carried.transpose();
        let per_mean = Matrix3::identity() * (problem.sigma_r * problem.sigma_r / total(&seen));
        let mut own = of_y.fixed_view_mut::<3, 3>(0, 0);
        own += per_mean;
    }
    let body_from_joint = joint_from_body.inverse();
    // X = Y⁻¹: X exp(ξ) with ξ = −Ad(Y) b
    let ad = se3::adjoint(&joint_from_body);
    let covariance = ad * of_y * ad.transpose();
    let (rms_t, rms_r) = residuals(samples, options.axes, &world_from_joint, &body_from_joint);
    let reach = body_from_joint.translation.vector.norm();
    let (verdict, reason) = judge(
        &covariance,
        reach,
        (rms_t, rms_r),
        (problem.sigma_t, problem.sigma_r),
        options,
    );
    let (proximal_in_body, distal_in_body) = axes_in_body(options.axes, &body_from_joint);
    Ok(FrameOutcome::Estimate(Box::new(FrameEstimate {
        estimator: ID,
        body_from_joint,
        covariance,
        world_from_joint,
        proximal_in_body,
        distal_in_body,
        orthogonality_defect: 0.0,
        sigma_t: problem.sigma_t,
        sigma_r: problem.sigma_r,
        noise_estimated: options.sigma_t.is_none() && options.sigma_r.is_none(),
        rms_t,
        rms_r,
        planes: (0, 0),
        used: n,
        verdict,
        reason,
    }))
    .checked())
}

fn range(samples: &[FrameSample], angle: impl Fn(&FrameSample) -> f64) -> f64 {
    let seen = || samples.iter().filter(|s| s.seen().is_some()).map(&angle);
    seen().fold(f64::NEG_INFINITY, f64::max) - seen().fold(f64::INFINITY, f64::min)
}

#[derive(Clone)]
pub(crate) struct State {
    pub w: Isometry3<f64>,
    pub y: Isometry3<f64>,
}

struct Start {
    w: Isometry3<f64>,
    y: Isometry3<f64>,
    /// Root mean square distance of the positions from their mean.
    spread: f64,
}

impl Start {
    fn state(&self) -> State {
        State {
            w: self.w,
            y: self.y,
        }
    }
}

/// A sample that counts.
struct Seen {
    /// The joint's turn by its angles.
    turn: UnitQuaternion<f64>,
    pose: Pose,
    /// The pose's rotation.
    measured: UnitQuaternion<f64>,
    weight: f64,
}

fn total(seen: &[Seen]) -> f64 {
    seen.iter().map(|s| s.weight).sum()
}

/// (2): rotations from a null vector, then positions.
fn linear_start(seen: &[Seen]) -> Option<Start> {
    let stride = seen.len().div_ceil(START_SAMPLES);
    let picked: Vec<&Seen> = seen.iter().step_by(stride).collect();
    // R_W A − R Q = 0 for the entries of R_W and Q = R_Yᵀ, column-major: (Aᵀ ⊗ I) vec R_W = (I ⊗ R) vec Q
    let mut rows = DMatrix::zeros(9 * picked.len(), 18);
    for (k, sample) in picked.iter().enumerate() {
        let a = sample.turn.to_rotation_matrix();
        for column in 0..3 {
            for i in 0..3 {
                let row = 9 * k + 3 * column + i;
                for l in 0..3 {
                    rows[(row, 3 * l + i)] = a[(l, column)];
                    rows[(row, 9 + 3 * column + l)] = -sample.pose.rotation[(i, l)];
                }
            }
        }
    }
    let null = svd(&rows).v.column(17).into_owned();
    let entry = |at: usize| Matrix3::from_fn(|i, j| null[at + 3 * j + i]);
    let (mut r_w, mut q) = (entry(0), entry(9));
    if r_w.determinant() < 0.0 {
        r_w = -r_w;
        q = -q;
    }
    let r_w = so3::nearest_rotation(&r_w)?;
    // Given R_W the best R_Y is a projection: it repairs a poor null vector.
    let sum = picked.iter().fold(Matrix3::zeros(), |sum, s| {
        let turned = (r_w * s.turn).to_rotation_matrix();
        sum + turned.matrix().transpose() * s.pose.rotation * s.weight
    });
    let r_y = so3::nearest_rotation(&sum).or_else(|| so3::nearest_rotation(&q.transpose()))?;

    let n = total(seen);
    let mean_t = seen
        .iter()
        .map(|s| s.pose.translation * s.weight)
        .sum::<Vector3<f64>>()
        / n;
    let turn = |s: &Seen| (r_w * s.turn).to_rotation_matrix().into_inner();
    let mean_r = seen
        .iter()
        .map(|s| turn(s) * s.weight)
        .sum::<Matrix3<f64>>()
        / n;
    let (mut m, mut b, mut spread) = (Matrix3::zeros(), Vector3::zeros(), 0.0);
    for s in seen {
        let d = turn(s) - mean_r;
        let t = s.pose.translation - mean_t;
        m += d.tr_mul(&d) * s.weight;
        b += d.tr_mul(&t) * s.weight;
        spread += s.weight * t.norm_squared();
    }
    let eigen = symmetric_eigen_small(&m);
    if eigen.values[0] <= 1e-12 * eigen.values[2] {
        return None;
    }
    let p = m.cholesky()?.solve(&b);
    let origin = mean_t - mean_r * p;
    Some(Start {
        w: Isometry3::from_parts(Translation3::from(origin), r_w),
        y: Isometry3::from_parts(Translation3::from(p), r_y),
        spread: (spread / n).sqrt(),
    })
}

struct Joint<'a> {
    seen: &'a [Seen],
    sigma_t: f64,
    sigma_r: f64,
    with_rotations: bool,
    scale: f64,
}

struct Normal {
    of_positions: Matrix12,
    of_rotations: Matrix12,
    gradient: Vector12,
    cost: f64,
    t2: f64,
    r2: f64,
}

impl Joint<'_> {
    /// Lengths in the unknowns are measured in `scale`, so that turns and shifts compare.
    fn scaling(&self) -> Vector12 {
        Vector12::from_fn(|i, _| if i % 6 < 3 { 1.0 } else { self.scale })
    }

    fn hessian(&self, normal: &Normal) -> Matrix12 {
        let mut h = normal.of_positions + normal.of_rotations;
        if !self.with_rotations {
            // Positions do not see the body's own orientation: hold it.
            for k in 6..9 {
                h[(k, k)] += 1.0;
            }
        }
        h
    }

    /// H⁻¹, or `None` where the data leave a direction free.
    fn inverse(&self, normal: &Normal) -> Option<Matrix12> {
        let h = self.hessian(normal);
        // Each unknown in units of its own information: turns, shifts, exact and noisy residuals compare.
        let unit = h
            .diagonal()
            .map(|x| if x > 0.0 { x.sqrt().recip() } else { 0.0 });
        let s = Matrix12::from_diagonal(&unit);
        let scaled = s * h * s;
        let eigen = symmetric_eigen_small(&scaled);
        if eigen.values[0] <= UNSEEN * eigen.values[11] {
            return None;
        }
        Some(s * scaled.cholesky()?.inverse() * s)
    }
}

impl Problem for Joint<'_> {
    type Point = State;
    type Normal = Normal;
    type Step = Vector12;

    fn linearize(&self, x: &State) -> Normal {
        let mut normal = Normal {
            of_positions: Matrix12::zeros(),
            of_rotations: Matrix12::zeros(),
            gradient: Vector12::zeros(),
            cost: 0.0,
            t2: 0.0,
            r2: 0.0,
        };
        for sample in self.seen {
            let Seen {
                turn,
                pose,
                measured,
                weight,
            } = sample;
            let (wt, wr) = (
                weight * self.sigma_t.powi(-2),
                weight * self.sigma_r.powi(-2),
            );
            let behind = turn * x.y;
            let predicted = x.w * behind;
            // W exp(a) · A Y exp(b):   δ = Ad((A Y)⁻¹) a + b,  residual falls by δ
            let ad = se3::adjoint(&behind.inverse());
            let u =
                predicted.rotation.inverse() * (pose.translation - predicted.translation.vector);
            let phi = so3::log(&(predicted.rotation.inverse() * measured));
            let top = ad.fixed_rows::<3>(0);
            let bottom = ad.fixed_rows::<3>(3);
            let mut j_t = SMatrix::<f64, 3, 12>::zeros();
            j_t.fixed_view_mut::<3, 6>(0, 0).copy_from(&bottom);
            j_t.fixed_view_mut::<3, 3>(0, 9).fill_with_identity();
            normal.of_positions += j_t.transpose() * j_t * wt;
            normal.gradient -= j_t.transpose() * u * wt;
            normal.t2 += weight * u.norm_squared();
            normal.r2 += weight * phi.norm_squared();
            normal.cost += u.norm_squared() * wt;
            if self.with_rotations {
                let mut j_r = SMatrix::<f64, 3, 12>::zeros();
                j_r.fixed_view_mut::<3, 6>(0, 0).copy_from(&top);
                j_r.fixed_view_mut::<3, 3>(0, 6).fill_with_identity();
                normal.of_rotations += j_r.transpose() * j_r * wr;
                normal.gradient -= j_r.transpose() * phi * wr;
                normal.cost += phi.norm_squared() * wr;
            }
        }
        normal
    }

    fn cost(&self, normal: &Normal) -> f64 {
        normal.cost
    }

    fn solve(&self, normal: &Normal, damping: f64) -> Option<(Vector12, f64)> {
        let mut h = self.hessian(normal);
        for k in 0..12 {
            h[(k, k)] *= 1.0 + damping;
        }
        let step = -h.cholesky()?.solve(&normal.gradient);
        Some((step, -step.dot(&normal.gradient)))
    }

    fn retract(&self, x: &State, step: &Vector12) -> State {
        let part = |at: usize| se3::exp(&Twist(step.fixed_rows::<6>(at).into()));
        let renormalized = |mut i: Isometry3<f64>| {
            i.rotation.renormalize();
            i
        };
        State {
            w: renormalized(x.w * part(0)),
            y: renormalized(x.y * part(6)),
        }
    }

    fn is_negligible(&self, _: &State, step: &Vector12) -> bool {
        step.component_div(&self.scaling()).amax() <= 1e-15
    }
}

/// Covariance of `body_from_joint` at the truth: the bound that no unbiased estimator beats.
///
/// `angles`: (proximal, distal) of every sample. `None` where they do not fix the frame.
#[must_use]
pub fn bound(
    axes: FrameAxes,
    angles: &[(f64, f64)],
    body_from_joint: &Isometry3<f64>,
    sigma_t: f64,
    sigma_r: f64,
) -> Option<Matrix6<f64>> {
    let y = body_from_joint.inverse();
    let seen: Vec<Seen> = angles
        .iter()
        .map(|(p, d)| {
            let turn = axes.turned(*p, *d);
            let predicted = turn * y;
            Seen {
                turn,
                pose: Pose::from(predicted),
                measured: predicted.rotation,
                weight: 1.0,
            }
        })
        .collect();
    let scale = y.translation.vector.norm().max(f64::MIN_POSITIVE);
    let problem = Joint {
        seen: &seen,
        sigma_t,
        sigma_r,
        with_rotations: true,
        scale,
    };
    let truth = State {
        w: Isometry3::identity(),
        y,
    };
    let inverse = problem.inverse(&problem.linearize(&truth))?;
    let ad = se3::adjoint(&y);
    let of_y: Matrix6<f64> = inverse.fixed_view::<6, 6>(6, 6).into();
    Some(ad * of_y * ad.transpose())
}
