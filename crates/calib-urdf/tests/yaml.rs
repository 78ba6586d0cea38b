//! Origins of joints in YAML: replaced number by number, every other byte kept, and refused where a value is shared.

use calib_urdf::rpy::rotation_from_rpy;
use calib_urdf::{UrdfEdit, patch_yaml, revert, yaml_origins};
use nalgebra::{Isometry3, Translation3, Vector3};

/// The keys and their order are those of ur_description's `default_kinematics.yaml`; the numbers are made up.
const UR: &str = "# arm 12, cell 3\r\nkinematics:\r\n  shoulder:\r\n    x: 0\r\n    y: 0\r\n    z: 0.1626\r\n    roll: -0\r\n    pitch: 0\r\n    yaw: -1.6e-08\r\n\
\x20 upper_arm:\r\n    x: 0.00015   # flange side\r\n    y: 0\r\n    z: 0\r\n    roll: 1.5702\r\n    pitch: 0\r\n    yaw: 0\r\n\
\x20 forearm: {x: -0.4254, y: 0, z: 0, roll: 0.001, pitch: 0.0008, yaw: 0}\r\n  hash: calib_1234\r\n";

fn set(joint: &str, x: f64) -> UrdfEdit {
    UrdfEdit::SetOrigin {
        joint: joint.to_owned(),
        parent_link_from_joint: Isometry3::from_parts(
            Translation3::new(x, 0.0, 0.1626),
            rotation_from_rpy(&Vector3::new(0.0, 0.0, 0.002)),
        ),
    }
}

#[test]
fn a_ur_arm_s_numbers_are_replaced_one_by_one() {
    let edits = [set("left_shoulder_pan_joint", 0.001)];
    let done = patch_yaml(UR, "k.yaml", &edits).unwrap();
    let expected = UR
        .replacen("x: 0\r\n", "x: 0.001\r\n", 1)
        .replace("yaw: -1.6e-08", "yaw: 0.002");
    assert_eq!(done.main.text, expected);
    assert_eq!(revert(&done.main.text, &done.main.record(UR)).unwrap(), UR);
    let before = done.before["left_shoulder_pan_joint"];
    assert!((before.translation.vector.z - 0.1626).abs() < 1e-15);
    let again = patch_yaml(&done.main.text, "k.yaml", &edits).unwrap();
    assert_eq!(again.main.splices, []);
}

#[test]
fn flow_style_and_lists() {
    let done = patch_yaml(UR, "k.yaml", &[set("elbow_joint", 0.5)]).unwrap();
    assert!(
        done.main
            .text
            .contains("forearm: {x: 0.5, y: 0, z: 0.1626, roll: 0, pitch: 0, yaw: 0.002}\r\n"),
        "{}",
        done.main.text
    );
    let lists = "joints:\n- waist: {xyz: [0, 0,  1.0], rpy: [0, 0, 0]} # w\n";
    let done = patch_yaml(lists, "k.yaml", &[set("waist", 0.25)]).unwrap();
    assert_eq!(
        done.main.text,
        "joints:\n- waist: {xyz: [0.25, 0,  0.1626], rpy: [0, 0, 0.002]} # w\n"
    );
}

#[test]
fn origins_are_listed() {
    let found = yaml_origins(UR, "k.yaml").unwrap();
    let keys: Vec<(&str, usize)> = found.iter().map(|o| (o.key.as_str(), o.line)).collect();
    assert_eq!(keys, [("shoulder", 4), ("upper_arm", 11), ("forearm", 17)]);
    assert!(found[2].is_of("ur_elbow_joint") && !found[2].is_of("ur_wrist_1_joint"));
    assert_eq!(
        found[2].parent_link_from_joint.translation.vector.x,
        -0.4254
    );
    assert_eq!(yaml_origins("a: 1\n", "k.yaml").unwrap(), []);
}

#[test]
fn what_cannot_be_set_is_refused() {
    let texts = [
        ("no joint", "kinematics:\n  shouldre_pan: {x: 0}\n"),
        ("missing key", "waist: {x: 0, z: 0}\n"),
        ("two places", "a: {waist: {x: 0}}\nb: {waist: {x: 0}}\n"),
        ("key twice", "waist: {x: 0, x: 1}\n"),
        ("alias", "tool: &t 0\nwaist: {x: *t, yaw: 0, z: 0}\n"),
        ("anchor", "waist: &w {x: 0, yaw: 0, z: 0}\nhand: *w\n"),
        ("merge", "base: &b {y: 0}\nwaist: {<<: *b, x: 0}\n"),
        ("quotes", "waist: {x: '0', yaw: 0, z: 0}\n"),
        ("tag", "waist: {x: 0, yaw: !degrees 0, z: 0}\n"),
        ("no number", "waist: {x: 1 cm, yaw: 0, z: 0}\n"),
        ("not finite", "waist: {x: .inf, yaw: 0, z: 0}\n"),
        ("twice over", "waist: {x: 0, xyz: [0, 0, 0], yaw: 0}\n"),
        ("short list", "waist: {xyz: [0, 0], rpy: [0, 0, 0]}\n"),
        ("no YAML", "waist: {x: 0\n"),
        ("empty", "# nothing\n"),
        ("no map", "0.5\n"),
    ];
    let mut said = String::new();
    for (what, text) in texts {
        let refused = patch_yaml(text, "k.yaml", &[set("waist", 0.25)]).unwrap_err();
        said += &format!("--- {what}\n{refused}\n");
    }
    let frame = UrdfEdit::AddProvenance {
        text: "x".to_owned(),
    };
    said += &format!(
        "--- not an origin\n{}\n",
        patch_yaml(UR, "k.yaml", &[frame]).unwrap_err()
    );
    let twice = [set("elbow_joint", 0.1), set("elbow_joint", 0.2)];
    said += &format!(
        "--- given twice\n{}\n",
        patch_yaml(UR, "k.yaml", &twice).unwrap_err()
    );
    let nan = patch_yaml(UR, "k.yaml", &[set("elbow_joint", f64::NAN)]).unwrap_err();
    said += &format!("--- NaN\n{nan}\n");
    insta::assert_snapshot!(said);
}

#[test]
fn deep_nesting_is_an_error_and_no_overflow() {
    let deep = "[".repeat(100_000);
    assert!(patch_yaml(&deep, "k.yaml", &[set("waist", 0.1)]).is_err());
    let deep = "a: ".repeat(3) + &"{a: ".repeat(100_000);
    assert!(yaml_origins(&deep, "k.yaml").is_err());
}
