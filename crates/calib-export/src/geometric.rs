//! The geometry of a calibrated robot alone: zero offsets in the origins, no other effect.

use calib_model::axis::Axis;
use calib_model::file::{ModelMotion, ModelPose, RobotModelFile};
use calib_model::motion::JointMotion;
use calib_model::{Model, ModelError};
use nalgebra::{Isometry3, Quaternion, Translation3, Unit, UnitQuaternion, Vector3};

/// As an isometry.
pub(crate) fn isometry(pose: &ModelPose) -> Isometry3<f64> {
    let [x, y, z, w] = pose.quat_xyzw;
    let turn = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
    Isometry3::from_parts(Translation3::from(Vector3::from(pose.xyz_m)), turn)
}

/// In the form of the file.
pub(crate) fn pose(of: &Isometry3<f64>) -> ModelPose {
    let q = of.rotation.coords;
    ModelPose {
        xyz_m: of.translation.vector.into(),
        quat_xyzw: [q.x, q.y, q.z, q.w],
    }
}

/// Axis of a joint that moves.
pub(crate) fn axis_of(joint: &calib_model::file::ModelJoint) -> Option<Axis> {
    let axis = Unit::new_normalize(Vector3::from(joint.axis?));
    match joint.motion {
        ModelMotion::Fixed => None,
        ModelMotion::Revolute => Some(Axis::Revolute(axis)),
        ModelMotion::Prismatic => Some(Axis::Prismatic(axis)),
    }
}

/// What a format without effects can hold: parent_from_joint · exp(S · offset). Masses that were assumed are not the robot's: only
/// their product with the compliances means something, and these are not there.
pub(crate) fn geometric(file: &RobotModelFile) -> RobotModelFile {
    let mut out = file.clone();
    for joint in &mut out.joints {
        let offsets = joint.effects.iter().filter(|e| e.kind == "offset");
        let offset: f64 = offsets.map(|e| e.value).sum();
        if let Some(axis) = axis_of(joint).filter(|_| offset != 0.0) {
            let moved = JointMotion::of(axis, offset, None).joint_from_child();
            joint.parent_from_joint = pose(&(isometry(&joint.parent_from_joint) * moved));
        }
        joint.effects.clear();
    }
    if out.masses_assumed {
        for link in &mut out.links {
            (link.mass_kg, link.first_moment_kg_m) = (0.0, [0.0; 3]);
        }
    }
    out.uncertainty = None;
    out
}

/// Names of the effects that are lost there, each once, in the order of the table.
pub(crate) fn lost(file: &RobotModelFile) -> Vec<&'static str> {
    let effects = || file.joints.iter().flat_map(|j| &j.effects);
    let held = |kind: &str| effects().any(|e| e.kind == kind && e.value != 0.0);
    calib_model::effect::EFFECTS
        .iter()
        .filter(|e| !e.geometric && e.terms.iter().any(|t| held(t.name)))
        .map(|e| e.id)
        .collect()
}

/// For evaluation.
pub(crate) fn evaluated(file: &RobotModelFile) -> Result<Model, ModelError> {
    Model::new(file)
}
