//! The paper's method: each origin alone, by closed forms.
//!
//! ```text
//! center   m in the tracker from the sweep (§3)        axes by Algorithm 1 (§5.2), brought back by the joint angles
//! body_from_origin = mean over samples of T_i⁻¹ · world_from_origin(q_i)
//! ```
//!
//! The errata are applied: the frame is expressed in the *body*, axes are averaged without sign after they are turned
//! back by the known joint angles, and a sweep about one axis gives a line, never a point on it.

use std::collections::BTreeMap;

use calib_aor::frame_planes::algorithm1;
use calib_aor::{Center, FrameAxes, FrameAxis, FrameOutcome, FrameSample, Options};
use calib_finding::{About, Fact, Finding, catalog};
use calib_geometry::{Line, Twist, se3};
use calib_plugin::{BodyPose, MotionData, Shape};
use calib_profile::{BodyKind, Orientation, Origin, PointChoice};
use calib_report::{EstimatorResult, Status, Unit, Unobservable};
use nalgebra::{
    Isometry3, Matrix3, Matrix6, Point3, Rotation3, Translation3, UnitQuaternion, Vector3,
};

use crate::error::PipelineError;
use crate::estimate::start::{Start, mean_pose};
use crate::prepare::estimators::{CenterFit, Estimators};
use crate::prepare::inputs::{Inputs, Loaded};
use crate::prepare::tracks::BodyTrack;

/// One origin found by closed forms.
#[derive(Debug, Clone)]
pub struct OriginEstimate {
    /// `body_from_origin`; `None` where the data cannot give it.
    pub pose: Option<Isometry3<f64>>,
    /// 6×6 in `[ω; v]` of the origin.
    pub covariance: Option<Matrix6<f64>>,
    /// Directions that the sweep does not see; what is reported along them is a choice.
    pub unobservable: Vec<Unobservable>,
    /// Calibrated, or assumed where its orientation is taken from the description.
    pub status: Status,
    /// Center of rotation in the tracker's frame, where there is one.
    pub center: Option<Point3<f64>>,
    /// σ of the center along one axis (rms over the three), m, where the estimator states it.
    pub center_sigma: Option<f64>,
    /// Axis of rotation in the tracker's frame, where one joint was swept.
    pub axis: Option<Line>,
    /// σ of the axis' point across it (m) and of its direction (rad), where the estimator states them.
    pub axis_sigma: [Option<f64>; 2],
    /// The same quantity by other estimators.
    pub estimators: Vec<EstimatorResult>,
}

/// A row of a sweep that has joint positions and a pose of the body.
struct Row<'a> {
    q: &'a [f64],
    tracker_from_body: Isometry3<f64>,
}

/// All origins of the profile, by name. A failed origin is a finding, not an error.
///
/// # Errors
/// [`PipelineError::Usage`] for an estimator that does not exist or does not fit the data.
pub fn origins(
    inputs: &Inputs,
    tracks: &BTreeMap<String, BodyTrack>,
    start: &Start,
    estimators: &Estimators,
    findings: &mut Vec<Finding>,
) -> Result<BTreeMap<String, OriginEstimate>, PipelineError> {
    let mut found: BTreeMap<String, OriginEstimate> = BTreeMap::new();
    let profile = &inputs.robot.profile;
    // An origin whose point is counted from another comes after it.
    let depends = |o: &Origin| matches!(o.point, Some(PointChoice::NominalDistanceFrom(_)));
    let mut order: Vec<(&String, &Origin)> = profile.origins.iter().collect();
    order.sort_by_key(|(_, o)| depends(o));
    for (name, origin) in order {
        let task = Task {
            estimators,
            inputs,
            name,
            origin,
            track: &tracks[&origin.body],
            start,
        };
        let estimate = task.estimate(&found, findings)?;
        found.insert(name.clone(), estimate);
    }
    Ok(found)
}

/// A center, or why the data do not determine one.
type CenterOutcome = Result<CenterFit, String>;

