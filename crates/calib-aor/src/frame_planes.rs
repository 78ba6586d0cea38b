//! Algorithm 1: the frame of a joint from a grid of poses, plane by plane.
//!
//! ```text
//! m        center of rotation of all samples (given, or by the caller's estimator)
//! for each distal angle held:    circle around the proximal axis → n              world
//! for each proximal angle held:  circle around the distal axis → n, turned back by Rot(AoR_p, −α)
//! AoR_p, AoR_d = sign-free means;  third = cross product;  project onto SO(3)
//! body_from_joint = mean of  world_from_body_i⁻¹ · world_from_joint(α_i, β_i)
//! ```
//!
//! The paper averages the distal normals in the tracker's frame; the distal axis turns with the proximal joint, so they
//! are brought back by the known joint angle first (over the hand's −45..135° the literal average is 45° wrong).
//! The signs of the axes follow from the joint angles. Samples that form no planes are refused:
//! [`crate::frame_ml`] needs none. The covariance is first order in the measured poses, the center's estimator included.

use calib_estimator::{InputKind, Verdict, measured::Pose};
use calib_geometry::{
    mean::{axis_mean, weighted_chordal_mean},
    se3, so3,
};
use nalgebra::{
    Isometry3, Matrix3, Matrix6, Point3, Rotation3, Translation3, Unit, UnitQuaternion, Vector3,
    Vector6,
};

pub use crate::frame_settings::{hand_axes, head_axes};
use crate::{
    frame::{FrameEstimate, FrameOutcome, axes_in_body, frame_from_axes, residuals},
    frame_grid::{Grid, ID, nearest_to_axes, none},
    frame_settings::{check, judge},
    options::{FRAMED, FrameInfo},
    outcome::NotObservable,
};
use calib_estimator::{EstimatorError, FrameAxes, FrameSample, Input, Options, PlaneFit, Rule};

/// What `algorithm1` is and needs.
pub(crate) const INFO: FrameInfo = FrameInfo {
    id: "algorithm1",
    name: "circles around both axes",
    input: InputKind::TwoJoints,
    options: FRAMED,
    summary: "circles around both axes, axes rotated back by the joint angles; the paper's Algorithm 1",
    source: "Chang & Pollard 2007; paper §4, Algorithm 1",
    fit,
};

/// A center-of-rotation estimator of the caller, over the body's poses in the tracker's frame.
pub type CenterOf<'a> = &'a dyn Fn(&[Option<Pose>]) -> Option<Point3<f64>>;

/// Where the center of rotation comes from.
#[derive(Clone, Copy)]
#[non_exhaustive]
pub enum Center<'a> {
    /// A point with its covariance, independent of these samples.
    Given {
        /// The center in the tracker's frame.
        point: Point3<f64>,
        /// Its covariance.
        covariance: Matrix3<f64>,
    },
    /// An estimator of the caller, run on these samples' poses; its noise is then shared with theirs.
    From(CenterOf<'a>),
    /// The point nearest to the axes of all circles.
    NearestToAxes,
}

/// Algorithm 1 on [`Input::TwoJoints`].
///
/// # Errors
/// As [`algorithm1`]; also for another kind of data.
pub fn fit(input: &Input<'_>, options: &Options) -> Result<FrameOutcome, EstimatorError> {
    let Input::TwoJoints { samples, center } = *input else {
        return Err(input.wrong(InputKind::TwoJoints));
    };
    let center = center.map_or(Center::NearestToAxes, |by| Center::From(by.0));
    algorithm1(samples, center, options)
}

/// Algorithm 1 on `samples`.
///
/// # Errors
/// [`EstimatorError`] for poses that are no rotations, numbers that are not finite, or unusable options.
pub fn algorithm1(
    samples: &[FrameSample],
    center: Center<'_>,
    options: &Options,
) -> Result<FrameOutcome, EstimatorError> {
    check(samples, options)?;
    if let Center::Given { point, covariance } = &center
        && !point.iter().chain(covariance.iter()).all(|x| x.is_finite())
    {
        return Err(EstimatorError::BadOption {
            name: "center",
            rule: Rule::Finite,
            value: f64::NAN,
        });
    }
    let seen = samples.iter().filter(|s| s.seen().is_some()).count();
    let grid = match Grid::of(samples, options) {
        Ok(grid) => grid,
        Err(answer) => return Ok(answer),
    };
    let base = match Base::fit(samples, &grid, &center, options) {
        Ok(base) => base,
        Err(answer) => return Ok(FrameOutcome::NotObservable(answer)),
    };
    let fitted = &base.fitted;
    let (rms_t, rms_r) = residuals(
        samples,
        options.axes,
        &fitted.world_from_joint,
        &fitted.body_from_joint,
    );
    let n = seen as f64;
    // Twelve unknowns over six residuals a sample: six to each kind of noise.
    let dof = (3.0 * n - 6.0).max(1.0);
    let total: f64 = samples
        .iter()
        .filter(|s| s.seen().is_some())
        .map(|s| s.weight)
        .sum();
    let sigma_t = options.sigma_t.unwrap_or(rms_t * (total / dof).sqrt());
    let sigma_r = options.sigma_r.unwrap_or(rms_r * (total / dof).sqrt());
    let covariance = propagate(samples, &grid, &center, options, &base, (sigma_t, sigma_r));
    let (proximal_in_body, distal_in_body) = axes_in_body(options.axes, &fitted.body_from_joint);
    let reach = fitted.body_from_joint.translation.vector.norm();
    let (verdict, reason) = judge(
        &covariance,
        reach,
        (rms_t, rms_r),
        (sigma_t, sigma_r),
        options,
    );
    Ok(FrameOutcome::Estimate(Box::new(FrameEstimate {
        estimator: ID,
        body_from_joint: fitted.body_from_joint,
        covariance,
        world_from_joint: fitted.world_from_joint,
        proximal_in_body,
        distal_in_body,
        orthogonality_defect: fitted.orthogonality_defect,
        sigma_t,
        sigma_r,
        noise_estimated: options.sigma_t.is_none() && options.sigma_r.is_none(),
        rms_t,
        rms_r,
        planes: (grid.around_proximal.len(), grid.around_distal.len()),
        used: seen,
        rejected: Vec::new(),
        verdict,
        reason,
    }))
    .checked())
}

