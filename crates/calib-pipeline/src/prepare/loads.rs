//! What gravity does to the joints: the moment of everything a joint carries, about its origin.

use calib_urdf::RobotModel;
use nalgebra::{Isometry3, Vector3};

/// Gravity in the frame of the robot's root, m/s². The root is taken to stand upright.
pub const GRAVITY: Vector3<f64> = Vector3::new(0.0, 0.0, -9.81);

/// Whether the nominal URDF has any mass: without one, compliance cannot be identified from gravity.
#[must_use]
pub fn has_masses(model: &RobotModel) -> bool {
    model
        .links()
        .iter()
        .any(|l| l.inertial.is_some_and(|i| i.mass > 0.0))
}

/// Gravity moment on each joint about its origin, in its joint frame (before its own motion), N m, by joint index.
///
/// ```text
/// m_j = Σ_{links k carried by j} (c_k − o_j) × m_k g
/// ```
#[must_use]
pub fn gravity_moments(model: &RobotModel, root_from_link: &[Isometry3<f64>]) -> Vec<Vector3<f64>> {
    let mut moments = vec![Vector3::zeros(); model.joints().len()];
    for (joint, moment) in model.joint_ids().zip(&mut moments) {
        let parent = model.joint(joint).parent;
        let root_from_joint =
            root_from_link[parent.index()] * model.joint(joint).parent_link_from_joint;
        let origin = root_from_joint.translation.vector;
        for link in model.link_ids() {
            let Some(inertial) = model.link(link).inertial else {
                continue;
            };
            if model.carries(joint, link) {
                let c = root_from_link[link.index()] * inertial.center_of_mass;
                *moment += (c.coords - origin).cross(&(GRAVITY * inertial.mass));
            }
        }
        *moment = root_from_joint.rotation.inverse() * *moment;
    }
    moments
}
