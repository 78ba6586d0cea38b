//! Patches change what they have to and nothing else; what they refuse, they explain.

use calib_urdf::rpy::rotation_from_rpy;
use calib_urdf::{EditError, RobotModel, SecondReader, UrdfEdit, patch, revert, verify};
use nalgebra::{Isometry3, Translation3, Unit, Vector3};
use std::f64::consts::FRAC_PI_2;

const ARM: &str = r#"<?xml version='1.0'?>
<!-- hand-written: <origin xyz="9 9 9"/> here is no origin -->
<robot name="arm">
    <link name="base"/>
    <link   name='upper'/><!-- same line -->
    <link name="fore"/>
    <link name="hand"/>
    <joint name="shoulder" type="revolute">
        <!-- from the drawing -->
        <parent link="base"/>
        <child link="upper"/>
        <origin  rpy = '0  -0.0 1.50'   xyz='0.10	0 3e-1' />
        <axis xyz="0 2 0"/>
        <limit lower="-1" upper="1.0" effort="1" velocity="1"/>
    </joint>
    <joint name="elbow" type="continuous">
        <parent link="upper"/>
        <child link="fore"/>
        <axis xyz="0 1 0"/>
    </joint>
    <joint name="wrist" type="revolute">
        <parent link="fore"/><child link="hand"/>
        <origin
            xyz="0.25 0 0"/>
    </joint>
    <transmission name="t">
        <joint name="shoulder"><origin xyz="7 7 7"/></joint>
        <joint name="elbow"/>
    </transmission>
    <gazebo reference="upper"><origin xyz="8 8 8"/></gazebo>
    <ros2_control name="c" type="system"><joint name="elbow"/></ros2_control>

</robot>
<!-- after -->
"#;

fn pose(xyz: [f64; 3], rpy: [f64; 3]) -> Isometry3<f64> {
    Isometry3::from_parts(
        Translation3::from(Vector3::from(xyz)),
        rotation_from_rpy(&Vector3::from(rpy)),
    )
}

fn origin(joint: &str, xyz: [f64; 3], rpy: [f64; 3]) -> UrdfEdit {
    UrdfEdit::SetOrigin {
        joint: joint.to_owned(),
        parent_link_from_joint: pose(xyz, rpy),
    }
}

fn frame(name: &str, parent: &str, xyz: [f64; 3]) -> UrdfEdit {
    UrdfEdit::AddFixedFrame {
        name: name.to_owned(),
        parent_link: parent.to_owned(),
        joint_name: format!("{name}_mount"),
        parent_from_frame: pose(xyz, [0.0, FRAC_PI_2, 0.5]),
        comment: Some(format!("tracking body {name}")),
    }
}

/// The patched text; on the way: a record that reverts, and a second patch that changes nothing.
fn patched(text: &str, edits: &[UrdfEdit]) -> String {
    let done = patch(text, "arm.urdf", edits).unwrap();
    assert_eq!(revert(&done.text, &done.record(text)).unwrap(), text);
    let again = patch(&done.text, "arm.urdf", edits).unwrap();
    assert_eq!(again.text, done.text);
    assert!(again.changes.is_empty() && again.splices.is_empty());
    done.text
}

#[test]
fn one_coordinate_changes_one_number() {
    let text = patched(
        ARM,
        &[origin("shoulder", [0.1, 0.0, 0.3125], [0.0, 0.0, 1.5])],
    );
    assert_eq!(text, ARM.replace("3e-1", "0.3125"));
}

#[test]
fn the_nominal_values_change_nothing() {
    let model = RobotModel::from_urdf_text(ARM, "arm.urdf").unwrap();
    let edits: Vec<_> = model
        .joints()
        .iter()
        .map(|joint| UrdfEdit::SetOrigin {
            joint: joint.name.clone(),
            // Through another frame and back: rounding noise as a solver leaves it.
            parent_link_from_joint: pose([0.3, -2.0, 1.0], [1.0, 2.0, 3.0]).inverse()
                * (pose([0.3, -2.0, 1.0], [1.0, 2.0, 3.0]) * joint.parent_link_from_joint),
        })
        .collect();
    assert_eq!(patched(ARM, &edits), ARM);
}

