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

use calib_geometry::{
    Verdict,
    mean::{axis_mean, chordal_mean},
    measured::Pose,
    se3, so3,
};
use nalgebra::{
    Isometry3, Matrix3, Matrix6, Point3, Rotation3, Translation3, Unit, UnitQuaternion, Vector3,
    Vector6,
};

use crate::{
    frame::{
        FrameAxes, FrameEstimate, FrameOutcome, FrameSample, Letter, axes_in_body, frame_from_axes,
        residuals,
    },
    input::Input,
    line_ml,
    options::Options,
    outcome::{AorError, Known, NotObservable, Outcome},
    planar_radial, plane,
};

/// A center-of-rotation estimator of the caller, over the body's poses in the tracker's frame.
pub type CenterOf<'a> = &'a dyn Fn(&[Option<Pose>]) -> Option<Point3<f64>>;

/// Where the center of rotation comes from.
#[derive(Clone, Copy)]
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

/// How each plane's axis is fitted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PlaneFit {
    /// Planar and radial cost with the center held: the paper's.
    PlanarRadial,
    /// The plane's normal.
    Plane,
    /// One line for all circles around the proximal axis, which does not move; orthogonal-distance circles around
    /// the distal one.
    CommonLine,
}

/// Settings of Algorithm 1.
#[derive(Debug, Clone, Copy)]
pub struct FrameOptions {
    /// Which coordinate axes the joints turn about.
    pub axes: FrameAxes,
    /// How each plane's axis is fitted.
    pub fit: PlaneFit,
    /// Angles closer than this count as the same grid line, rad. 0.01 (0.6°): above encoder noise,
    /// below any sensible grid step.
    pub same_angle: f64,
    /// Position noise where the tracker states it.
    pub sigma_t: Option<f64>,
    /// Orientation noise where the tracker states it, rad.
    pub sigma_r: Option<f64>,
    /// σ of a rotation above which the verdict is `weak`, rad.
    pub weak_angle: f64,
    /// σ of the origin, as a part of its distance from the body, above which the verdict is `weak`.
    pub weak_fraction: f64,
}

impl Default for FrameOptions {
    fn default() -> Self {
        Self {
            axes: FrameAxes::default(),
            fit: PlaneFit::PlanarRadial,
            same_angle: 0.01,
            sigma_t: None,
            sigma_r: None,
            weak_angle: Options::default().weak_angle,
            weak_fraction: 0.1,
        }
    }
}

const ID: &str = "algorithm1";

/// Algorithm 1 on `samples`.
///
/// # Errors
/// [`AorError`] for poses that are no rotations, numbers that are not finite, or unusable options.
pub fn algorithm1(
    samples: &[FrameSample],
    center: Center<'_>,
    options: &FrameOptions,
) -> Result<FrameOutcome, AorError> {
    check(samples, options)?;
    if let Center::Given { point, covariance } = &center
        && !point.iter().chain(covariance.iter()).all(|x| x.is_finite())
    {
        return Err(AorError::BadOption {
            name: "center",
            value: f64::NAN,
        });
    }
    let seen = samples
        .iter()
        .filter(|s| s.world_from_body.is_some())
        .count();
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
    let sigma_t = options.sigma_t.unwrap_or(rms_t * (n / dof).sqrt());
    let sigma_r = options.sigma_r.unwrap_or(rms_r * (n / dof).sqrt());
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
    Ok(FrameOutcome::estimated(FrameEstimate {
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
        verdict,
        reason,
    }))
}

/// # Errors
/// [`AorError`] as [`algorithm1`].
pub(crate) fn check(samples: &[FrameSample], options: &FrameOptions) -> Result<(), AorError> {
    for (name, value) in [
        ("sigma_t", options.sigma_t),
        ("sigma_r", options.sigma_r),
        ("same_angle", Some(options.same_angle)),
        ("weak_angle", Some(options.weak_angle)),
        ("weak_fraction", Some(options.weak_fraction)),
    ] {
        if let Some(value) = value
            && !(value.is_finite() && value > 0.0)
        {
            return Err(AorError::BadOption { name, value });
        }
    }
    if options.axes.proximal == options.axes.distal {
        let value = options.axes.distal.index() as f64;
        return Err(AorError::BadOption {
            name: "axes (both joints turn about the same letter)",
            value,
        });
    }
    for (row, sample) in samples.iter().enumerate() {
        if let Some(value) = [sample.proximal, sample.distal]
            .into_iter()
            .find(|angle| !angle.is_finite())
        {
            return Err(AorError::BadOption {
                name: "joint angle",
                value,
            });
        }
        if let Some(pose) = &sample.world_from_body {
            pose.check(row)?;
        }
    }
    Ok(())
}

