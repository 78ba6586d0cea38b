//! Residuals that no axis and no center explain are said to be so.

use std::path::PathBuf;

use calib_fit::{Answer, FitError, Held, TableRequest, aor, cor};
use calib_recording::Poses;
use nalgebra::{Point3, Vector3};

const GRIPPER: [&str; 4] = ["gripM_1", "gripM_2", "gripM_3", "gripM_4"];

/// A recording of Ripley's gripper.
fn ripley(file: &str) -> TableRequest {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../robots/ripley");
    TableRequest {
        file: Some(folder.join(file).into()),
        only: GRIPPER.map(str::to_owned).to_vec(),
        ..TableRequest::default()
    }
}

fn stated(sigma_m: f64, request: TableRequest) -> TableRequest {
    TableRequest {
        sigma_m: Some(sigma_m),
        ..request
    }
}

/// A marker 3 mm from an axis along z, with a pseudo-random noise of 1 mm on each coordinate.
fn small_noisy_circle() -> TableRequest {
    let mut state = 7_u32;
    let mut noise = move || {
        let mut uniform = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(state) / f64::from(u32::MAX) - 0.5
        };
        1e-3 * (0..12).map(|_| uniform()).sum::<f64>()
    };
    let track = (0..400).map(|k| {
        let angle = 0.1 * f64::from(k);
        let place = Vector3::new(angle.cos(), angle.sin(), 0.0) * 3e-3;
        let error = Vector3::new(noise(), noise(), noise());
        Some(Point3::from(place + error))
    });
    let held = Held {
        poses: Poses {
            rows: (0..400).collect(),
            markers: [("tip".to_owned(), track.collect())].into(),
            ..Poses::default()
        },
        ..Held::default()
    };
    TableRequest {
        file: Some(held.into()),
        ..TableRequest::default()
    }
}

fn refused(answer: Result<Answer, FitError>, what: &str) {
    let answer = answer.expect("an answer");
    let value: serde_json::Value = serde_json::from_str(&answer.json).expect("JSON");
    let reason = value["reason"].as_str().expect("a reason");
    assert!(!answer.observable, "{}", answer.text);
    assert_eq!(value["verdict"], "weak");
    let said = format!("no single {what} explains the points");
    assert!(reason.starts_with(&said), "{reason}");
    assert!(answer.text.contains(reason) && answer.text.contains("help: "));
}

#[test]
fn random_postures_have_neither_axis_nor_center() {
    let poses = || ripley("arm_poses.csv");
    refused(aor(&poses()), "axis");
    refused(cor(&poses()), "center");
    refused(aor(&stated(0.3e-3, poses())), "axis");
    let consensus = TableRequest {
        estimator: Some("consensus".to_owned()),
        ..stated(0.3e-3, poses())
    };
    refused(cor(&consensus), "center");
    let all = TableRequest {
        all: true,
        ..poses()
    };
    let answer = aor(&all).expect("a comparison");
    assert!(!answer.observable, "{}", answer.text);
    let said = "no single axis explains the points";
    assert!(answer.text.contains(said), "{}", answer.text);
}

#[test]
fn a_sweep_of_one_joint_keeps_its_axis() {
    // The noise that is stated is a third of what the residuals show: statements may be wrong by that.
    for request in [
        ripley("wrist_sweep.csv"),
        stated(0.1e-3, ripley("wrist_sweep.csv")),
    ] {
        let answer = aor(&request).expect("an answer");
        assert!(answer.observable, "{}", answer.text);
    }
}

#[test]
fn a_noise_that_is_stated_explains_residuals_of_its_size() {
    refused(aor(&small_noisy_circle()), "axis");
    let answer = aor(&stated(1e-3, small_noisy_circle())).expect("an answer");
    assert!(answer.observable, "{}", answer.text);
    refused(aor(&stated(1e-5, small_noisy_circle())), "axis");
}
