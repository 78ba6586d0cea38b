//! The `kinematics` of `ur_description`: origins of the six joints of a UR arm.
//!
//! `ur_description` puts the joints directly on each other and turns each about z; it has no entry for other joints. What stands
//! between its root and its tool besides the six is what the nominal URDF has.

use std::collections::BTreeSet;

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
/// Why the chain has not these joints, and what to do.
pub(crate) fn arm(
    geometry: &RobotModelFile,
    chain: &[usize],
) -> Result<Arm, (String, &'static str)> {
    const OTHER: &str = "use `urdf`, or `dh`, `hayati` or `poe` for the chain to a tool";
    let joint = |i: &usize| &geometry.joints[*i];
    let named = |i: &&usize| ur_key(&joint(i).name).is_some();
    let joints: Vec<usize> = chain.iter().filter(named).copied().collect();
    let mut keys: Vec<&str> = joints.iter().map(|i| key(joint(i))).collect();
    keys.sort_unstable();
    keys.dedup();
    if joints.len() != 6 || keys.len() != 6 {
        let all: BTreeSet<&str> = geometry
            .joints
            .iter()
            .filter_map(|j| ur_key(&j.name))
            .collect();
        // Another tool has more of them before it only where the robot has them.
        let remedy = match all.len() {
            6 => "name the last link of the arm with `--tool`, or use `urdf`",
            _ => OTHER,
        };
        let reason = format!(
            "its chain has {} of the six joints of a UR arm (shoulder_pan_joint, shoulder_lift_joint, elbow_joint, wrist_1_joint, wrist_2_joint, \
             wrist_3_joint)",
            keys.len()
        );
        return Err((reason, remedy));
    }
    for pair in joints.windows(2) {
        let (a, b) = (joint(&pair[0]), joint(&pair[1]));
        if a.child != b.parent {
            let reason = format!("{} does not carry {} directly", a.name, b.name);
            return Err((reason, OTHER));
        }
    }
    for joint in joints.iter().map(joint) {
        let about_z = |a: [f64; 3]| a[2] > 0.0 && a[0].hypot(a[1]) <= SAME * a[2];
        if joint.motion != ModelMotion::Revolute || !joint.axis.is_some_and(about_z) {
            let reason = format!("{} does not turn about its z axis", joint.name);
            return Err((reason, OTHER));
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