/// `weak` where the orientation or the origin is known too badly, or the model does not explain the motion.
pub(crate) fn judge(
    covariance: &Matrix6<f64>,
    reach: f64,
    (rms_t, rms_r): (f64, f64),
    (sigma_t, sigma_r): (f64, f64),
    options: &FrameOptions,
) -> (Verdict, Option<String>) {
    /// Residuals this many times the stated noise are not noise.
    const MISFIT: f64 = 5.0;
    /// Orientation residuals of this size mean that the joint angles belong to another motion, rad (15°).
    const FOREIGN: f64 = 0.26;
    let misfit = (rms_t / (3.0_f64.sqrt() * sigma_t)).max(rms_r / (3.0_f64.sqrt() * sigma_r));
    if rms_r > FOREIGN || misfit > MISFIT {
        let text = format!(
            "the joint angles do not explain the motion: residuals of {rms_t:.2e} and {:.2}° rms, {misfit:.1} times \
             the noise (angles exchanged, of another sign or unit, or axes that do not meet?)",
            rms_r.to_degrees()
        );
        return (Verdict::Weak, Some(text));
    }
    let worst = |at: usize| {
        covariance
            .fixed_view::<3, 3>(at, at)
            .into_owned()
            .symmetric_eigenvalues()
            .max()
            .max(0.0)
            .sqrt()
    };
    let (turn, shift) = (worst(0), worst(3));
    if turn > options.weak_angle {
        let text = format!(
            "σ of the orientation is {:.2}°, more than {:.1}°",
            turn.to_degrees(),
            options.weak_angle.to_degrees()
        );
        (Verdict::Weak, Some(text))
    } else if shift > (options.weak_fraction * reach).max(sigma_t) {
        let text = format!(
            "σ of the origin is {shift:.2e}, more than {:.0} % of its distance {reach:.2e} from the body",
            100.0 * options.weak_fraction
        );
        (Verdict::Weak, Some(text))
    } else {
        (Verdict::Ok, None)
    }
}

/// Rows of each circle.
struct Grid {
    /// Rows of one held distal angle: circles around the proximal axis.
    around_proximal: Vec<Vec<usize>>,
    /// Rows of one held proximal angle: circles around the distal axis.
    around_distal: Vec<Vec<usize>>,
}

impl Grid {
    fn circles(&self) -> usize {
        self.around_proximal.len() + self.around_distal.len()
    }

    /// Rows of circle c, those around the proximal axis first.
    fn rows(&self, c: usize) -> &[usize] {
        let proximal = self.around_proximal.len();
        if c < proximal {
            &self.around_proximal[c]
        } else {
            &self.around_distal[c - proximal]
        }
    }

    /// Axis of circle c, its sense given by the swept joint angle.
    fn normal_of(
        &self,
        c: usize,
        samples: &[FrameSample],
        m: &Point3<f64>,
        options: &FrameOptions,
    ) -> Result<Unit<Vector3<f64>>, NotObservable> {
        if c < self.around_proximal.len() {
            let circles = match options.fit {
                PlaneFit::CommonLine => &self.around_proximal[..],
                _ => &self.around_proximal[c..=c],
            };
            circle_axis(samples, circles, |s| s.proximal, m, options)
        } else {
            let circle = std::slice::from_ref(&self.around_distal[c - self.around_proximal.len()]);
            circle_axis(samples, circle, |s| s.distal, m, options)
        }
    }

    /// True when a change of `row` changes the axis of circle c.
    fn depends(&self, c: usize, row: usize, options: &FrameOptions) -> bool {
        let common = options.fit == PlaneFit::CommonLine && c < self.around_proximal.len();
        self.rows(c).contains(&row)
            || (common && self.around_proximal.iter().any(|rows| rows.contains(&row)))
    }

