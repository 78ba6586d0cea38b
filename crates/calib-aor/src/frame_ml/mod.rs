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

mod model;
mod start;

use calib_estimator::{
    EstimatorError, FrameAxes, FrameSample, Input, InputKind, Options, Verdict,
    levenberg::{Problem as _, Stop, minimize},
    measured::Pose,
};
use calib_geometry::{se3, so3};
use nalgebra::{Isometry3, Matrix3, Matrix6, Rotation3, SMatrix};

use crate::{
    frame::{FrameEstimate, FrameOutcome, axes_in_body, residuals},
    frame_settings::{check, judge},
    options::{FRAMED, FrameInfo},
    outcome::Known,
};
use model::{Joint, Matrix12, Seen, State, total};
use start::linear_start;

/// What `frame_ml` is and needs.
pub(crate) const INFO: FrameInfo = FrameInfo {
    id: "frame_ml",
    name: "both axes by maximum likelihood",
    input: InputKind::TwoJoints,
    options: FRAMED,
    summary: "all poses and joint angles at once by maximum likelihood",
    source: "joint likelihood, see the book",
    fit: by_poses,
};

const ID: &str = "frame_ml";
const MAX_STEPS: usize = 100;
/// Rounds of re-estimating the two noise levels.
const NOISE_ROUNDS: usize = 50;

/// Which residuals count.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
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
    Ok(match estimate(samples, which, options) {
        Ok(frame) => FrameOutcome::Estimate(Box::new(frame)).checked(),
        Err((verdict, reason)) => FrameOutcome::none(ID, verdict, reason, Known::Nothing),
    })
}

/// Why there is no frame.
type Refusal = (Verdict, String);

fn estimate(
    samples: &[FrameSample],
    which: Residuals,
    options: &Options,
) -> Result<FrameEstimate, Refusal> {
    let seen = seen(samples, options);
    let n = seen.len();
    enough(samples, n, options)?;
    let start = linear_start(&seen).ok_or_else(|| {
        let reason = "the joint angles and the measured rotations do not fix one frame";
        (Verdict::NotUnique, reason.to_owned())
    })?;
    let scale = start.y.translation.vector.norm().max(start.spread);
    let floor = 1e-12 * scale.max(f64::MIN_POSITIVE);
    let mut problem = Joint {
        seen: &seen,
        sigma_t: options.sigma_t.unwrap_or(1.0_f64.max(floor)),
        sigma_r: options.sigma_r.unwrap_or(1.0),
        with_rotations: which == Residuals::Poses,
        scale,
    };
    let state = minimum(&mut problem, start.state(), floor, options)?;
    let normal = problem.linearize(&state);
    let inverse = problem.inverse(&normal).ok_or_else(|| {
        let reason = "some turn or shift of the frame leaves all predictions unchanged";
        (Verdict::NotUnique, reason.to_owned())
    })?;
    let (joint_from_body, of_y) = match which {
        Residuals::Poses => (state.y, inverse.fixed_view::<6, 6>(6, 6).into()),
        Residuals::Points => by_mean_orientation(&problem, &state, &inverse)?,
    };
    let body_from_joint = joint_from_body.inverse();
    // X = Y⁻¹: X exp(ξ) with ξ = −Ad(Y) b
    let ad = se3::adjoint(&joint_from_body);
    let covariance = ad * of_y * ad.transpose();
    let (rms_t, rms_r) = residuals(samples, options.axes, &state.w, &body_from_joint);
    let (verdict, reason) = judge(
        &covariance,
        body_from_joint.translation.vector.norm(),
        (rms_t, rms_r),
        (problem.sigma_t, problem.sigma_r),
        options,
    );
    let (proximal_in_body, distal_in_body) = axes_in_body(options.axes, &body_from_joint);
    Ok(FrameEstimate {
        estimator: ID,
        body_from_joint,
        covariance,
        world_from_joint: state.w,
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
        rejected: Vec::new(),
        verdict,
        reason,
    })
}

/// The samples that count.
fn seen(samples: &[FrameSample], options: &Options) -> Vec<Seen> {
    let seen = |s: &FrameSample| {
        let pose = *s.seen()?;
        Some(Seen {
            turn: options.axes.turned(s.proximal, s.distal),
            pose,
            measured: so3::quaternion_of(&Rotation3::from_matrix_unchecked(pose.rotation)),
            weight: s.weight,
        })
    };
    samples.iter().filter_map(seen).collect()
}