/// The result with the intermediate steps that the covariance starts from.
struct Base {
    center: Point3<f64>,
    normals: Vec<Unit<Vector3<f64>>>,
    fitted: Fitted,
}

impl Base {
    /// The algorithm itself, without uncertainty.
    fn fit(
        samples: &[FrameSample],
        grid: &Grid,
        center: &Center<'_>,
        options: &Options,
    ) -> Result<Self, NotObservable> {
        let center = center_of(samples, grid, center)?;
        let normals = normals_of(samples, grid, &center, options)?;
        let fitted = assemble(samples, grid, &center, &normals, options)?;
        Ok(Self {
            center,
            normals,
            fitted,
        })
    }

    /// ∂n/∂m of every circle.
    fn slopes(
        &self,
        samples: &[FrameSample],
        grid: &Grid,
        options: &Options,
        step: f64,
    ) -> Vec<Matrix3<f64>> {
        let mut slopes = vec![Matrix3::zeros(); grid.circles()];
        // Only the paper's cost holds the center; and exact data have no noise to spread.
        if options.plane_fit != PlaneFit::PlanarRadial || step <= 0.0 {
            return slopes;
        }
        for axis in 0..3 {
            let beside = self.center + Vector3::ith(axis, step);
            let Ok(normals) = normals_of(samples, grid, &beside, options) else {
                continue;
            };
            for (c, n) in normals.iter().enumerate() {
                slopes[c].set_column(
                    axis,
                    &((n.into_inner() - self.normals[c].into_inner()) / step),
                );
            }
        }
        slopes
    }
}

struct Fitted {
    world_from_joint: Isometry3<f64>,
    body_from_joint: Isometry3<f64>,
    orthogonality_defect: f64,
}

/// Step 1: the center of rotation.
fn center_of(
    samples: &[FrameSample],
    grid: &Grid,
    center: &Center<'_>,
) -> Result<Point3<f64>, NotObservable> {
    match center {
        Center::Given { point, .. } => Ok(*point),
        Center::From(estimator) => {
            let poses: Vec<Option<Pose>> = samples.iter().map(|s| s.seen().copied()).collect();
            estimator(&poses).ok_or_else(|| {
                none(
                    Verdict::Diverged,
                    "the center of rotation has no estimate".into(),
                )
            })
        }
        Center::NearestToAxes => nearest_to_axes(samples, grid).ok_or_else(|| {
            none(
                Verdict::Parallel,
                "the circles' axes have no nearest point".into(),
            )
        }),
    }
}

/// Step 2: the axis of every circle in the tracker's frame, those around the proximal axis first.
fn normals_of(
    samples: &[FrameSample],
    grid: &Grid,
    m: &Point3<f64>,
    options: &Options,
) -> Result<Vec<Unit<Vector3<f64>>>, NotObservable> {
    (0..grid.circles())
        .map(|c| grid.normal_of(c, samples, m, options))
        .collect()
}