    fn of(samples: &[FrameSample], options: &FrameOptions) -> Result<Self, FrameOutcome> {
        let around_proximal = planes(samples, options.same_angle, |s| (s.distal, s.proximal));
        let around_distal = planes(samples, options.same_angle, |s| (s.proximal, s.distal));
        let seen = samples
            .iter()
            .filter(|s| s.world_from_body.is_some())
            .count();
        for (axis, held, found) in [
            ("proximal", "distal", &around_proximal),
            ("distal", "proximal", &around_distal),
        ] {
            if found.is_empty() {
                return Err(FrameOutcome::NotObservable(NotObservable {
                    estimator: ID,
                    verdict: Verdict::TooFew,
                    reason: format!(
                        "the {seen} samples form no circle around the {axis} axis: no {held} angle is held \
                         (to {:.2}°) over three or more {axis} angles; scattered samples need `frame_ml`",
                        options.same_angle.to_degrees()
                    ),
                    known: Known::Nothing,
                }));
            }
        }
        Ok(Self {
            around_proximal,
            around_distal,
        })
    }
}

/// Groups of rows with the same held angle and at least three different swept angles.
fn planes(
    samples: &[FrameSample],
    same: f64,
    held_and_swept: impl Fn(&FrameSample) -> (f64, f64),
) -> Vec<Vec<usize>> {
    let mut rows: Vec<usize> = (0..samples.len())
        .filter(|&k| samples[k].world_from_body.is_some())
        .collect();
    rows.sort_by(|&a, &b| {
        held_and_swept(&samples[a])
            .0
            .total_cmp(&held_and_swept(&samples[b]).0)
    });
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for row in rows {
        let held = held_and_swept(&samples[row]).0;
        match groups.last_mut() {
            Some(group) if held - held_and_swept(&samples[group[0]]).0 <= same => group.push(row),
            _ => groups.push(vec![row]),
        }
    }
    groups.retain(|group| {
        let mut swept: Vec<f64> = group
            .iter()
            .map(|&k| held_and_swept(&samples[k]).1)
            .collect();
        swept.sort_by(f64::total_cmp);
        swept.dedup_by(|a, b| (*a - *b).abs() <= same);
        swept.len() >= 3
    });
    groups
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
        options: &FrameOptions,
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
        options: &FrameOptions,
        step: f64,
    ) -> Vec<Matrix3<f64>> {
        let mut slopes = vec![Matrix3::zeros(); grid.circles()];
        // Only the paper's cost holds the center; and exact data have no noise to spread.
        if options.fit != PlaneFit::PlanarRadial || step <= 0.0 {
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

fn none(verdict: Verdict, reason: String) -> NotObservable {
    NotObservable {
        estimator: ID,
        verdict,
        reason,
        known: Known::Nothing,
    }
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
            let poses: Vec<Option<Pose>> = samples.iter().map(|s| s.world_from_body).collect();
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
    options: &FrameOptions,
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
    options: &FrameOptions,
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
    let mut origin = Vector3::zeros();
    for sample in samples {
        let Some(pose) = &sample.world_from_body else {
            continue;
        };
        let measured = so3::quaternion_of(&Rotation3::from_matrix_unchecked(pose.rotation));
        let turned =
            world_from_joint.rotation * options.axes.turned(sample.proximal, sample.distal);
        rotations.push(measured.inverse() * turned);
        origin += pose.rotation.tr_mul(&(m.coords - pose.translation));
    }
    let rotation =
        chordal_mean(&rotations).map_err(|why| none(Verdict::NotUnique, why.to_string()))?;
    let body_from_joint = Isometry3::from_parts(
        Translation3::from(origin / rotations.len() as f64),
        rotation,
    );
    Ok(Fitted {
        world_from_joint,
        body_from_joint,
        orthogonality_defect: frame.orthogonality_defect,
    })
}

/// The axis of one circle, or of several around one line, its sense given by the swept joint angles.
fn circle_axis(
    samples: &[FrameSample],
    circles: &[Vec<usize>],
    swept: impl Fn(&FrameSample) -> f64,
    m: &Point3<f64>,
    options: &FrameOptions,
) -> Result<Unit<Vector3<f64>>, NotObservable> {
    // Every circle in its own rows of one table, so that the angles pair up.
    let rows: usize = circles.iter().map(Vec::len).sum();
    let mut tracks = vec![vec![None; rows]; circles.len()];
    let mut angles = Vec::with_capacity(rows);
    for (track, circle) in tracks.iter_mut().zip(circles) {
        for &k in circle {
            let pose = samples[k].world_from_body.as_ref();
            track[angles.len()] = pose.map(|p| Point3::from(p.translation));
            angles.push(swept(&samples[k]));
        }
    }
    let fit_options = Options {
        center: (options.fit != PlaneFit::CommonLine).then_some(*m),
        angles,
        // The mean over all planes is judged, not each plane.
        significance: 1.0,
        weak_angle: f64::MAX,
        ..Options::default()
    };
    let input = Input::Points(&tracks);
    let outcome = match options.fit {
        PlaneFit::PlanarRadial => planar_radial::gauss_newton(&input, &fit_options),
        PlaneFit::Plane => plane::fit(&input, &fit_options),
        PlaneFit::CommonLine => line_ml::line(&input, &fit_options),
    };
    match outcome {
        Ok(Outcome::Estimate(estimate)) => Ok(estimate.line.direction),
        Ok(Outcome::NotObservable(mut why)) => {
            why.estimator = ID;
            why.reason = format!("circles of {rows} samples: {}", why.reason);
            Err(why)
        }
        Err(error) => Err(none(
            error.verdict().unwrap_or(Verdict::Diverged),
            error.to_string(),
        )),
    }
}

/// Sign-free mean, pointing where most of the signed normals do.
fn mean_axis(normals: &[Unit<Vector3<f64>>]) -> Result<Unit<Vector3<f64>>, String> {
    let sum: Vector3<f64> = normals.iter().map(|n| n.into_inner()).sum();
    let reference = Unit::try_new(sum, 1e-12);
    axis_mean(normals, reference).map_err(|why| why.to_string())
}

/// Point of least squared distance to the axes of all circles.
fn nearest_to_axes(samples: &[FrameSample], grid: &Grid) -> Option<Point3<f64>> {
    let (mut a, mut b) = (Matrix3::zeros(), Vector3::zeros());
    let mut reference: Option<Vector3<f64>> = None;
    for rows in grid.around_proximal.iter().chain(&grid.around_distal) {
        let track: Vec<_> = rows
            .iter()
            .map(|&k| {
                samples[k]
                    .world_from_body
                    .as_ref()
                    .map(|p| Point3::from(p.translation))
            })
            .collect();
        let tracks = [track];
        let options = Options {
            significance: 1.0,
            weak_angle: f64::MAX,
            ..Options::default()
        };
        let Ok(Outcome::Estimate(e)) = plane::fit(&Input::Points(&tracks), &options) else {
            continue;
        };
        let n = e.line.direction.into_inner();
        let across = Matrix3::identity() - n * n.transpose();
        let from = *reference.get_or_insert(e.line.point.coords);
        a += across;
        b += across * (e.line.point.coords - from);
    }
    let eigen = calib_geometry::decompose::symmetric_eigen_small(&a);
    // Parallel axes have no nearest point.
    if eigen.values[0] <= 1e-9 * eigen.values[2] {
        return None;
    }
    Some(Point3::from(reference? + a.cholesky()?.solve(&b)))
}

/// First-order covariance of `body_from_joint`: each measured pose moved by a thousandth of its noise.
///
/// A moved sample changes its two circles and, through the center, all others a little; the latter by
/// the derivative of every normal in the center, so that only two circles are fitted again.
fn propagate(
    samples: &[FrameSample],
    grid: &Grid,
    center: &Center<'_>,
    options: &FrameOptions,
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
        let Some(pose) = samples[k].world_from_body else {
            continue;
        };
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

/// Letters of the paper's hand: z proximal, x distal.
#[must_use]
pub fn hand_axes() -> FrameAxes {
    FrameAxes {
        proximal: Letter::Z,
        distal: Letter::X,
    }
}

/// Letters of the paper's head: z (pan) proximal, y (tilt) distal.
#[must_use]
pub fn head_axes() -> FrameAxes {
    FrameAxes {
        proximal: Letter::Z,
        distal: Letter::Y,
    }
}
