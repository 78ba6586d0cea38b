//! Profiles, robots, change records and model files: an error with a place, or something that holds together.

use calib_model::file::RobotModelFile;
use calib_model::{Model, Options, Under};
use calib_urdf::{ChangeRecord, JointKind, Patched, RobotModel, UrdfEdit, patch, revert};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

/// Profiles are checked against this robot.
const ROBOT: &str = include_str!("../../robots/ripley/r17.urdf");

/// A profile: every problem names the file, and checking it ends.
pub fn profile(text: &str) {
    let robot = RobotModel::from_urdf_text(ROBOT, "r.urdf").expect("a shipped robot");
    let checked = calib_profile::parse(text, "x")
        .and_then(|raw| calib_profile::check(&raw, text, "x", &robot));
    match checked {
        Ok(profile) => {
            for name in [&profile.outputs.urdf, &profile.outputs.scene] {
                assert!(!name.is_empty() && !name.contains(['/', '\0']), "{name:?}");
            }
        }
        Err(error) => {
            let said = error.to_string();
            assert!(said.starts_with('x') && !error.problems.is_empty(), "{said}");
        }
    }
}

/// A URDF is read, changed, read again, and reverted to the same bytes.
pub fn urdf_round_trip(text: &str) {
    let model = match RobotModel::from_urdf_text(text, "x.urdf") {
        Ok(model) => model,
        Err(error) => {
            assert!(error.to_string().starts_with("x.urdf:"), "{error}");
            return;
        }
    };
    let moved = |k: usize, old: &Isometry3<f64>| {
        let small = 1e-3 * (k as f64 + 1.0);
        let by = Translation3::new(small, -0.5 * small, 0.25 * small);
        old * Isometry3::from_parts(by, UnitQuaternion::new(Vector3::new(small, 0.3 * small, -small)))
    };
    let mut edits: Vec<UrdfEdit> = model
        .joints()
        .iter()
        .enumerate()
        .take(8)
        .map(|(k, joint)| UrdfEdit::SetOrigin {
            joint: joint.name.clone(),
            parent_link_from_joint: moved(k, &joint.parent_link_from_joint),
        })
        .collect();
    if let Some(joint) = model.joints().iter().find(|j| j.kind != JointKind::Fixed) {
        edits.push(UrdfEdit::AddFixedFrame {
            name: "fuzzed_frame".to_owned(),
            parent_link: model.link(joint.child).name.clone(),
            joint_name: "fuzzed_mount".to_owned(),
            parent_from_frame: Isometry3::translation(0.1, 0.2, 0.3),
            comment: Some("a -- comment".to_owned()),
        });
    }
    // Refusals (numbers beyond what decimals hold) are answers; a wrong text is not: the patch compares it itself.
    let Ok(done) = patch(text, "x.urdf", &edits) else {
        return;
    };
    let record = done.record(text);
    assert_eq!(revert(&done.text, &record).expect("its own record"), text);
    let json = serde_json::to_string(&record).expect("JSON");
    let read: ChangeRecord = serde_json::from_str(&json).expect("its own JSON");
    assert_eq!(read, record);
    let again = patch(&done.text, "x.urdf", &edits).expect("its own text");
    assert!(again.splices.is_empty(), "a second patch changes something");
}

/// The first line is a change record, the rest the text that it belongs to.
pub fn change_record(text: &str) {
    let (record, patched) = text.split_once('\n').unwrap_or((text, ""));
    let Ok(record) = serde_json::from_str::<ChangeRecord>(record) else {
        return;
    };
    let _ = Patched::from_record(patched, &record);
    if let Ok(original) = revert(patched, &record) {
        assert_eq!(calib_urdf::sha256_hex(original.as_bytes()), record.original_sha256);
    }
    // With the hash of this very text, the ranges decide.
    let own = ChangeRecord {
        patched_sha256: calib_urdf::sha256_hex(patched.as_bytes()),
        ..record
    };
    let _ = revert(patched, &own);
}

/// A model file reads, or not; what was read is written and read again as the same. Of a robot that was accepted, every link can be asked for, and a
/// command that brings it where it is said to be.
pub fn model_file(bytes: &[u8]) {
    if let Ok(model) = Model::from_json(bytes) {
        let (mut work, q) = (model.work(), vec![0.1; model.joints().len()]);
        let mut command = q.clone();
        if model.forward(&q, &Under::default(), &mut work).is_ok() {
            for link in model.links().iter().take(4).filter_map(|name| model.link(name).ok()) {
                let _ = work.root_from_link(link);
                let (options, under) = (Options::default(), Under::default());
                let _ = model.correct(&q, link, &options, &under, &mut work, &mut command);
            }
        }
    }
    let Ok(model) = serde_json::from_slice::<RobotModelFile>(bytes) else {
        return;
    };
    let Ok(json) = serde_json::to_string(&model) else {
        return;
    };
    let again: RobotModelFile = serde_json::from_str(&json).expect("its own JSON");
    assert_eq!(serde_json::to_string(&again).expect("JSON"), json);
}
