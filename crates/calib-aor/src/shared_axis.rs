//! The axis that all rotations of a body share: SARA, and from the rotations alone.
//!
//! ```text
//! R_i x_child − x_parent = −p_i           for every point of the axis                           (1)
//! SARA: direction = weakest right singular vector of [R_i  −S_i], point = minimum norm       (Ehrig et al. 2007)
//! one fixed body: the top singular pair of Σ R_i;  two bodies: of the relative rotations     (2)
//! ```
//!
//! Noise of the orientations, seen in the spread about the other axes, gives the covariance of the direction.
//! A ball joint has no such axis: its second direction is as weak as the first, and the verdict is `not_unique`.

use calib_estimator::pose_sums::PoseSums;
use calib_estimator::{
    InputKind, Verdict, chance,
    measured::{DataError, Pose, RowWeights},
};
use calib_geometry::Line;
use nalgebra::{Matrix3, Matrix6, Point3, Unit, Vector3};

use crate::{
    axis_frame::sign,
    judge::weak_direction,
    options::{EstimatorInfo, ROTATIONS},
    outcome::{AorEstimate, Known, Outcome},
};
use calib_estimator::{EstimatorError, Input, Options};

/// λ_min / λ_mid of the rotations' spread above which no axis stands out: a hinge's noise stays far below,
/// a ball's directions differ by less.
const STANDS_OUT: f64 = 0.25;

/// What `sara` is and needs.
pub(crate) const SARA: EstimatorInfo = EstimatorInfo {
    id: "sara",
    name: "symmetrical axis of rotation",
    input: InputKind::OneOrTwoBodies,
    options: ROTATIONS,
    summary: "axis that is fixed in one or two moving bodies",
    source: "Ehrig et al. 2007 (SARA)",
    fit: sara,
};

/// SARA: direction and point. Its direction is that of the rotations alone, as [`rotation_axis`]'s; the positions place the
/// axis. [`crate::hinge_poses`] lets them turn it too.
///
/// # Errors
/// [`EstimatorError`] for tables of different length, matrices that are no rotations, or another kind of data.
pub fn sara(input: &Input<'_>, options: &Options) -> Result<Outcome, EstimatorError> {
    run("sara", input, options)
}

/// What `rotation_axis` is and needs.
pub(crate) const ROTATION_AXIS: EstimatorInfo = EstimatorInfo {
    id: "rotation_axis",
    name: "axis of the rotations",
    input: InputKind::OneOrTwoBodies,
    options: ROTATIONS,
    summary: "direction from orientations alone",
    source: "top singular pair of the mean rotation",
    fit: rotation_axis,
};

/// The direction from the rotations alone. The point is that of least squares for this direction, so
/// position errors cannot tilt the axis.
///
/// # Errors
/// As [`sara`].
pub fn rotation_axis(input: &Input<'_>, options: &Options) -> Result<Outcome, EstimatorError> {
    run("rotation_axis", input, options)
}

