//! What the nominal model says of an origin.

use calib_geometry::Line;
use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion};

use super::Task;
use crate::estimate::start::mean_pose;

impl Task<'_> {
    /// Nominal pose of the canonical frame (z along the proximal axis, x along the distal one, at their meeting point)
    /// in the child's frame. With fewer than two axes only its position means something.
    pub(super) fn child_from_canonical(&self) -> Isometry3<f64> {
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
    pub(super) fn child_from_origin(&self) -> Isometry3<f64> {
        let model = &self.inputs.robot.model;
        model.link_from_link(
            &model.zero_positions(),
            model.joint(self.origin.joint).child,
            self.origin.link,
        )
    }

    /// `body_from_child` rotation, with the robot standing in the tracker as the nominal URDF says.
    pub(super) fn assumed_rotation(&self) -> Option<UnitQuaternion<f64>> {
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
}
