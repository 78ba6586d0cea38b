//! Robot descriptions of other people: read, patched, reverted. Only touched bytes differ.
//!
//! They are not part of the project: the tests run where `CALIB_REAL_DATA` names the folder, or where it lies
//! beside the project, and say that they were skipped elsewhere.

use calib_urdf::rpy::rotation_from_rpy;
use calib_urdf::{
    EditError, JointKind, RobotModel, SecondReader, UrdfEdit, diff, patch, revert, verify,
};
use nalgebra::{Isometry3, Translation3, Vector3};
use std::path::Path;

/// The texts of all files with one of these endings, with their names: the project's own robots and the real ones.
fn texts(endings: &[&str]) -> Vec<(String, String)> {
    let mut found = Vec::new();
    let mut folders = vec![Path::new(env!("CARGO_MANIFEST_DIR")).join("../../robots")];
    folders.extend(skipped_tests::real_data(""));
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap().map(Result::unwrap) {
            let path = entry.path();
            let name = entry.file_name().to_string_lossy().into_owned();
            if path.is_dir() {
                folders.push(path);
            } else if endings.iter().any(|ending| name.ends_with(ending)) {
                found.push((name, std::fs::read_to_string(&path).unwrap()));
            }
        }
    }
    found.sort();
    found
}

/// Every joint gets another origin, a different one each.
fn all_moved(model: &RobotModel) -> Vec<UrdfEdit> {
    let edits = model.joints().iter().enumerate().map(|(n, joint)| {
        let small = 1e-3 * (n as f64 + 1.0);
        let delta = Isometry3::from_parts(
            Translation3::new(small, 0.0, -small),
            rotation_from_rpy(&Vector3::new(0.0, small, 0.5 * small)),
        );
        UrdfEdit::SetOrigin {
            joint: joint.name.clone(),
            parent_link_from_joint: joint.parent_link_from_joint * delta,
        }
    });
    edits.collect()
}

#[test]
fn urdfs_are_read_patched_and_reverted() {
    for (name, text) in texts(&[".urdf"]) {
        let model = RobotModel::from_urdf_text(&text, &name).unwrap();

        let same: Vec<_> = model
            .joints()
            .iter()
            .map(|joint| UrdfEdit::SetOrigin {
                joint: joint.name.clone(),
                parent_link_from_joint: joint.parent_link_from_joint,
            })
            .collect();
        assert_eq!(patch(&text, &name, &same).unwrap().text, text, "{name}");

        let mut edits = all_moved(&model);
        let tip = model.link(model.link_ids().last().unwrap()).name.clone();
        edits.push(UrdfEdit::AddFixedFrame {
            name: "calib_body".to_owned(),
            parent_link: tip,
            joint_name: "calib_body_mount".to_owned(),
            parent_from_frame: Isometry3::translation(0.01, 0.02, 0.03),
            comment: None,
        });
        let done = patch(&text, &name, &edits).unwrap();
        let expected = model.clone().with_edits(&name, &edits).unwrap();
        let verification = verify(&done.text, &expected, &name).unwrap();
        assert!(
            verification.translation < 1e-13
                && matches!(verification.second_reader, SecondReader::Agrees { .. }),
            "{name}: {verification:?}"
        );
        assert_eq!(
            revert(&done.text, &done.record(&text)).unwrap(),
            text,
            "{name}"
        );
        only_touched_bytes_differ(&name, &text, &done.text);
        assert!(
            patch(&done.text, &name, &edits).unwrap().splices.is_empty(),
            "{name}: a second patch"
        );

        let difference = diff(&text, &name, &done.text, &name).unwrap();
        assert_eq!(difference.joints.len(), model.joints().len());
        assert_eq!(difference.added_links, ["calib_body"]);
        for (n, joint) in difference.joints.iter().enumerate() {
            let expected_mm = (n as f64 + 1.0) * 2.0_f64.sqrt();
            assert!(
                (joint.distance_mm - expected_mm).abs() < 1e-9,
                "{name}: {joint:?}"
            );
        }
        println!(
            "{name}: {} joints, {} byte ranges changed",
            model.joints().len(),
            done.splices.len()
        );
    }
}