/// Step 3: means, cross product, projection, and the frame in the body.
fn assemble(
    samples: &[FrameSample],
    grid: &Grid,
    m: &Point3<f64>,
    normals: &[Unit<Vector3<f64>>],
    options: &Options,
) -> Result<Fitted, NotObservable> {
    let (around_proximal, around_distal) = normals.split_at(grid.around_proximal.len());
    let proximal = mean_axis(around_proximal).map_err(|why| none(Verdict::NotUnique, why))?;
    // The distal axis turns with the proximal joint: bring it back to α = 0.
    let turned_back: Vec<_> = around_distal
        .iter()
        .zip(&grid.around_distal)
        .map(|(n, rows)| {
            let held = rows.iter().map(|&k| samples[k].proximal).sum::<f64>() / rows.len() as f64;
            UnitQuaternion::from_axis_angle(&proximal, -held) * n
        })
        .collect();
    let distal = mean_axis(&turned_back).map_err(|why| none(Verdict::NotUnique, why))?;

    let FrameAxes {
        proximal: p,
        distal: d,
    } = options.axes;
    let frame = frame_from_axes((p, proximal), (d, distal)).map_err(|verdict| {
        let angle = proximal.cross(&distal).norm().asin();
        none(
            verdict,
            format!("the two axes differ by {:.1e}° only", angle.to_degrees()),
        )
    })?;
    let world_from_joint = Isometry3::from_parts(
        Translation3::from(m.coords),
        so3::quaternion_of(&frame.rotation),
    );

    let mut rotations = Vec::with_capacity(samples.len());
    let (mut origin, mut total) = (Vector3::zeros(), 0.0);
    for sample in samples {
        let Some(pose) = sample.seen() else {
            continue;
        };
        let measured = so3::quaternion_of(&Rotation3::from_matrix_unchecked(pose.rotation));
        let turned =
            world_from_joint.rotation * options.axes.turned(sample.proximal, sample.distal);
        rotations.push((measured.inverse() * turned, sample.weight));
        origin += pose.rotation.tr_mul(&(m.coords - pose.translation)) * sample.weight;
        total += sample.weight;
    }
    let rotation = weighted_chordal_mean(rotations)
        .map_err(|why| none(Verdict::NotUnique, why.to_string()))?;
    let body_from_joint = Isometry3::from_parts(Translation3::from(origin / total), rotation);
    Ok(Fitted {
        world_from_joint,
        body_from_joint,
        orthogonality_defect: frame.orthogonality_defect,
    })
}

/// Sign-free mean, pointing where most of the signed normals do.
fn mean_axis(normals: &[Unit<Vector3<f64>>]) -> Result<Unit<Vector3<f64>>, String> {
    let sum: Vector3<f64> = normals.iter().map(|n| n.into_inner()).sum();
    let reference = Unit::try_new(sum, 1e-12);
    axis_mean(normals, reference).map_err(|why| why.to_string())
}

/// First-order covariance of `body_from_joint`: each measured pose moved by a thousandth of its noise.
///
/// A moved sample changes its two circles and, through the center, all others a little; the latter by
/// the derivative of every normal in the center, so that only two circles are fitted again.
fn propagate(
    samples: &[FrameSample],
    grid: &Grid,
    center: &Center<'_>,
    options: &Options,
    base: &Base,
    (sigma_t, sigma_r): (f64, f64),
) -> Matrix6<f64> {
    /// Part of a standard deviation: small against curvature, large against rounding.
    const STEP: f64 = 1e-3;
    let zero_from = base.fitted.body_from_joint.inverse();
    let slopes = base.slopes(samples, grid, options, STEP * sigma_t);
    let respond = |moved: &[FrameSample], m: &Point3<f64>, touched: Option<usize>| {
        let shift = m - base.center;
        let normals: Option<Vec<_>> = (0..grid.circles())
            .map(|c| {
                let n = match touched {
                    Some(row) if grid.depends(c, row, options) => {
                        grid.normal_of(c, moved, &base.center, options).ok()?
                    }
                    _ => base.normals[c],
                };
                Some(Unit::new_normalize(n.into_inner() + slopes[c] * shift))
            })
            .collect();
        let fitted = assemble(moved, grid, m, &normals?, options).ok()?;
        Some(se3::log(&(zero_from * fitted.body_from_joint)).0 / STEP)
    };
    let mut covariance = Matrix6::zeros();
    // A response that does not exist cannot happen a thousandth of σ from one that does.
    let mut add = |d: Option<Vector6<f64>>| {
        if let Some(d) = d {
            covariance += d * d.transpose();
        }
    };
    let mut moved = samples.to_vec();
    for k in 0..samples.len() {
        let Some(pose) = samples[k].seen().copied() else {
            continue;
        };
        let root = samples[k].weight.sqrt();
        let (sigma_t, sigma_r) = (sigma_t / root, sigma_r / root);
        for axis in 0..3 {
            let mut shifted = pose;
            shifted.translation[axis] += STEP * sigma_t;
            moved[k].world_from_body = Some(shifted);
            if let Ok(m) = center_of(&moved, grid, center) {
                add(respond(&moved, &m, Some(k)));
            }
            let turn = so3::exp(&(Vector3::ith(axis, 1.0) * (STEP * sigma_r)));
            moved[k].world_from_body = Some(Pose {
                rotation: pose.rotation * turn.to_rotation_matrix().matrix(),
                translation: pose.translation,
            });
            if let Ok(m) = center_of(&moved, grid, center) {
                add(respond(&moved, &m, None));
            }
        }
        moved[k] = samples[k];
    }
    if let Center::Given {
        point,
        covariance: of_center,
    } = center
    {
        let eigen = calib_geometry::decompose::symmetric_eigen_small(of_center);
        for k in 0..3 {
            let sigma = eigen.values[k].max(0.0).sqrt();
            let m = point + eigen.vectors.column(k) * (STEP * sigma);
            add(respond(samples, &m, None));
        }
    }
    covariance
}