pub(crate) fn run(
    estimator: &'static str,
    input: &Input<'_>,
    options: &Options,
) -> Result<Outcome, EstimatorError> {
    options.check()?;
    let relative = parent_from_child(input)?;
    let weights = RowWeights(&options.weights);
    let sums = PoseSums::weighted(&relative, weights)?;
    if let Some(answer) = without_rotation(estimator, &sums) {
        return Ok(answer);
    }
    let n = sums.n as f64;
    let two_bodies = matches!(input, Input::TwoBodies { .. });
    let dof = 2.0 * n - 4.0;
    if dof <= 0.0 && options.sigma_r.is_none() {
        let of = "poses where no orientation noise is stated";
        return Ok(Outcome::too_few(estimator, sums.n, 3, of));
    }
    // Spread about the weakest direction is noise alone: λ_min = 2 s₆² ~ σ_r² χ²(2n − 4).
    let spread = if two_bodies { 2.0 } else { 1.0 };
    let estimated = if dof > 0.0 {
        (sums.lambda[0].max(0.0) / dof).sqrt()
    } else {
        0.0
    };
    let sigma_r = options.sigma_r.map_or(estimated, |s| s * f64::sqrt(spread));
    if let Some(answer) = without_axis(estimator, &sums, sigma_r, options) {
        return Ok(answer);
    }

    let (child_axis, parent_axis) = sums.axis();
    let child_point = sums.body_point(1);
    let parent_point = sums.center(&child_point);
    // The point of the axis beside the middle of the motion, whatever the frames' origins are.
    let toward_middle = (sums.mean_t - parent_point).dot(&parent_axis);
    let parent_point = parent_point + parent_axis.into_inner() * toward_middle;
    let child_point = child_point + child_axis.into_inner() * toward_middle;

    let (rss, across) = squares(
        &relative,
        weights,
        (&child_point, &parent_point),
        &parent_axis,
    );
    let sigma = if dof > 0.0 {
        (across / dof).sqrt()
    } else {
        0.0
    };

    let covariance = covariance(&sums, &parent_axis, &child_point, (sigma_r, sigma));
    let of_direction: Matrix3<f64> = covariance.fixed_view::<3, 3>(0, 0).into();
    let sigma_direction = of_direction.symmetric_eigenvalues().max().max(0.0).sqrt();

    // Turn of each pose about the axis, against the encoder.
    let turns = relative
        .iter()
        .zip(&options.angles)
        .filter_map(|(pose, q)| {
            Some((
                turn_about(&pose.as_ref()?.rotation, &sums.mean_r, &parent_axis),
                *q,
            ))
        });
    let s = sign(&parent_axis, options.towards, turns);
    let (verdict, reason) = weak_direction(sigma_direction, options, || {
        format!(
            "the body turns too little for an orientation noise of {:.2}°",
            sigma_r.to_degrees()
        )
    });
    let flipped = |axis: Unit<Vector3<f64>>| if s < 0.0 { -axis } else { axis };
    Ok(Outcome::Estimate(Box::new(AorEstimate {
        estimator,
        line: Line {
            point: Point3::from(parent_point),
            direction: flipped(parent_axis),
        },
        in_child: Some(Line {
            point: Point3::from(child_point),
            direction: flipped(child_axis),
        }),
        covariance,
        sigma_direction,
        tau: 0.0,
        circles: Vec::new(),
        sigma,
        degrees_of_freedom: (dof > 0.0).then_some(dof),
        contradicts: None,
        rms: (rss / (3.0 * sums.total)).sqrt(),
        used: sums.n,
        rejected: Vec::new(),
        verdict,
        reason,
    })))
}

/// The answer where there are too few poses, or the body does not turn at all.
fn without_rotation(estimator: &'static str, sums: &PoseSums) -> Option<Outcome> {
    match sums.rank_verdict() {
        Some(Verdict::TooFew) => {
            let reason = format!("{} poses, at least 2 are needed", sums.n);
            Some(Outcome::none(
                estimator,
                Verdict::TooFew,
                reason,
                Known::Nothing,
            ))
        }
        Some(Verdict::NoRotation) => {
            let reason = format!(
                "the body does not turn: its rotations differ by {:.1e} rad rms",
                (sums.lambda.sum().max(0.0) / 2.0 / sums.total).sqrt()
            );
            Some(Outcome::none(
                estimator,
                Verdict::NoRotation,
                reason,
                Known::Nothing,
            ))
        }
        _ => None,
    }
}

/// The answer where no axis stands out, or the turn is no more than the orientation noise.
fn without_axis(
    estimator: &'static str,
    sums: &PoseSums,
    sigma_r: f64,
    options: &Options,
) -> Option<Outcome> {
    let n = sums.n as f64;
    let dof = 2.0 * n - 4.0;
    if sums.lambda[0] > STANDS_OUT * sums.lambda[1] {
        let reason = format!(
            "no axis stands out: the rotations spread {:.2}° rms about the best axis's perpendicular and \
             {:.2}° about the next",
            (sums.lambda[0].max(0.0) / sums.total).sqrt().to_degrees(),
            (sums.lambda[1] / sums.total).sqrt().to_degrees()
        );
        return Some(Outcome::none(
            estimator,
            Verdict::NotUnique,
            reason,
            Known::Nothing,
        ));
    }
    if sigma_r > 0.0 {
        // H₀: the body does not turn, Σ‖R − R̄‖² = 2 Σ|δ|²
        let turning = sums.lambda.sum() / 2.0 / (sigma_r * sigma_r);
        let all = 3.0 * n - 3.0;
        let chance = match options.sigma_r {
            Some(_) => chance::chi2_tail(turning, all),
            None => chance::f_tail(turning / all, all, dof),
        };
        if chance > options.significance {
            let reason = format!(
                "the body turns by {:.3}° rms, which {} poses do not distinguish from its orientation noise of {:.3}° (chance {chance:.1e})",
                (sums.lambda.sum() / 2.0 / sums.total).sqrt().to_degrees(),
                sums.n,
                sigma_r.to_degrees()
            );
            return Some(Outcome::none(
                estimator,
                Verdict::NoRotation,
                reason,
                Known::Nothing,
            ));
        }
    }
    None
}

