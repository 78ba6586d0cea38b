//! The hinge between poses by maximum likelihood: orientations weighed against positions.
//!
//! ```text
//! T_i = W Rz(θ_i) Y,   T̃_i = T_i exp(ξ_i),   ξ_i ~ N(0, σ_r² A_i + σ_t² B_i)                          (1)
//! one body:   A = diag(I, 0), B = diag(0, I)
//! two bodies: T̃ = (P exp α)⁻¹ (C exp β)  ⇒  ξ = β − Ad(T⁻¹) α:  A, B = the same + Ad(T⁻¹)(…)Ad(T⁻¹)ᵀ      (2)
//! dξ_i = Ad((Rz Y)⁻¹) dW + Ad(Y⁻¹) (dY + ẑ dθ_i)                                                  (3)
//! ```
//!
//! Each θ_i is eliminated from its own pose. Of dW the turn about z and the shift along z, of dY the turn about z do nothing that the
//! others cannot: nine unknowns are left. SARA's direction is that of the rotations alone; a body far from the axis knows more by its path, a body
//! near it by its orientations, and (1) takes both for what they are worth. σ_r and σ_t are stated, or estimated by restricted
//! maximum likelihood; two bodies are taken to be measured alike. It starts from [`crate::shared_axis`] and shares its verdicts.

use calib_estimator::{
    InputKind, Verdict,
    levenberg::{Problem, Stop, minimize},
    measured::{Pose, RowWeights},
};
use calib_geometry::{Line, se3, so3};
use nalgebra::{
    Isometry3, Matrix3, Matrix6, Point3, Rotation3, SMatrix, SVector, Translation3, Unit,
    UnitQuaternion, Vector3, Vector6,
};

use crate::{
    axis_frame::AxisFrame,
    judge::weak_direction,
    options::{EstimatorInfo, POSES},
    outcome::{AorEstimate, Known, Outcome},
    shared_axis,
};
use calib_estimator::{EstimatorError, Input, Options};

/// What `hinge_poses` is and needs.
pub(crate) const INFO: EstimatorInfo = EstimatorInfo {
    id: "hinge_poses",
    name: "axis of poses, errors in variables",
    input: InputKind::OneOrTwoBodies,
    options: POSES,
    summary: "weighs orientations against positions, of one or two moving bodies",
    source: "joint likelihood, see the book",
    fit,
};

const ID: &str = "hinge_poses";
/// Levenberg–Marquardt steps; from SARA's axis a handful suffice.
const MAX_STEPS: usize = 60;
/// Rounds of re-estimating the noise.
const NOISE_ROUNDS: usize = 60;
/// σ_r in rad, and σ_t as a part of the lengths, below which data count as exact.
const EXACT: f64 = 1e-11;

type Nine = SMatrix<f64, 9, 9>;
type SixByNine = SMatrix<f64, 6, 9>;

/// Axis of one body's poses, or between two bodies.
///
/// # Errors
/// [`EstimatorError`] for tables of different length, matrices that are no rotations, or another kind of data.
pub fn fit(input: &Input<'_>, options: &Options) -> Result<Outcome, EstimatorError> {
    let outcome = shared_axis::run(ID, input, options)?;
    let Outcome::Estimate(start) = outcome else {
        return Ok(outcome);
    };
    let two_bodies = matches!(input, Input::TwoBodies { .. });
    let weights = RowWeights(&options.weights);
    let (poses, weights): (Vec<Isometry3<f64>>, Vec<f64>) = shared_axis::parent_from_child(input)?
        .iter()
        .enumerate()
        .filter_map(|(row, pose)| Some((isometry(pose.as_ref()?), weights.of(row))))
        .filter(|(_, w)| *w > 0.0)
        .unzip();
    if poses.len() < 3 {
        // Two poses are as many numbers as unknowns: nothing to weigh.
        return Ok(Outcome::Estimate(start));
    }
    Ok(refine(*start, &poses, &weights, two_bodies, options))
}