#[test]
fn everything_at_once() {
    let edits = [
        origin("shoulder", [0.101, 0.0, 0.3], [0.0, 0.002, 1.5]),
        origin("elbow", [0.0, 0.5, 0.0], [0.1, 0.0, 0.0]),
        origin("wrist", [0.25, 0.0, 0.0], [0.0, -FRAC_PI_2, 0.0]),
        UrdfEdit::SetAxis {
            joint: "elbow".to_owned(),
            axis: Unit::new_normalize(Vector3::new(0.0, 4.0, 3.0)),
        },
        UrdfEdit::SetAxis {
            joint: "wrist".to_owned(),
            axis: Vector3::z_axis(),
        },
        UrdfEdit::SetLimits {
            joint: "shoulder".to_owned(),
            lower: -1.0,
            upper: 1.25,
        },
        frame("hand_M", "hand", [0.0, 0.01, 0.02]),
        frame("lens", "hand_M", [0.0, 0.0, 0.1]),
        UrdfEdit::AddProvenance {
            text: "calib 0.1: ripley -- sweep".to_owned(),
        },
    ];
    let text = patched(ARM, &edits);
    insta::assert_snapshot!(
        "everything",
        calib_urdf::unified(ARM, "arm.urdf", &text, "arm.calibrated.urdf")
    );
    let changes = patch(ARM, "arm.urdf", &edits).unwrap().changes;
    let table: String = changes
        .iter()
        .map(|c| {
            format!(
                "{:>2} {} | {} | {} → {}\n",
                c.line, c.joint, c.attribute, c.old, c.new
            )
        })
        .collect();
    insta::assert_snapshot!("changes", table);
}

#[test]
fn line_endings_byte_order_mark_and_tabs_stay() {
    let text = format!(
        "\u{feff}{}",
        ARM.replace("    ", "\t").replace('\n', "\r\n")
    );
    let edits = [
        origin("elbow", [0.0, 0.5, 0.0], [0.0; 3]),
        frame("body", "hand", [0.0, 0.0, 0.1]),
    ];
    let got = patched(&text, &edits);
    assert!(got.starts_with('\u{feff}'));
    assert_eq!(got.matches('\n').count(), got.matches("\r\n").count());
    assert!(
        got.contains("\t\t<origin xyz=\"0 0.5 0\" rpy=\"0 0 0\"/>\r\n\t\t<parent link=\"upper\"/>"),
        "{got}"
    );
    assert!(got.contains("\r\n\t<link name=\"body\"/>\r\n\t<joint name=\"body_mount\" type=\"fixed\">\r\n\t\t<parent link=\"hand\"/>"), "{got}");
}

#[test]
fn a_robot_in_one_line() {
    let text = "<robot name='r'><link name='a'/><link name='b'/><joint name='j' type='fixed'><parent link='a'/><child link='b'/></joint></robot>";
    let got = patched(
        text,
        &[
            origin("j", [1.0, 0.0, 0.0], [0.0; 3]),
            frame("c", "b", [0.0, 0.0, 1.0]),
        ],
    );
    assert!(!got.contains('\n'), "{got}");
    assert!(
        got.contains("<joint name='j' type='fixed'><origin xyz=\"1 0 0\" rpy=\"0 0 0\"/><parent"),
        "{got}"
    );
}

#[test]
fn an_inserted_attribute_takes_the_style_of_its_neighbor() {
    let text = ARM.replace(
        "            xyz=\"0.25 0 0\"/>",
        "            rpy='0.5 0 0'/>",
    );
    let got = patched(&text, &[origin("wrist", [0.0, 0.25, 0.0], [0.5, 0.0, 0.0])]);
    assert!(
        got.contains("<origin\n            rpy='0.5 0 0'\n            xyz='0 0.25 0'/>"),
        "{got}"
    );
    let bare = ARM.replace("<origin\n            xyz=\"0.25 0 0\"/>", "<origin/>");
    let got = patched(&bare, &[origin("wrist", [0.0, 0.25, 0.0], [0.5, 0.0, 0.0])]);
    assert!(
        got.contains("<origin xyz=\"0 0.25 0\" rpy=\"0.5 0 0\"/>"),
        "{got}"
    );
}

#[test]
fn quaternions_of_urdf_1_1_are_patched_as_quaternions() {
    let text = ARM
        .replace("<robot", "<robot version=\"1.1\"")
        .replace("rpy = '0  -0.0 1.50'", "quat_xyzw = '0 0 0 -1'");
    let same = patched(&text, &[origin("shoulder", [0.1, 0.0, 0.3], [0.0; 3])]);
    assert_eq!(same, text);
    let got = patched(
        &text,
        &[origin("shoulder", [0.1, 0.0, 0.3], [0.0, FRAC_PI_2, 0.0])],
    );
    assert!(
        got.contains("quat_xyzw = '0 -0.7071067811865475 0 -0.7071067811865476'")
            || got.contains("quat_xyzw = '0 -0.7071067811865476 0 -0.7071067811865476'"),
        "{got}"
    );
}

#[test]
fn gimbal_lock_both_ways_through_both_readers() {
    for pitch in [
        FRAC_PI_2,
        -FRAC_PI_2,
        FRAC_PI_2 - 1e-9,
        FRAC_PI_2 + 1e-7,
        -FRAC_PI_2 + 1e-12,
    ] {
        for (roll, yaw) in [(0.0, 0.0), (0.4, 2.5), (-3.0, 1.0)] {
            let edits = [origin("wrist", [0.3, 0.2, 0.1], [roll, pitch, yaw])];
            let text = patched(ARM, &edits);
            let expected = RobotModel::from_urdf_text(ARM, "a")
                .unwrap()
                .with_edits("a", &edits)
                .unwrap();
            let verification = verify(&text, &expected, "arm.urdf").unwrap();
            assert!(
                verification.translation < 1e-15 && verification.rotation < 1e-14,
                "{verification:?}"
            );
            let SecondReader::Agrees {
                translation,
                rotation,
            } = verification.second_reader
            else {
                panic!("{verification:?}")
            };
            assert!(translation < 1e-14 && rotation < 1e-14, "{verification:?}");
        }
    }
}