/// Independent of our own ranges: outside of the lines of `<origin>` elements of joints and the added ones, the lines are the same.
fn only_touched_bytes_differ(name: &str, original: &str, patched: &str) {
    let removed_and_added = similar::TextDiff::from_lines(original, patched);
    for change in removed_and_added
        .iter_all_changes()
        .filter(|change| change.tag() != similar::ChangeTag::Equal)
    {
        let line = change.value();
        let of_origin = ["<origin", "xyz=", "rpy="]
            .iter()
            .any(|word| line.contains(word));
        let of_frame = line.contains("calib_body")
            || (change.tag() == similar::ChangeTag::Insert
                && (line.contains("<parent link=") || line.contains("</joint>")));
        assert!(of_origin || of_frame, "{name}: {line:?}");
    }
    assert_eq!(original.contains('\r'), patched.contains('\r'));
    if original.contains('\r') {
        assert_eq!(
            patched.matches('\n').count(),
            patched.matches("\r\n").count(),
            "{name}"
        );
    }
}

#[test]
fn xacros_are_refused_as_robots_and_patched_where_literal() {
    for (name, text) in texts(&[".xacro"]) {
        let message = RobotModel::from_urdf_text(&text, &name)
            .unwrap_err()
            .to_string();
        assert!(message.contains("this is a xacro file"), "{message}");
        if !name.starts_with("st_r17_robot") {
            continue;
        }
        for joint in ["waist", "shoulder", "elbow", "hand"] {
            let edits = [UrdfEdit::SetOrigin {
                joint: joint.to_owned(),
                parent_link_from_joint: Isometry3::translation(0.125, -0.25, 0.5),
            }];
            let done = patch(&text, &name, &edits).unwrap();
            assert!(!done.changes.is_empty());
            assert_eq!(revert(&done.text, &done.record(&text)).unwrap(), text);
            only_touched_bytes_differ(&name, &text, &done.text);
            assert!(patch(&done.text, &name, &edits).unwrap().splices.is_empty());
        }
        let edits = [UrdfEdit::SetOrigin {
            joint: "sholder".to_owned(),
            parent_link_from_joint: Isometry3::identity(),
        }];
        let refused = patch(&text, &name, &edits).unwrap_err();
        assert!(
            matches!(&refused, EditError::UnknownName { source, .. } if source.nearest.as_deref() == Some("shoulder")),
            "{refused}"
        );
    }
}

/// The facts that the data's description states.
#[test]
fn known_robots() {
    for (name, text) in texts(&[".urdf"]) {
        let model = RobotModel::from_urdf_text(&text, &name).unwrap();
        match name.as_str() {
            "tiago_48_schunk.urdf" => {
                let finger = model.joint(model.joint_id("gripper_right_finger_joint").unwrap());
                assert_eq!(
                    finger.law.source,
                    model.joint_id("gripper_finger_joint").unwrap()
                );
                assert_eq!(finger.law.multiplier, 1.0);
                let torques =
                    model.gravity_torques(&model.zero_positions(), &Vector3::new(0.0, 0.0, -9.81));
                // The masses above the lift, added up by another program: 18.9059 kg.
                let lift = torques[model.joint_id("torso_lift_joint").unwrap().index()];
                assert!((lift - 18.9059 * 9.81).abs() < 1e-9, "{lift} N");
            }
            "agile_justin_nominal.urdf" => {
                let right = model.joint(model.joint_id("right_0").unwrap());
                let JointKind::Revolute { axis } = right.kind else {
                    panic!("{right:?}")
                };
                assert!((axis.norm() - 1.0).abs() < 1e-15);
                assert!((axis.y + 0.75_f64.sqrt()).abs() < 1e-8);
            }
            "st_r17_robot.urdf" => {
                let q = model.zero_positions();
                let at = |link: &str| {
                    model
                        .root_from_link(&q, model.link_id(link).unwrap())
                        .translation
                        .vector
                };
                // base → waist 0.033268, waist → shoulder 0.32173; upper arm 0.375
                assert!((at("link_2") - Vector3::new(0.0, 0.0, 0.033268 + 0.32173)).norm() < 1e-12);
                assert!(((at("link_3") - at("link_2")).norm() - 0.375).abs() < 1e-12);
            }
            _ => {}
        }
    }
}
