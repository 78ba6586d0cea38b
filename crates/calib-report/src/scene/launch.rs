use super::Scene;
use crate::Unit;
use crate::number::round_trip;
use std::fmt::Write;

/// One `static_transform_publisher` per frame that the URDF does not have. The scene has been checked.
pub(super) fn launch(scene: &Scene) -> String {
    let mut text = String::from(
        "\"\"\"Static transforms of a calibrated scene; made by calib, changes will be lost.\n\n\
         The links of the robot are left to robot_state_publisher.\n\"\"\"\n\n\
         from launch import LaunchDescription\nfrom launch_ros.actions import Node\n\n\n\
         # parent, child, x, y, z [m], qx, qy, qz, qw\nTRANSFORMS = [\n",
    );
    for frame in scene
        .frames
        .iter()
        .filter(|frame| !frame.in_urdf || frame.name == scene.robot.base)
    {
        let Some(parent) = &frame.parent else {
            continue;
        };
        let numbers: Vec<String> = frame
            .xyz_m
            .iter()
            .chain(&frame.quat_xyzw)
            .map(|x| format!("\"{}\"", round_trip(*x)))
            .collect();
        let _ = writeln!(
            text,
            "    ({}, {}, {}),  # {}",
            python(parent),
            python(&frame.name),
            numbers.join(", "),
            frame.status.word()
        );
    }
    text.push_str("]\n\n# Joint positions of the scene [rad or m]; robot_state_publisher takes them from /joint_states.\nJOINTS = {\n");
    for joint in &scene.robot.joints {
        let unit = if joint.unit == Unit::Meter {
            "m"
        } else {
            "rad"
        };
        let _ = writeln!(
            text,
            "    {}: {},  # {unit}",
            python(&joint.joint),
            round_trip(joint.value)
        );
    }
    text.push_str(
        "}\n\n\ndef generate_launch_description():\n    names = [\"--x\", \"--y\", \"--z\", \"--qx\", \"--qy\", \"--qz\", \"--qw\"]\n    nodes = []\n    \
         for parent, child, *numbers in TRANSFORMS:\n        arguments = [\"--frame-id\", parent, \"--child-frame-id\", child]\n        \
         for name, number in zip(names, numbers):\n            arguments += [name, number]\n        \
         nodes.append(Node(package=\"tf2_ros\", executable=\"static_transform_publisher\", arguments=arguments))\n    \
         return LaunchDescription(nodes)\n",
    );
    text
}

/// A Python string literal.
fn python(text: &str) -> String {
    let mut literal = String::from("\"");
    for c in text.chars() {
        match c {
            '"' | '\\' => {
                literal.push('\\');
                literal.push(c);
            }
            c if c.is_control() => {
                let _ = write!(literal, "\\U{:08x}", u32::from(c));
            }
            c => literal.push(c),
        }
    }
    literal.push('"');
    literal
}

#[cfg(test)]
mod tests {
    use super::python;

    #[test]
    fn a_name_cannot_leave_its_string() {
        assert_eq!(python("a\"b\\c\nd"), "\"a\\\"b\\\\c\\U0000000ad\"");
    }
}