#[test]
fn verify_sees_what_is_wrong() {
    let edits = [origin("wrist", [0.3, 0.2, 0.1], [0.1, 0.2, 0.3])];
    let expected = RobotModel::from_urdf_text(ARM, "a")
        .unwrap()
        .with_edits("a", &edits)
        .unwrap();
    let text = patched(ARM, &edits);
    let off = text.replace("0.3 0.2 0.1", "0.3 0.2 0.10000000001");
    let message = verify(&off, &expected, "arm.urdf").unwrap_err().to_string();
    assert!(
        message.starts_with("arm.urdf: the frame of link `hand` is 1.0e-11 m and "),
        "{message}"
    );
    insta::assert_snapshot!(verify(&text.replace("\"hand\"", "\"palm\""), &expected, "arm.urdf").unwrap_err(), @"arm.urdf: after the patch, link `palm` stands where link `hand` should");
    let limits = text.replace("upper=\"1.0\"", "upper=\"2\"");
    assert!(matches!(
        verify(&limits, &expected, "a"),
        Err(EditError::StructureChanged { .. })
    ));
}

#[test]
fn refusals() {
    let nan = pose([f64::NAN, 0.0, 0.0], [0.0; 3]);
    let limits = |joint: &str, lower, upper| UrdfEdit::SetLimits {
        joint: joint.to_owned(),
        lower,
        upper,
    };
    let cases: Vec<(&str, Vec<UrdfEdit>)> = vec![
        ("unknown joint", vec![origin("elbov", [0.0; 3], [0.0; 3])]),
        (
            "NaN",
            vec![UrdfEdit::SetOrigin {
                joint: "elbow".to_owned(),
                parent_link_from_joint: nan,
            }],
        ),
        (
            "twice",
            vec![
                origin("elbow", [0.0; 3], [0.0; 3]),
                origin("elbow", [1.0; 3], [0.0; 3]),
            ],
        ),
        ("no limit", vec![limits("wrist", 0.0, 1.0)]),
        (
            "limits of a continuous joint",
            vec![limits("elbow", 0.0, 1.0)],
        ),
        ("reversed", vec![limits("shoulder", 2.0, 1.0)]),
        ("link taken", vec![frame("hand", "base", [0.0; 3])]),
        ("unknown parent", vec![frame("body", "hnd", [0.0; 3])]),
        (
            "frame twice",
            vec![
                frame("body", "hand", [0.0; 3]),
                frame("body", "base", [0.0; 3]),
            ],
        ),
        ("empty name", vec![frame(" ", "hand", [0.0; 3])]),
    ];
    let text: String = cases
        .iter()
        .map(|(name, edits)| {
            format!(
                "--- {name}\n{}\n",
                patch(ARM, "arm.urdf", edits).unwrap_err()
            )
        })
        .collect();
    let axis = [UrdfEdit::SetAxis {
        joint: "elbow".to_owned(),
        axis: Vector3::z_axis(),
    }];
    let fixed = patch(&ARM.replace("continuous", "fixed"), "arm.urdf", &axis).unwrap_err();
    insta::assert_snapshot!(
        "refusals",
        format!("{text}--- axis of a fixed joint\n{fixed}\n")
    );
}

#[test]
fn names_that_need_escaping() {
    let edits = [frame("a\"b<c>&d", "hand", [0.0; 3])];
    let text = patched(ARM, &edits);
    assert!(text.contains("a&quot;b&lt;c&gt;&amp;d"), "{text}");
}

#[test]
fn comments_are_always_well_formed() {
    let text = ARM.replace('\n', "\r\n");
    let edits = [UrdfEdit::AddProvenance {
        text: "--\u{0}two---\nlines -".to_owned(),
    }];
    let got = patched(&text, &edits);
    assert!(
        got.contains("<!-- - -two- - -\r\nlines - -->\r\n<robot"),
        "{got}"
    );
}

#[test]
fn limits_are_written_where_they_were_left_out() {
    let text = ARM.replace(" lower=\"-1\" upper=\"1.0\"", "");
    let edits = [UrdfEdit::SetLimits {
        joint: "shoulder".to_owned(),
        lower: 0.0,
        upper: 0.5,
    }];
    let got = patched(&text, &edits);
    assert!(
        got.contains("<limit effort=\"1\" velocity=\"1\" lower=\"0\" upper=\"0.5\"/>"),
        "{got}"
    );
    // As good as equal is equal.
    let edits = [UrdfEdit::SetLimits {
        joint: "shoulder".to_owned(),
        lower: -1.0,
        upper: 1.0 + 1e-15,
    }];
    assert_eq!(patched(ARM, &edits), ARM);
}