/// Three poses, and both joints move.
fn enough(samples: &[FrameSample], n: usize, options: &Options) -> Result<(), Refusal> {
    if n < 3 {
        let reason = format!("{n} poses, at least 3 are needed");
        return Err((Verdict::TooFew, reason));
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
            return Err((Verdict::SingleAxis, reason));
        }
    }
    Ok(())
}

/// The minimum of (1); noise levels that are not stated are estimated between the rounds and left in the problem.
fn minimum(
    problem: &mut Joint<'_>,
    start: State,
    floor: f64,
    options: &Options,
) -> Result<State, Refusal> {
    let dof = (3 * problem.seen.len()) as f64;
    if options.sigma_t.is_none() || options.sigma_r.is_none() {
        let normal = problem.linearize(&start);
        problem.sigma_t = options
            .sigma_t
            .unwrap_or((normal.t2 / dof).sqrt().max(floor));
        problem.sigma_r = options
            .sigma_r
            .unwrap_or((normal.r2 / dof).sqrt().max(1e-12));
    }
    let mut state = start;
    for _ in 0..NOISE_ROUNDS {
        let end = minimize(problem, state, MAX_STEPS);
        state = end.x;
        if end.stop == Stop::Broken {
            let reason = format!("no minimum after {} steps", end.iterations);
            return Err((Verdict::Diverged, reason));
        }
        let Some(inverse) = problem.inverse(&end.normal) else {
            break;
        };
        // Degrees of freedom that each kind of residual loses: tr(H⁻¹ H_t), tr(H⁻¹ H_r).
        let share_t = (inverse * end.normal.of_positions).trace();
        let share_r = (inverse * end.normal.of_rotations).trace();
        let t = (end.normal.t2 / (dof - share_t).max(1.0)).sqrt().max(floor);
        let r = (end.normal.r2 / (dof - share_r).max(1.0)).sqrt().max(1e-12);
        let (old_t, old_r) = (problem.sigma_t, problem.sigma_r);
        problem.sigma_t = options.sigma_t.unwrap_or(t);
        problem.sigma_r = options.sigma_r.unwrap_or(r);
        let change = (problem.sigma_t / old_t - 1.0)
            .abs()
            .max((problem.sigma_r / old_r - 1.0).abs());
        if change < 1e-10 {
            break;
        }
    }
    Ok(state)
}

/// Y with the samples' mean orientation, which positions do not measure, and its covariance.
fn by_mean_orientation(
    problem: &Joint<'_>,
    state: &State,
    inverse: &Matrix12,
) -> Result<(Isometry3<f64>, Matrix6<f64>), Refusal> {
    let seen = problem.seen;
    let turned = |s: &Seen| (state.w.rotation * s.turn).inverse() * s.measured;
    let rotations = seen.iter().map(|s| (turned(s), s.weight));
    let rotation = calib_geometry::mean::weighted_chordal_mean(rotations).map_err(|_| {
        let reason = "the body's orientations have no mean";
        (Verdict::NotUnique, reason.to_owned())
    })?;
    // Errors of W and of the place go together: R_W exp(a) turns sample i's orientation by −A_iᵀ a, the mean by −R_Yᵀ Ā a.
    let r = rotation.to_rotation_matrix();
    let turn = (rotation.inverse() * state.y.rotation).to_rotation_matrix();
    let mean_turn = seen
        .iter()
        .map(|s| s.turn.to_rotation_matrix().into_inner() * s.weight)
        .sum::<Matrix3<f64>>()
        / total(seen);
    let mut carried = SMatrix::<f64, 6, 12>::zeros();
    carried
        .fixed_view_mut::<3, 3>(0, 0)
        .copy_from(&-(mean_turn * r.matrix()).transpose());
    carried
        .fixed_view_mut::<3, 3>(3, 9)
        .copy_from(turn.matrix());
    let mut of_y: Matrix6<f64> = carried * inverse * carried.transpose();
    let per_mean = Matrix3::identity() * (problem.sigma_r * problem.sigma_r / total(seen));
    let mut own = of_y.fixed_view_mut::<3, 3>(0, 0);
    own += per_mean;
    let joint_from_body = Isometry3::from_parts(state.y.translation, rotation);
    Ok((joint_from_body, of_y))
}

fn range(samples: &[FrameSample], angle: impl Fn(&FrameSample) -> f64) -> f64 {
    let seen = || samples.iter().filter(|s| s.seen().is_some()).map(&angle);
    seen().fold(f64::NEG_INFINITY, f64::max) - seen().fold(f64::INFINITY, f64::min)
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