fn isometry(pose: &Pose) -> Isometry3<f64> {
    let rotation = Rotation3::from_matrix_unchecked(pose.rotation);
    Isometry3::from_parts(
        Translation3::from(pose.translation),
        UnitQuaternion::from_rotation_matrix(&rotation),
    )
}

fn refine(
    start: AorEstimate,
    poses: &[Isometry3<f64>],
    weights: &[f64],
    two_bodies: bool,
    options: &Options,
) -> Outcome {
    let frame = AxisFrame::of(start.line.direction.into_inner());
    let turn = Rotation3::from_matrix_unchecked(frame.matrix());
    let w = Isometry3::from_parts(
        Translation3::from(start.line.point.coords),
        UnitQuaternion::from_rotation_matrix(&turn),
    );
    let y = w.inverse() * poses[0];
    let angles = poses
        .iter()
        .map(|t| {
            let r = (w.inverse() * t * y.inverse()).rotation;
            2.0 * r.k.atan2(r.w)
        })
        .collect();
    let mut state = State { w, y, angles };
    let scale = poses
        .iter()
        .map(|t| (t.translation.vector - w.translation.vector).norm())
        .fold(0.0, f64::max)
        .max(f64::MIN_POSITIVE);
    let mut sigma_r = options.sigma_r.unwrap_or(1e-2);
    let mut sigma_t = options.sigma_t.unwrap_or(1e-2 * scale);
    let mut ended = None;
    let mut change = f64::INFINITY;
    for round in 0..NOISE_ROUNDS {
        let problem = Hinge::of(poses, weights, two_bodies, [sigma_r, sigma_t], scale);
        let fixed = options.sigma_r.is_some() && options.sigma_t.is_some();
        // While the noise levels still move, a few steps for each round are enough.
        let steps = if fixed || change < 1e-6 { MAX_STEPS } else { 4 };
        let end = minimize(&problem, state.clone(), steps);
        if end.stop == Stop::Broken {
            return diverged("no minimum of the likelihood");
        }
        state = end.x;
        let Some(c) = inverse_of_nine(&end.normal.hessian) else {
            return diverged("the poses do not fix the axis");
        };
        let [of_r, of_t] = problem.components(&state, &end.normal, &c);
        let (old_r, old_t) = (sigma_r, sigma_t);
        if options.sigma_r.is_none() {
            sigma_r = (sigma_r * of_r.sqrt()).max(EXACT);
        }
        if options.sigma_t.is_none() {
            sigma_t = (sigma_t * of_t.sqrt()).max(EXACT * scale);
        }
        let last = change;
        change = (sigma_r / old_r - 1.0)
            .abs()
            .max((sigma_t / old_t - 1.0).abs());
        let rss = poses
            .iter()
            .zip(&state.angles)
            .zip(weights)
            .map(|((t, a), w)| {
                w * (state.modeled(*a).translation.vector - t.translation.vector).norm_squared()
            })
            .sum::<f64>();
        let rss = rss * poses.len() as f64 / weights.iter().sum::<f64>();
        ended = Some((c, rss));
        if fixed || (change < 1e-9 && last < 1e-6) || round + 1 == NOISE_ROUNDS {
            break;
        }
    }
    let Some((c, rss)) = ended else {
        return diverged("no round of the noise was made");
    };
    estimate(&start, &state, &c, rss, sigma_r, sigma_t, poses, options)
}

fn diverged(reason: &str) -> Outcome {
    Outcome::none(ID, Verdict::Diverged, reason.to_owned(), Known::Nothing)
}

