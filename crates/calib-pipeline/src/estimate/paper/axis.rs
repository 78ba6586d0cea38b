//! The line of one swept axis.

use std::collections::BTreeMap;

use calib_finding::Finding;
use calib_geometry::Line;
use calib_plugin::{BodyPose, MotionData};
use calib_profile::PointChoice;
use calib_report::{Status, Unobservable};
use nalgebra::{Isometry3, Matrix3, Matrix6, Point3, Translation3, Unit, UnitQuaternion, Vector3};

use super::{OriginEstimate, Refusal, Row, Task, body_pose, transported};
use crate::error::PipelineError;
use crate::prepare::estimators::AxisFit;

impl Task<'_> {
    /// One swept axis: a line, with the point on it and the rotation about it taken from the nominal URDF.
    pub(super) fn single_axis(
        &self,
        found: &BTreeMap<String, OriginEstimate>,
        findings: &mut Vec<Finding>,
    ) -> Result<OriginEstimate, PipelineError> {
        let rows = self.rows();
        let swept = self.origin.axes[0];
        let motion = self.axis_motion(&rows);
        let parameters = crate::prepare::estimators::values(&self.origin.axis_parameters);
        let axis = match self
            .estimators
            .axis(&self.origin.axis, &parameters, &motion)?
        {
            Ok(axis) => axis,
            Err(reason) => return Ok(self.refused(findings, Refusal::Axis(reason))),
        };
        if axis.direction_variance.is_none() || axis.point_variance.is_none() {
            self.without_covariance(findings, true);
        }
        let Some((rotation, slide)) = self.assumed_rotation().zip(self.slide(&axis.line, found))
        else {
            return Ok(self.refused(findings, Refusal::Orientation));
        };
        // The measured axis in the body, averaged over the sweep.
        let directions: Vec<_> = rows
            .iter()
            .map(|r| r.tracker_from_body.rotation.inverse() * axis.line.direction)
            .collect();
        let expected = rotation * swept.direction;
        let Ok(direction) = calib_geometry::mean::axis_mean(&directions, Some(expected)) else {
            return Ok(self.refused(findings, Refusal::MeanAxis));
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
        let covariance = self.axis_covariance(&axis, &direction, &rotation, &scatter);
        let child_from_origin = self.child_from_origin();
        Ok(OriginEstimate {
            pose: Some(child * child_from_origin),
            covariance: Some(transported(&covariance, &child_from_origin)),
            unobservable: self.along_and_about(&swept.direction),
            status: Status::Assumed,
            center: None,
            center_sigma: None,
            axis: Some(axis.line),
            axis_sigma: [axis.point_variance, axis.direction_variance]
                .map(|v| v.map(|v| v.max(0.0).sqrt())),
            estimators: Vec::new(),
        })
    }

    /// The sweep as an axis estimator takes it.
    fn axis_motion(&self, rows: &[Row<'_>]) -> MotionData {
        let swept = self.origin.axes[0];
        let tracker = &self.inputs.robot.profile.tracker;
        let poses: Vec<Option<BodyPose>> = rows
            .iter()
            .map(|r| Some(body_pose(&r.tracker_from_body)))
            .collect();
        let mut motion = MotionData::poses(&poses);
        motion.sigma_t_m = self.track.position_sigma(tracker);
        motion.sigma_r_rad = tracker.body_sigma_rad;
        motion.angles_rad = rows
            .iter()
            .map(|r| self.inputs.robot.model.position(r.q, swept.joint))
            .collect();
        motion
    }

    /// Covariance `[ω; v]` in the child: about and along the axis the prior, across it what was measured.
    fn axis_covariance(
        &self,
        axis: &AxisFit,
        direction: &Unit<Vector3<f64>>,
        rotation: &UnitQuaternion<f64>,
        scatter: &Matrix3<f64>,
    ) -> Matrix6<f64> {
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
        covariance
    }

    /// The two directions that a sweep about one axis leaves open.
    fn along_and_about(&self, d: &Vector3<f64>) -> Vec<Unobservable> {
        let joint = &self
            .inputs
            .robot
            .model
            .joint(self.origin.axes[0].joint)
            .name;
        vec![
                Unobservable {
                    direction: [0.0, 0.0, 0.0, d.x, d.y, d.z],
                    text: format!("only `{joint}` was swept: every point of its axis stands still, so the place along the axis is the profile's choice, not a measurement"),
                    remedy: "sweep a second joint through this origin, or solve with `method: ml`, which ties it to the rest of the arm".to_owned(),
                },
                Unobservable {
                    direction: [d.x, d.y, d.z, 0.0, 0.0, 0.0],
                    text: format!("the rotation about the axis of `{joint}` is taken from the nominal URDF"),
                    remedy: "sweep a second joint, or solve with `method: ml`".to_owned(),
                },
            ]
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
}