/// Weighted squares of R_i x_child + p_i − x_parent, whole and across the axis.
fn squares(
    relative: &[Option<Pose>],
    weights: RowWeights<'_>,
    (child_point, parent_point): (&Vector3<f64>, &Vector3<f64>),
    parent_axis: &Unit<Vector3<f64>>,
) -> (f64, f64) {
    let (mut rss, mut across) = (0.0, 0.0);
    for (row, pose) in relative.iter().enumerate() {
        let Some(pose) = pose else { continue };
        let w = weights.of(row);
        let e = pose.transform(child_point) - parent_point;
        rss += w * e.norm_squared();
        across += w * (e - parent_axis.into_inner() * e.dot(parent_axis)).norm_squared();
    }
    (rss, across)
}

/// Over [direction; point], from the noise of orientations and positions.
fn covariance(
    sums: &PoseSums,
    parent_axis: &Unit<Vector3<f64>>,
    child_point: &Vector3<f64>,
    (sigma_r, sigma): (f64, f64),
) -> Matrix6<f64> {
    // M⁺ over the two strong directions, carried to the parent.
    let mut strong = Matrix3::zeros();
    for k in 1..3 {
        let v = sums.directions.column(k);
        strong += v * v.transpose() / sums.lambda[k];
    }
    let strong = sums.mean_r * strong * sums.mean_r.transpose();
    let perpendicular = Matrix3::identity() - parent_axis.into_inner() * parent_axis.transpose();
    let per_mean = perpendicular / sums.total;
    let of_direction = perpendicular * strong * perpendicular * (sigma_r * sigma_r)
        + per_mean * (sigma_r * sigma_r);
    let of_point =
        perpendicular * strong * perpendicular * (sigma * sigma) + per_mean * (sigma * sigma);
    // Noise of the orientations lengthens the spread M by 2(n−1)σ_r² and draws the point towards the body's origin.
    let (p, count) = (child_point, sums.n as f64 - 1.0);
    let drawn = |k: usize| {
        let v = sums.directions.column(k);
        v * (v.dot(p) * 2.0 * count * sigma_r * sigma_r / sums.lambda[k])
    };
    let drawn = sums.mean_r * (drawn(1) + drawn(2));
    let of_point = of_point + perpendicular * drawn * drawn.transpose() * perpendicular;
    let mut covariance = Matrix6::zeros();
    covariance
        .fixed_view_mut::<3, 3>(0, 0)
        .copy_from(&of_direction);
    covariance.fixed_view_mut::<3, 3>(3, 3).copy_from(&of_point);
    covariance
}

/// The child's poses in the parent, row by row.
pub(crate) fn parent_from_child(input: &Input<'_>) -> Result<Vec<Option<Pose>>, EstimatorError> {
    match *input {
        Input::Poses(poses) => Ok(poses.to_vec()),
        Input::TwoBodies { parent, child } => {
            if parent.len() != child.len() {
                return Err(EstimatorError::Data(DataError::Lengths {
                    what: "poses of the two bodies",
                    left: parent.len(),
                    right: child.len(),
                }));
            }
            parent
                .iter()
                .zip(child)
                .enumerate()
                .map(|(row, pair)| {
                    let (Some(a), Some(b)) = pair else {
                        return Ok(None);
                    };
                    a.check(row)?;
                    b.check(row)?;
                    Ok(Some(Pose {
                        rotation: a.rotation.tr_mul(&b.rotation),
                        translation: a.rotation.tr_mul(&(b.translation - a.translation)),
                    }))
                })
                .collect()
        }
        _ => Err(input.wrong(InputKind::OneOrTwoBodies)),
    }
}

/// Angle of `rotation · meanᵀ` about an axis of the parent.
fn turn_about(rotation: &Matrix3<f64>, mean: &Matrix3<f64>, axis: &Unit<Vector3<f64>>) -> f64 {
    let relative = rotation * mean.transpose();
    let k = axis.iamin();
    let across = Vector3::ith(k, 1.0).cross(axis).normalize();
    let image = relative * across;
    axis.cross(&across).dot(&image).atan2(across.dot(&image))
}