#[allow(clippy::too_many_arguments)]
fn estimate(
    start: &AorEstimate,
    state: &State,
    c: &Nine,
    rss: f64,
    sigma_r: f64,
    sigma_t: f64,
    poses: &[Isometry3<f64>],
    options: &Options,
) -> Outcome {
    let r = state.w.rotation.to_rotation_matrix().into_inner();
    let mut axis: Vector3<f64> = r.column(2).into();
    // Beside the middle of the motion, as the other estimators report it.
    let middle = poses
        .iter()
        .map(|t| t.translation.vector)
        .sum::<Vector3<f64>>()
        / poses.len() as f64;
    let origin = state.w.translation.vector;
    let along = (middle - origin).dot(&axis);
    let point = origin + axis * along;
    // dn = R (ω_y, −ω_x, 0);  dp = R (v_x, v_y, 0) + along · dn
    let mut out = SMatrix::<f64, 6, 9>::zeros();
    for row in 0..3 {
        out[(row, 0)] = -r[(row, 1)];
        out[(row, 1)] = r[(row, 0)];
        out[(3 + row, 0)] = -r[(row, 1)] * along;
        out[(3 + row, 1)] = r[(row, 0)] * along;
        out[(3 + row, 2)] = r[(row, 0)];
        out[(3 + row, 3)] = r[(row, 1)];
    }
    let covariance: Matrix6<f64> = out * c * out.transpose();
    let of_direction: Matrix3<f64> = covariance.fixed_view::<3, 3>(0, 0).into();
    let sigma_direction = of_direction.symmetric_eigenvalues().max().max(0.0).sqrt();
    // Seen from the body: Y⁻¹.
    let child_from_joint = state.y.inverse();
    let mut child_axis = child_from_joint.rotation * Vector3::z();
    let child_point = child_from_joint * Point3::new(0.0, 0.0, along);
    if axis.dot(&start.line.direction) < 0.0 {
        axis = -axis;
        child_axis = -child_axis;
    }
    let (verdict, reason) = weak_direction(sigma_direction, options, || {
        format!(
            "the body turns too little for noise of {:.2}° and {sigma_t:.2e}",
            sigma_r.to_degrees()
        )
    });
    Outcome::Estimate(Box::new(AorEstimate {
        line: Line {
            point: Point3::from(point),
            direction: Unit::new_normalize(axis),
        },
        in_child: Some(Line {
            point: child_point,
            direction: Unit::new_normalize(child_axis),
        }),
        covariance,
        sigma_direction,
        sigma: sigma_t,
        rms: (rss / (3 * poses.len()) as f64).sqrt(),
        verdict,
        reason,
        ..start.clone()
    }))
}

#[derive(Clone)]
struct State {
    /// parent_from_joint.
    w: Isometry3<f64>,
    /// joint_from_child.
    y: Isometry3<f64>,
    angles: Vec<f64>,
}

impl State {
    fn at(&self, angle: f64) -> Isometry3<f64> {
        UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle) * self.y
    }

    fn modeled(&self, angle: f64) -> Isometry3<f64> {
        self.w * self.at(angle)
    }
}

/// One pose: residual, its Jacobian over the nine and over its own angle, and the angle's weight.
struct Row {
    residual: Vector6<f64>,
    weighted: Vector6<f64>,
    of_nine: SixByNine,
    of_angle: Vector6<f64>,
    /// sᵀWs.
    own: f64,
}

struct Normal {
    rows: Vec<Row>,
    hessian: Nine,
    gradient: SVector<f64, 9>,
    cost: f64,
}

struct Hinge<'a> {
    poses: &'a [Isometry3<f64>],
    /// Inverse covariance of each pose's noise.
    weights: Vec<Matrix6<f64>>,
    /// σ_r² A and σ_t² B of each pose, over its weight.
    parts: Vec<[Matrix6<f64>; 2]>,
    two_bodies: bool,
    scale: f64,
}

