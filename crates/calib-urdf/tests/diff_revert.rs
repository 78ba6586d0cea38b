//! What a person sees of a change, and the way back.

use calib_urdf::rpy::rotation_from_rpy;
use calib_urdf::{ChangeRecord, RevertError, UrdfEdit, diff, patch, revert, sha256_hex};
use nalgebra::{Isometry3, Translation3, Vector3};

const A: &str = r#"<robot name="arm">
  <link name="base"/>
  <link name="upper_arm"><inertial><mass value="1"/></inertial></link>
  <link name="hand"/>
  <link name="old_tool"/>
  <joint name="shoulder_pan_joint" type="revolute">
    <parent link="base"/><child link="upper_arm"/>
    <origin xyz="0 0 0.3"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/>
  </joint>
  <joint name="elbow" type="continuous">
    <parent link="upper_arm"/><child link="hand"/><origin xyz="0.4 0 0"/><axis xyz="0 1 0"/>
  </joint>
  <joint name="flange" type="fixed"><parent link="hand"/><child link="old_tool"/></joint>
</robot>
"#;

fn b() -> String {
    A.replace("0 0 0.3", "0.001 -0.0002 0.3015")
        .replace("\"0.4 0 0\"", "\"0.4 0 0\" rpy=\"0 0 0.001\"")
        .replace("<axis xyz=\"0 1 0\"", "<axis xyz=\"0 1 0.01\"")
        .replace("upper=\"1\"", "upper=\"1.5\"")
        .replace("old_tool", "new_tool")
        .replace("\"flange\" type=\"fixed\"", "\"flange\" type=\"prismatic\"")
        .replace(
            "<child link=\"new_tool\"/>",
            "<child link=\"new_tool\"/><mimic joint=\"elbow\" multiplier=\"2\"/>",
        )
        .replace("mass value=\"1\"", "mass value=\"1.2\"")
}

#[test]
fn the_table() {
    let difference = diff(A, "a.urdf", &b(), "b.urdf").unwrap();
    insta::assert_snapshot!("table", difference);
    assert!(
        difference
            .to_string()
            .lines()
            .all(|line| line.chars().count() <= 80)
    );
    insta::assert_snapshot!(
        "json",
        serde_json::to_string_pretty(&rounded(&serde_json::to_value(&difference).unwrap()))
            .unwrap()
    );
    insta::assert_snapshot!("unified", calib_urdf::unified(A, "a.urdf", &b(), "b.urdf"));
}

/// Nine digits are what a person may rely on.
fn rounded(value: &serde_json::Value) -> serde_json::Value {
    match value {
        serde_json::Value::Number(number) => number.as_f64().map_or(value.clone(), |x| {
            serde_json::json!((x * 1e9).round() / 1e9)
        }),
        serde_json::Value::Array(items) => items.iter().map(rounded).collect(),
        serde_json::Value::Object(map) => {
            serde_json::Value::Object(map.iter().map(|(k, v)| (k.clone(), rounded(v))).collect())
        }
        _ => value.clone(),
    }
}

#[test]
fn no_difference_in_what_a_robot_is() {
    let only_text = A
        .replace("  <link", "\t<link")
        .replace("0.4 0 0", "4e-1 0 -0.0")
        .replace("0 0 1", "0 0 5");
    let difference = diff(A, "a.urdf", &only_text, "b.urdf").unwrap();
    assert!(difference.is_empty(), "{difference}");
    assert_eq!(difference.to_string(), "no differences\n");
    assert_eq!(calib_urdf::unified(A, "a", A, "a"), "");
}

fn a_patch() -> (String, ChangeRecord) {
    let origin = Isometry3::from_parts(
        Translation3::new(0.4, 0.01, 0.0),
        rotation_from_rpy(&Vector3::new(0.1, 0.2, 0.3)),
    );
    let edits = [
        UrdfEdit::SetOrigin {
            joint: "elbow".to_owned(),
            parent_link_from_joint: origin,
        },
        UrdfEdit::SetOrigin {
            joint: "flange".to_owned(),
            parent_link_from_joint: origin,
        },
        UrdfEdit::AddFixedFrame {
            name: "body".to_owned(),
            parent_link: "hand".to_owned(),
            joint_name: "body_mount".to_owned(),
            parent_from_frame: origin,
            comment: None,
        },
        UrdfEdit::AddProvenance {
            text: "ü: not one byte a character".to_owned(),
        },
    ];
    let done = patch(A, "a.urdf", &edits).unwrap();
    let record = done.record(A);
    (done.text, record)
}

#[test]
fn the_record_survives_json_and_gives_the_original_back() {
    let (text, record) = a_patch();
    let json = serde_json::to_string_pretty(&record).unwrap();
    let read: ChangeRecord = serde_json::from_str(&json).unwrap();
    assert_eq!(read, record);
    assert_eq!(revert(&text, &read).unwrap(), A);
    assert!(
        record
            .replacements
            .iter()
            .all(|r| text[r.at..].starts_with(&r.new))
    );
}

#[test]
fn sha256_of_a_known_text() {
    // FIPS 180-2, appendix B.1
    assert_eq!(
        sha256_hex(b"abc"),
        "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
    );
}

#[test]
fn a_file_that_was_touched_is_not_reverted() {
    let (text, record) = a_patch();
    let message = revert(&format!("{text} "), &record)
        .unwrap_err()
        .to_string();
    assert!(
        message.starts_with("the file was edited after it was patched (sha256 "),
        "{message}"
    );
    assert_eq!(revert(A, &record), Err(RevertError::AlreadyOriginal));
    let future = ChangeRecord {
        calib_changes: 2,
        ..record.clone()
    };
    assert_eq!(
        revert(&text, &future),
        Err(RevertError::Version { found: 2 })
    );

    let mut damaged = record.clone();
    damaged.replacements[0].old.push('x');
    assert!(matches!(
        revert(&text, &damaged),
        Err(RevertError::NotTheOriginal { .. })
    ));
    for at in [usize::MAX, text.len() + 1, 0] {
        let mut damaged = record.clone();
        damaged.replacements[1].at = at;
        assert!(
            matches!(revert(&text, &damaged), Err(RevertError::Mismatch { .. })),
            "{at}"
        );
    }
    // In the middle of a character.
    let mut damaged = record.clone();
    damaged.replacements[0].at = text.find('ü').unwrap() + 1;
    assert!(matches!(
        revert(&text, &damaged),
        Err(RevertError::Mismatch { .. })
    ));
}
