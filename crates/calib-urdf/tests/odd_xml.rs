//! XML that is unusual and correct: namespaces, entities, sections, a doctype. The patch finds its way or says why not.

use calib_urdf::{RobotModel, UrdfEdit, patch, revert};
use nalgebra::Isometry3;

const PLAIN: &str = "<robot name=\"r\">\n  <link name=\"a\"/>\n  <link name=\"b\"/>\n  <joint name=\"j\" type=\"fixed\">\n    <parent link=\"a\"/>\n    <child link=\"b\"/>\n    <origin xyz=\"1 2 3\" rpy=\"0 0 0\"/>\n  </joint>\n</robot>\n";

fn edits() -> [UrdfEdit; 2] {
    [
        UrdfEdit::SetOrigin {
            joint: "j".to_owned(),
            parent_link_from_joint: Isometry3::translation(1.0, 2.0, 4.0),
        },
        UrdfEdit::AddFixedFrame {
            name: "body".to_owned(),
            parent_link: "b".to_owned(),
            joint_name: "mount".to_owned(),
            parent_from_frame: Isometry3::translation(0.0, 0.0, 0.5),
            comment: None,
        },
    ]
}

fn patched(text: &str) -> String {
    let done = patch(text, "odd.urdf", &edits()).unwrap();
    assert_eq!(revert(&done.text, &done.record(text)).unwrap(), text);
    assert!(
        patch(&done.text, "odd.urdf", &edits())
            .unwrap()
            .splices
            .is_empty()
    );
    done.text
}

#[test]
fn a_default_namespace() {
    let got = patched(&PLAIN.replace("<robot", "<robot xmlns=\"http://www.ros.org\""));
    assert!(got.contains("xyz=\"1 2 4\""), "{got}");
}

#[test]
fn prefixed_elements() {
    let mut text = PLAIN
        .replace("<robot", "<u:robot xmlns:u=\"http://www.ros.org\"")
        .replace("</robot", "</u:robot");
    for tag in ["link", "joint", "parent", "child", "origin"] {
        text = text
            .replace(&format!("<{tag} "), &format!("<u:{tag} "))
            .replace(&format!("</{tag}"), &format!("</u:{tag}"));
    }
    let got = patched(&text);
    assert!(
        got.contains("<u:link name=\"body\"/>") && got.contains("<u:origin xyz=\"0 0 0.5\""),
        "{got}"
    );
    let without = text.replace("    <u:origin xyz=\"1 2 3\" rpy=\"0 0 0\"/>\n", "");
    assert!(patched(&without).contains("<u:origin xyz=\"1 2 4\" rpy=\"0 0 0\"/>"));
}

#[test]
fn attributes_of_other_namespaces_are_nobodys_numbers() {
    let text = PLAIN
        .replace("<robot", "<robot xmlns:x=\"http://example.org/x\"")
        .replace(
            "<origin xyz=\"1 2 3\"",
            "<origin x:xyz=\"7 7 7\" x:rpy=\"1 1 1\" xyz=\"1 2 3\"",
        );
    let model = RobotModel::from_urdf_text(&text, "odd.urdf").unwrap();
    let plain = RobotModel::from_urdf_text(PLAIN, "odd.urdf").unwrap();
    let origin = |m: &RobotModel| m.joints()[0].parent_link_from_joint;
    assert_eq!(origin(&model), origin(&plain));
    let got = patched(&text);
    assert!(
        got.contains("x:xyz=\"7 7 7\" x:rpy=\"1 1 1\" xyz=\"1 2 4\""),
        "{got}"
    );
    // Where the URDF's own attribute is missing, the foreign one does not stand for it.
    let alone = text.replace(" xyz=\"1 2 3\"", "");
    let model = RobotModel::from_urdf_text(&alone, "odd.urdf").unwrap();
    assert_eq!(origin(&model).translation.vector.norm(), 0.0);
    let got = patched(&alone);
    assert!(
        got.contains("x:xyz=\"7 7 7\"") && got.contains(" xyz=\"1 2 4\""),
        "{got}"
    );
}

#[test]
fn sections_comments_and_instructions_hide_nothing_and_show_nothing() {
    let odd = "<?calib <joint name=\"j\"> ?>\n  <!-- </robot> <joint name=\"j\"/> -->\n  <gazebo><![CDATA[<origin xyz=\"5 5 5\"/></robot>]]></gazebo>\n</robot>";
    let text = PLAIN.replace("</robot>", odd);
    let got = patched(&text);
    assert_eq!(got.matches("xyz=\"1 2 4\"").count(), 1);
    let frame = got.find("<link name=\"body\"/>").unwrap();
    assert!(
        frame > got.find("]]></gazebo>").unwrap() && frame < got.rfind("</robot>").unwrap(),
        "{got}"
    );
}

#[test]
fn spaces_around_everything() {
    let wide = " ".repeat(300);
    let text = PLAIN
        .replace(
            "xyz=\"1 2 3\"",
            &format!("xyz{wide}={wide}'{wide}1\t2\n3 '"),
        )
        .replace("</robot>", "</robot  >");
    let got = patched(&text);
    assert!(got.contains(&format!("'{wide}1\t2\n4 '")), "{got}");
}

#[test]
fn far_away_and_very_small() {
    let text = PLAIN.replace("1 2 3", "123456789.25 2e-9 3");
    let pose = Isometry3::translation(123_456_789.5, 3e-9, 3.0);
    let edits = [UrdfEdit::SetOrigin {
        joint: "j".to_owned(),
        parent_link_from_joint: pose,
    }];
    let done = patch(&text, "odd.urdf", &edits).unwrap();
    assert!(
        done.text.contains("xyz=\"123456789.5 0.000000003 3\""),
        "{}",
        done.text
    );
}