impl<'a> Hinge<'a> {
    fn of(
        poses: &'a [Isometry3<f64>],
        weights: &[f64],
        two_bodies: bool,
        [sigma_r, sigma_t]: [f64; 2],
        scale: f64,
    ) -> Self {
        let diagonal = |r: f64, t: f64| {
            Matrix6::from_diagonal(&Vector6::new(r * r, r * r, r * r, t * t, t * t, t * t))
        };
        let own = [diagonal(sigma_r, 0.0), diagonal(0.0, sigma_t)];
        let parts: Vec<[Matrix6<f64>; 2]> = poses
            .iter()
            .zip(weights)
            .map(|(t, w)| {
                let own = own.map(|m| m / *w);
                if !two_bodies {
                    return own;
                }
                let back = se3::adjoint(&t.inverse());
                own.map(|m| m + back * m * back.transpose())
            })
            .collect();
        let weights = parts
            .iter()
            .map(|[a, b]| inverse_scaled(&(a + b)))
            .collect();
        Self {
            poses,
            weights,
            parts,
            two_bodies,
            scale,
        }
    }

    /// For each of the two variances the factor that restricted maximum likelihood puts on it:
    /// Σ eᵀW V W e / Σ tr(P V), P = W − W (prediction's covariance) W.
    fn components(&self, x: &State, normal: &Normal, c: &Nine) -> [f64; 2] {
        debug_assert_eq!(x.angles.len(), normal.rows.len());
        let (mut seen, mut expected) = ([0.0; 2], [0.0; 2]);
        for ((row, w), parts) in normal.rows.iter().zip(&self.weights).zip(&self.parts) {
            let s = row.of_angle;
            let g = row.of_nine - s * (s.transpose() * w * row.of_nine) / row.own;
            let predicted = g * c * g.transpose() + s * s.transpose() / row.own;
            let p = w - w * predicted * w;
            // The residual after its own angle has been fitted is the residual itself at the minimum.
            for k in 0..2 {
                seen[k] += row.weighted.dot(&(parts[k] * row.weighted));
                expected[k] += (p * parts[k]).trace();
            }
        }
        // Between two bodies a rotation of one is a translation of the other, and the share of one kind of noise can come out as none: the
        // least informative prior that forbids it, p(σ) ∝ σ (Chung et al. 2013), where there is something to share.
        let prior = |k: usize| {
            if self.two_bodies {
                f64::min(1.0, 0.5 * expected[k])
            } else {
                0.0
            }
        };
        [0, 1].map(|k| {
            if expected[k] > 1e-9 {
                (seen[k] + prior(k)) / expected[k]
            } else {
                1.0
            }
        })
    }
}

/// Inverse of the curvature, whose angles and lengths differ by decades.
fn inverse_of_nine(hessian: &Nine) -> Option<Nine> {
    let d = hessian
        .diagonal()
        .map(|x| if x > 0.0 { x.sqrt().recip() } else { 0.0 });
    let inverse = Nine::from_fn(|i, k| hessian[(i, k)] * d[i] * d[k])
        .cholesky()?
        .inverse();
    Some(Nine::from_fn(|i, k| inverse[(i, k)] * d[i] * d[k]))
}

/// Inverse of a covariance whose angles and lengths differ by decades.
fn inverse_scaled(m: &Matrix6<f64>) -> Matrix6<f64> {
    let d = m
        .diagonal()
        .map(|x| if x > 0.0 { x.sqrt().recip() } else { 0.0 });
    let scaled = Matrix6::from_fn(|i, k| m[(i, k)] * d[i] * d[k]);
    let inverse = scaled
        .cholesky()
        .map_or_else(Matrix6::identity, |c| c.inverse());
    Matrix6::from_fn(|i, k| inverse[(i, k)] * d[i] * d[k])
}

