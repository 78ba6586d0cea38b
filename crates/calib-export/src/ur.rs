//! The `kinematics` of `ur_description`: origins of the six joints of a UR arm.
//!
//! `ur_description` puts the joints directly on each other and turns each about z; it has no entry for other joints. What stands
//! between its root and its tool besides the six is what the nominal URDF has.

use calib_model::file::{ModelJoint, ModelMotion, ModelPose, RobotModelFile};
use calib_urdf::ur_key;

use crate::geometric::isometry;

/// Axes within this angle (rad) are the same: 1e-12 m at 1 m.
const SAME: f64 = 1e-12;

/// What the file holds of a robot.
#[derive(Debug, Clone)]
pub(crate) struct Arm {
    /// The geometry that a reader gets: calibrated origins of the six joints, nominal ones of all others.
    pub file: RobotModelFile,
    /// The six joints, base first, by their indices there.
    pub joints: Vec<usize>,
    /// Other joints of the chain were calibrated.
    pub others: bool,
}

/// A joint's key.
pub(crate) fn key(joint: &ModelJoint) -> &'static str {
    ur_key(&joint.name).unwrap_or_default()
}

/// The six joints of a chain.
///
/// # Errors
/// Why the chain has not these joints.
pub(crate) fn arm(geometry: &RobotModelFile, chain: &[usize]) -> Result<Arm, String> {
    let joint = |i: &usize| &geometry.joints[*i];
    let named = |i: &&usize| ur_key(&joint(i).name).is_some();
    let joints: Vec<usize> = chain.iter().filter(named).copied().collect();
    let mut keys: Vec<&str> = joints.iter().map(|i| key(joint(i))).collect();
    keys.sort_unstable();
    keys.dedup();
    if joints.len() != 6 || keys.len() != 6 {
        return Err(format!(
            "its chain has {} of the six joints of a UR arm (shoulder_pan_joint, shoulder_lift_joint, elbow_joint, wrist_1_joint, wrist_2_joint, \
             wrist_3_joint)",
            keys.len()
        ));
    }
    for pair in joints.windows(2) {
        let (a, b) = (joint(&pair[0]), joint(&pair[1]));
        if a.child != b.parent {
            return Err(format!("{} does not carry {} directly", a.name, b.name));
        }
    }
    for joint in joints.iter().map(joint) {
        let about_z = |a: [f64; 3]| a[2] > 0.0 && a[0].hypot(a[1]) <= SAME * a[2];
        if joint.motion != ModelMotion::Revolute || !joint.axis.is_some_and(about_z) {
            return Err(format!("{} does not turn about its z axis", joint.name));
        }
    }
    let mut file = geometry.clone();
    let mut others = false;
    for (i, joint) in file.joints.iter_mut().enumerate() {
        if !joints.contains(&i) {
            others |= chain.contains(&i) && differ(&joint.parent_from_joint, &joint.load_origin);
            joint.parent_from_joint = joint.load_origin;
        }
    }
    Ok(Arm {
        file,
        joints,
        others,
    })
}

fn differ(a: &ModelPose, b: &ModelPose) -> bool {
    let off = isometry(a).inverse() * isometry(b);
    off.translation.vector.norm() > SAME || off.rotation.angle() > SAME
}