/// The chosen estimator's center and what others say.
struct Centers {
    chosen: CenterOutcome,
    others: Vec<(&'static str, CenterOutcome)>,
}

fn center_sigma(estimate: &CenterFit) -> Option<f64> {
    let covariance = estimate.covariance?;
    Some((covariance.trace() / 3.0).max(0.0).sqrt())
}

fn body_pose(pose: &Isometry3<f64>) -> BodyPose {
    let r = pose.rotation.to_rotation_matrix();
    BodyPose {
        rotation: std::array::from_fn(|i| std::array::from_fn(|j| r[(i, j)])),
        translation_m: pose.translation.vector.into(),
    }
}

struct Task<'a> {
    estimators: &'a Estimators,
    inputs: &'a Inputs,
    name: &'a str,
    origin: &'a Origin,
    track: &'a BodyTrack,
    start: &'a Start,
}

impl Task<'_> {
    fn sweep(&self) -> &Loaded {
        &self.inputs.recordings[&self.origin.sweep]
    }

    fn rows(&self) -> Vec<Row<'_>> {
        let poses = self.track.in_recording(&self.origin.sweep);
        let rows = self.sweep().q.iter().zip(poses);
        rows.filter_map(|(q, pose)| {
            Some(Row {
                q: q.as_ref()?,
                tracker_from_body: (*pose)?,
            })
        })
        .collect()
    }

    fn estimate(
        &self,
        found: &BTreeMap<String, OriginEstimate>,
        findings: &mut Vec<Finding>,
    ) -> Result<OriginEstimate, PipelineError> {
        match (self.origin.axes.len(), &self.origin.orientation) {
            (1, _) => self.single_axis(found, findings),
            (2, Orientation::Axes) => self.frame(findings),
            _ => self.center_only(findings),
        }
    }

    fn refused(&self, findings: &mut Vec<Finding>, verdict: &str, reason: &str) -> OriginEstimate {
        findings.push(
            Finding::new(
                catalog::ORIGIN_NOT_OBSERVABLE,
                About::Origin(self.name.to_owned()),
            )
            .with("sweep", Fact::name(&self.origin.sweep))
            .with("verdict", Fact::name(verdict))
            .with("reason", Fact::name(reason)),
        );
        OriginEstimate {
            pose: None,
            covariance: None,
            unobservable: vec![Unobservable {
                direction: [0.0; 6],
                text: format!("{verdict}: {reason}"),
                remedy: "sweep a second joint through the origin".to_owned(),
            }],
            status: Status::Assumed,
            center: None,
            center_sigma: None,
            axis: None,
            axis_sigma: [None; 2],
            estimators: Vec::new(),
        }
    }

    /// The center by the profile's estimator, and by the others that take the same data.
    fn center(&self) -> Result<Centers, PipelineError> {
        let id = &self.origin.center;
        let parameters = crate::prepare::estimators::values(&self.origin.center_parameters);
        let chosen = self.fit_center(id, &parameters)?;
        let mut others = Vec::new();
        for other in ["sfe", "hse", "hotspot_ml", "ml_sphere", "ball_bundle"] {
            if other != id
                && let Ok(outcome) = self.fit_center(other, &BTreeMap::new())
            {
                others.push((other, outcome));
            }
        }
        Ok(Centers { chosen, others })
    }

    /// Runs one estimator: on the markers where it takes them, else on the poses of the body.
    fn fit_center(
        &self,
        id: &str,
        parameters: &BTreeMap<String, calib_plugin::Value>,
    ) -> Result<CenterOutcome, PipelineError> {
        let tracker = &self.inputs.robot.profile.tracker;
        let takes = &self.estimators.tables.cor.get(id)?.offer().shapes;
        let sweep = &self.sweep().poses;
        let markers = match &self.inputs.robot.profile.bodies[&self.origin.body].kind {
            BodyKind::Markers { names, .. } if takes.contains(&Shape::Markers) => Some(names),
            _ => None,
        };
        let motion = match markers {
            Some(names) => {
                let track = |m: &String| match sweep.markers.get(m) {
                    Some(track) => track.iter().map(|p| p.map(|p| p.coords.into())).collect(),
                    None => vec![None; sweep.len()],
                };
                let tracks: Vec<Vec<Option<[f64; 3]>>> = names.iter().map(track).collect();
                let mut motion = MotionData::markers(&tracks);
                motion.sigma_t_m = tracker.marker_sigma;
                motion
            }
            None => {
                let poses: Vec<Option<BodyPose>> = self
                    .track
                    .in_recording(&self.origin.sweep)
                    .iter()
                    .map(|p| p.map(|p| body_pose(&p)))
                    .collect();
                let mut motion = MotionData::poses(&poses);
                motion.sigma_t_m = tracker.body_sigma;
                motion.sigma_r_rad = tracker.body_sigma_rad;
                motion
            }
        };
        self.estimators.center(id, parameters, &motion)
    }

    /// The center in the body, averaged over the sweep, with its covariance.
    fn center_in_body(&self, estimate: &CenterFit) -> (Point3<f64>, Matrix3<f64>) {
        let rows = self.rows();
        let n = rows.len().max(1) as f64;
        let in_body: Vec<Vector3<f64>> = rows
            .iter()
            .map(|r| {
                r.tracker_from_body
                    .inverse_transform_point(&estimate.center)
                    .coords
            })
            .collect();
        let mean = in_body.iter().sum::<Vector3<f64>>() / n;
        // δm in the tracker enters row i as R_iᵀ δm; the poses' own errors are independent from row to row.
        let turned: Matrix3<f64> = rows
            .iter()
            .map(|r| {
                r.tracker_from_body
                    .rotation
                    .inverse()
                    .to_rotation_matrix()
                    .into_inner()
            })
            .sum::<Matrix3<f64>>()
            / n;
        let scatter: Matrix3<f64> = in_body
            .iter()
            .map(|p| (p - mean) * (p - mean).transpose())
            .sum::<Matrix3<f64>>()
            / ((n - 1.0).max(1.0) * n);
        (
            Point3::from(mean),
            turned * self.covariance_of(estimate) * turned.transpose() + scatter,
        )
    }

    /// Covariance of a center; an estimator that states none is trusted no better than the prior.
    fn covariance_of(&self, estimate: &CenterFit) -> Matrix3<f64> {
        let prior = self.inputs.robot.profile.solve.prior.position;
        estimate
            .covariance
            .unwrap_or_else(|| Matrix3::from_diagonal_element(prior * prior))
    }

    fn agreement(
        &self,
        reference: &Point3<f64>,
        covariance: &Matrix3<f64>,
        others: &[(&'static str, CenterOutcome)],
    ) -> Vec<EstimatorResult> {
        /// Squared Mahalanobis distance that two estimates of one point stay under in 99.9 % (χ² with 3 degrees).
        const AGREES: f64 = 16.27;
        others
            .iter()
            .map(|(id, outcome)| {
                let quantity = format!("center of {} in {}", self.name, self.origin.body);
                let estimate = match outcome {
                    Ok(estimate) => estimate,
                    Err(reason) => {
                        return EstimatorResult {
                            quantity,
                            estimator: (*id).to_owned(),
                            value: None,
                            sigma: None,
                            agrees: false,
                            unit: Unit::Metre,
                            distance: None,
                            text: reason.clone(),
                        };
                    }
                };
                let (point, own) = self.center_in_body(estimate);
                let difference = point - reference;
                // Both use the same samples: the difference is at most as uncertain as the two together.
                let z2 = nalgebra::Cholesky::new(own + covariance)
                    .map_or(f64::INFINITY, |c| difference.dot(&c.solve(&difference)));
                EstimatorResult {
                    quantity,
                    estimator: (*id).to_owned(),
                    value: Some(point.coords.as_slice().to_vec()),
                    sigma: Some(own.diagonal().iter().map(|v| v.max(0.0).sqrt()).collect()),
                    agrees: z2 <= AGREES,
                    unit: Unit::Metre,
                    distance: Some(difference.norm()),
                    text: String::new(),
                }
            })
            .collect()
    }

    /// Two swept axes: Algorithm 1.
    fn frame(&self, findings: &mut Vec<Finding>) -> Result<OriginEstimate, PipelineError> {
        let Centers { chosen, others } = self.center()?;
        let estimate = match chosen {
            Ok(estimate) => estimate,
            Err(reason) => return Ok(self.refused(findings, "center", &reason)),
        };
        let [proximal, distal] = [self.origin.axes[0], self.origin.axes[1]];
        let rows = self.rows();
        let samples: Vec<FrameSample> = rows
            .iter()
            .map(|r| FrameSample {
                world_from_body: Some(r.tracker_from_body.into()),
                proximal: self.inputs.robot.model.position(r.q, proximal.joint),
                distal: self.inputs.robot.model.position(r.q, distal.joint),
                weight: 1.0,
            })
            .collect();
        let tracker = &self.inputs.robot.profile.tracker;
        let options = Options {
            axes: FrameAxes {
                proximal: FrameAxis::Z,
                distal: FrameAxis::X,
            },
            sigma_t: tracker.body_sigma,
            sigma_r: tracker.body_sigma_rad,
            ..Options::default()
        };
        let center = Center::Given {
            point: estimate.center,
            covariance: self.covariance_of(&estimate),
        };
        let outcome = algorithm1(&samples, center, &options).map_err(|e| PipelineError::Usage {
            finding: format!("origin `{}`: {e}", self.name),
            remedy: "check the poses of the body".to_owned(),
        })?;
        let frame = match outcome {
            FrameOutcome::Estimate(frame) => frame,
            FrameOutcome::NotObservable(n) => {
                return Ok(self.refused(findings, n.verdict.as_str(), &n.reason));
            }
        };
        let canonical_from_origin =
            self.child_from_canonical().inverse() * self.child_from_origin();
        let pose = frame.body_from_joint * canonical_from_origin;
        let (point, covariance) = self.center_in_body(&estimate);
        Ok(OriginEstimate {
            pose: Some(pose),
            covariance: Some(transported(&frame.covariance, &canonical_from_origin)),
            unobservable: Vec::new(),
            status: Status::Calibrated,
            center: Some(estimate.center),
            center_sigma: center_sigma(&estimate),
            axis: None,
            axis_sigma: [None; 2],
            estimators: self.agreement(&point, &covariance, &others),
        })
    }

    /// A center without axes: the orientation is the description's, relative to a body.
    fn center_only(&self, findings: &mut Vec<Finding>) -> Result<OriginEstimate, PipelineError> {
        let Centers { chosen, others } = self.center()?;
        let estimate = match chosen {
            Ok(estimate) => estimate,
            Err(reason) => return Ok(self.refused(findings, "center", &reason)),
        };
        let (point, covariance) = self.center_in_body(&estimate);
        let Some(rotation) = self.assumed_rotation() else {
            return Ok(self.refused(
                findings,
                "no_rotation",
                "the assumed orientation contradicts itself",
            ));
        };
        // body_from_child: the center of the swept joints lies at c in the child's frame.
        let child = Isometry3::from_parts(Translation3::from(point.coords), rotation)
            * Translation3::from(-self.child_from_canonical().translation.vector);
        let child_from_origin = self.child_from_origin();
        let assumed = self.assumed_covariance(&rotation, &covariance);
        Ok(OriginEstimate {
            pose: Some(child * child_from_origin),
            covariance: Some(transported(&assumed, &child_from_origin)),
            unobservable: vec![self.assumed_orientation()],
            status: Status::Assumed,
            center: Some(estimate.center),
            center_sigma: center_sigma(&estimate),
            axis: None,
            axis_sigma: [None; 2],
            estimators: self.agreement(&point, &covariance, &others),
        })
    }

    /// One swept axis: a line, with the point on it and the turn about it taken from the description.
    fn single_axis(
        &self,
        found: &BTreeMap<String, OriginEstimate>,
        findings: &mut Vec<Finding>,
    ) -> Result<OriginEstimate, PipelineError> {
        let rows = self.rows();
        let swept = self.origin.axes[0];
        let tracker = &self.inputs.robot.profile.tracker;
        let poses: Vec<Option<BodyPose>> = rows
            .iter()
            .map(|r| Some(body_pose(&r.tracker_from_body)))
            .collect();
        let mut motion = MotionData::poses(&poses);
        motion.sigma_t_m = tracker.body_sigma;
        motion.sigma_r_rad = tracker.body_sigma_rad;
        motion.angles_rad = rows
            .iter()
            .map(|r| self.inputs.robot.model.position(r.q, swept.joint))
            .collect();
        let parameters = crate::prepare::estimators::values(&self.origin.axis_parameters);
        let axis = match self
            .estimators
            .axis(&self.origin.axis, &parameters, &motion)?
        {
            Ok(axis) => axis,
            Err(reason) => return Ok(self.refused(findings, "axis", &reason)),
        };
        let Some((rotation, slide)) = self.assumed_rotation().zip(self.slide(&axis.line, found))
        else {
            return Ok(self.refused(
                findings,
                "no_rotation",
                "the assumed orientation or the reference point is not known",
            ));
        };
        // The measured axis in the body, averaged over the sweep.
        let directions: Vec<_> = rows
            .iter()
            .map(|r| r.tracker_from_body.rotation.inverse() * axis.line.direction)
            .collect();
        let expected = rotation * swept.direction;
        let Ok(direction) = calib_geometry::mean::axis_mean(&directions, Some(expected)) else {
            return Ok(self.refused(
                findings,
                "not_unique",
                "the axis has no mean direction in the body",
            ));
        };
        let align = UnitQuaternion::rotation_between_axis(&expected, &direction)
            .unwrap_or_else(UnitQuaternion::identity);
        let rotation = align * rotation;
        let point = axis.line.point + axis.line.direction.into_inner() * slide;
        let in_body: Vec<Vector3<f64>> = rows
            .iter()
            .map(|r| r.tracker_from_body.inverse_transform_point(&point).coords)
            .collect();
        let n = in_body.len() as f64;
        let mean = in_body.iter().sum::<Vector3<f64>>() / n;
        let scatter: Matrix3<f64> = in_body
            .iter()
            .map(|p| (p - mean) * (p - mean).transpose())
            .sum::<Matrix3<f64>>()
            / ((n - 1.0).max(1.0) * n);
        let joint_in_child = self.nominal_axis_point();
        let child = Isometry3::from_parts(Translation3::from(mean), rotation)
            * Translation3::from(-joint_in_child);
        let prior = &self.inputs.robot.profile.solve.prior;
        let along = direction.into_inner() * direction.transpose();
        let across = Matrix3::identity() - along;
        let sigma_point = axis
            .point_variance
            .unwrap_or_else(|| self.inputs.robot.profile.solve.prior.position.powi(2));
        let position = scatter + across * sigma_point + along * prior.position.powi(2);
        let turn = axis
            .direction_variance
            .unwrap_or_else(|| prior.angle.powi(2));
        let r = rotation.to_rotation_matrix();
        let mut covariance = Matrix6::zeros();
        let orientation = across * turn + along * prior.angle.powi(2);
        covariance
            .fixed_view_mut::<3, 3>(0, 0)
            .copy_from(&(r.matrix().transpose() * orientation * r.matrix()));
        covariance
            .fixed_view_mut::<3, 3>(3, 3)
            .copy_from(&(r.matrix().transpose() * position * r.matrix()));
        let child_from_origin = self.child_from_origin();
        let d = swept.direction;
        let joint = &self.inputs.robot.model.joint(swept.joint).name;
        Ok(OriginEstimate {
            pose: Some(child * child_from_origin),
            covariance: Some(transported(&covariance, &child_from_origin)),
            unobservable: vec![
                Unobservable {
                    direction: [0.0, 0.0, 0.0, d.x, d.y, d.z],
                    text: format!("only `{joint}` was swept: every point of its axis stands still, so the place along the axis is the profile's choice, not a measurement"),
                    remedy: "sweep a second joint through this origin, or solve with `method: ml`, which ties it to the rest of the arm".to_owned(),
                },
                Unobservable {
                    direction: [d.x, d.y, d.z, 0.0, 0.0, 0.0],
                    text: format!("the turn about the axis of `{joint}` is taken from the description"),
                    remedy: "sweep a second joint, or solve with `method: ml`".to_owned(),
                },
            ],
            status: Status::Assumed,
            center: None,
            center_sigma: None,
            axis: Some(axis.line),
            axis_sigma: [axis.point_variance, axis.direction_variance]
                .map(|v| v.map(|v| v.max(0.0).sqrt())),
            estimators: Vec::new(),
        })
    }

    /// Distance along the axis from its reported point to the origin, m.
    fn slide(&self, axis: &Line, found: &BTreeMap<String, OriginEstimate>) -> Option<f64> {
        let model = &self.inputs.robot.model;
        let foot = |p: &Point3<f64>| (p - axis.point).dot(&axis.direction);
        match self.origin.point.as_ref()? {
            PointChoice::FromBody(distance) => {
                let rows = self.rows();
                let n = rows.len() as f64;
                let mean = rows
                    .iter()
                    .map(|r| r.tracker_from_body.translation.vector)
                    .sum::<Vector3<f64>>()
                    / n;
                Some(foot(&Point3::from(mean)) + distance)
            }
            PointChoice::NominalDistanceFrom(other) => {
                let reference = found.get(other)?.center?;
                let row = self.rows().into_iter().next()?;
                let root_from_link = model.forward_kinematics(row.q);
                let other = &self.inputs.robot.profile.origins[other];
                let swept = self.origin.axes[0].joint;
                let joint = model.joint(swept);
                let root_from_joint =
                    root_from_link[joint.parent.index()] * joint.parent_link_from_joint;
                let a = joint.kind.axis()?;
                let nominal_direction = root_from_joint * a.into_inner();
                let nominal_origin = root_from_joint.translation.vector;
                let nominal_reference = root_from_link[other.link.index()].translation.vector;
                // along the axis from the foot of the reference to the origin
                let nominal = (nominal_origin - nominal_reference).dot(&nominal_direction);
                // the measured axis points the way the joint turns, as the nominal one does
                Some(foot(&reference) + nominal)
            }
        }
    }

    /// The swept joint's own origin in the child's frame (nominal).
    fn nominal_axis_point(&self) -> Vector3<f64> {
        let model = &self.inputs.robot.model;
        let zero = model.forward_kinematics(&model.zero_positions());
        let child = model.joint(self.origin.joint).child;
        let swept = model.joint(self.origin.axes[0].joint).child;
        (zero[child.index()].inverse() * zero[swept.index()])
            .translation
            .vector
    }

    /// Nominal pose of the canonical frame (z along the proximal axis, x along the distal one, at their meeting point)
    /// in the child's frame. With fewer than two axes only its position means something.
    fn child_from_canonical(&self) -> Isometry3<f64> {
        let model = &self.inputs.robot.model;
        let zero = model.forward_kinematics(&model.zero_positions());
        let child = model.joint(self.origin.joint).child;
        let line = |joint: calib_urdf::JointId| {
            let j = model.joint(joint);
            let in_child = zero[child.index()].inverse() * zero[j.child.index()];
            j.kind.axis().and_then(|a| {
                Line::new(
                    Point3::from(in_child.translation.vector),
                    in_child * a.into_inner(),
                )
            })
        };
        // Without axes of its own, the center is where the joint and the joint before it meet.
        let joints: Vec<calib_urdf::JointId> = if self.origin.axes.len() == 2 {
            self.origin.axes.iter().map(|a| a.joint).collect()
        } else {
            let mut swept: Vec<_> = self.sweep().spec.ranges.keys().copied().collect();
            swept.sort_by_key(|j| model.chain_to_root(model.joint(*j).child).len());
            swept
        };
        let lines: Vec<Line> = joints.iter().filter_map(|j| line(*j)).collect();
        let (Some(first), Some(last)) = (lines.first(), lines.last()) else {
            return Isometry3::identity();
        };
        let meeting = last.closest_points(first).0;
        let z = first.direction.into_inner();
        let x = last.direction.into_inner();
        let y = z.cross(&x);
        let rotation = if y.norm() > 1e-6 {
            let y = y.normalize();
            let x = y.cross(&z);
            Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[x, y, z]))
        } else {
            Rotation3::identity()
        };
        Isometry3::from_parts(
            Translation3::from(meeting.coords),
            calib_geometry::so3::quaternion_of(&rotation),
        )
    }

    /// Nominal `child_from_origin`: only fixed joints lie between.
    fn child_from_origin(&self) -> Isometry3<f64> {
        let model = &self.inputs.robot.model;
        model.link_from_link(
            &model.zero_positions(),
            model.joint(self.origin.joint).child,
            self.origin.link,
        )
    }

    /// `body_from_child` rotation, with the robot standing in the tracker as the description says.
    fn assumed_rotation(&self) -> Option<UnitQuaternion<f64>> {
        let model = &self.inputs.robot.model;
        let child = model.joint(self.origin.joint).child;
        let poses: Vec<Isometry3<f64>> = self
            .rows()
            .iter()
            .map(|r| {
                r.tracker_from_body.inverse()
                    * self.start.tracker_from_root
                    * model.root_from_link(r.q, child)
            })
            .collect();
        mean_pose(&poses).map(|p| p.rotation)
    }

    /// Covariance `[ω; v]` in the child: the orientation is only as good as the prior, the position is measured.
    fn assumed_covariance(
        &self,
        rotation: &UnitQuaternion<f64>,
        position_in_body: &Matrix3<f64>,
    ) -> Matrix6<f64> {
        let r = rotation.to_rotation_matrix();
        let angle = self.inputs.robot.profile.solve.prior.angle;
        let mut covariance = Matrix6::from_diagonal_element(angle * angle);
        covariance
            .fixed_view_mut::<3, 3>(3, 3)
            .copy_from(&(r.matrix().transpose() * position_in_body * r.matrix()));
        covariance
    }

    fn assumed_orientation(&self) -> Unobservable {
        Unobservable {
            direction: [1.0, 1.0, 1.0, 0.0, 0.0, 0.0],
            text: "a center has no orientation: it is taken from the description, the robot standing as drawn".to_owned(),
            remedy: "sweep two axes and name them under `axes`, or solve with `method: ml`".to_owned(),
        }
    }
}

/// Covariance of `a_from_c = a_from_b · b_from_c` from that of `a_from_b`: `Ad(c_from_b) C Ad(c_from_b)ᵀ`.
#[must_use]
pub fn transported(covariance: &Matrix6<f64>, b_from_c: &Isometry3<f64>) -> Matrix6<f64> {
    let ad = se3::adjoint(&b_from_c.inverse());
    ad * covariance * ad.transpose()
}

/// Twist between two poses of the same frame, in its own axes.
#[must_use]
pub fn difference(from: &Isometry3<f64>, to: &Isometry3<f64>) -> Twist {
    se3::log(&(from.inverse() * to))
}