impl Problem for Hinge<'_> {
    type Point = State;
    type Normal = Normal;
    type Step = (SVector<f64, 9>, Vec<f64>);

    fn linearize(&self, x: &State) -> Normal {
        let of_y = se3::adjoint(&x.y.inverse());
        let of_angle: Vector6<f64> = of_y.column(2).into();
        let mut normal = Normal {
            rows: Vec::with_capacity(self.poses.len()),
            hessian: Nine::zeros(),
            gradient: SVector::zeros(),
            cost: 0.0,
        };
        for ((pose, w), angle) in self.poses.iter().zip(&self.weights).zip(&x.angles) {
            let inner = x.at(*angle);
            let model = x.w * inner;
            let turn = so3::log(&(model.rotation.inverse() * pose.rotation));
            let shift =
                model.rotation.inverse() * (pose.translation.vector - model.translation.vector);
            let residual = Vector6::new(turn.x, turn.y, turn.z, shift.x, shift.y, shift.z);
            let of_w = se3::adjoint(&inner.inverse());
            let mut of_nine = SixByNine::zeros();
            for (column, of) in [0, 1, 3, 4].into_iter().enumerate() {
                of_nine.set_column(column, &of_w.column(of));
            }
            for (column, of) in [0, 1, 3, 4, 5].into_iter().enumerate() {
                of_nine.set_column(4 + column, &of_y.column(of));
            }
            let weighted = w * residual;
            let seen = w * of_angle;
            let own = of_angle.dot(&seen);
            let pull = of_angle.dot(&weighted) / own;
            let coupled = of_nine.tr_mul(&seen);
            normal.hessian += of_nine.tr_mul(&(w * of_nine)) - coupled * coupled.transpose() / own;
            normal.gradient -= of_nine.tr_mul(&weighted) - coupled * pull;
            normal.cost += residual.dot(&weighted);
            normal.rows.push(Row {
                residual,
                weighted,
                of_nine,
                of_angle,
                own,
            });
        }
        normal
    }

    fn cost(&self, normal: &Normal) -> f64 {
        normal.cost
    }

    fn solve(&self, normal: &Normal, damping: f64) -> Option<(Self::Step, f64)> {
        // Angles and lengths differ by decades: the diagonal scales both damping and factor.
        let d = normal
            .hessian
            .diagonal()
            .map(|x| if x > 0.0 { x.sqrt().recip() } else { 0.0 });
        let mut h = Nine::from_fn(|i, k| normal.hessian[(i, k)] * d[i] * d[k]);
        for k in 0..9 {
            h[(k, k)] += damping;
        }
        let step = -h
            .cholesky()?
            .solve(&normal.gradient.component_mul(&d))
            .component_mul(&d);
        let mut after = 0.0;
        let angles: Vec<f64> = normal
            .rows
            .iter()
            .zip(&self.weights)
            .map(|(row, w)| {
                let left = row.residual - row.of_nine * step;
                let turn = row.of_angle.dot(&(w * left)) / row.own;
                let left = left - row.of_angle * turn;
                after += left.dot(&(w * left));
                turn
            })
            .collect();
        Some(((step, angles), normal.cost - after))
    }

    fn retract(&self, x: &State, (step, angles): &Self::Step) -> State {
        let w = se3::Twist(Vector6::new(step[0], step[1], 0.0, step[2], step[3], 0.0));
        let y = se3::Twist(Vector6::new(
            step[4], step[5], 0.0, step[6], step[7], step[8],
        ));
        State {
            w: x.w * se3::exp(&w),
            y: x.y * se3::exp(&y_in_joint(&x.y, &y)),
            angles: x.angles.iter().zip(angles).map(|(a, d)| a + d).collect(),
        }
    }

    fn is_negligible(&self, x: &State, (step, angles): &Self::Step) -> bool {
        let turn = step[0]
            .abs()
            .max(step[1].abs())
            .max(step[4].abs())
            .max(step[5].abs());
        let shift = [2, 3, 6, 7, 8]
            .iter()
            .map(|k| step[*k].abs())
            .fold(0.0, f64::max);
        let own = angles.iter().map(|a| a.abs()).fold(0.0, f64::max);
        let far = x.w.translation.vector.norm() + self.scale;
        turn.max(own) <= 1e-14 && shift <= 1e-14 * far
    }
}

/// dY acts on the joint's side, `exp(dY) Y = Y exp(Ad(Y⁻¹) dY)`.
fn y_in_joint(y: &Isometry3<f64>, step: &se3::Twist) -> se3::Twist {
    se3::Twist(se3::adjoint(&y.inverse()) * step.0)
}
