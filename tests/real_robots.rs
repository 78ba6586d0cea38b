//! A real arm through the program: TIAGo, 37 postures to fit, 62 of another day to check.
//!
//! The tables belong to another laboratory: without them the test says that it was skipped.

mod scratch;

use std::path::PathBuf;

use scratch::{Scratch, root};

/// Position error of the body on the other day that the field's best published fit leaves, m (norm, rms).
const FIELD: f64 = 3.07e-3;

const PROFILE: &str = "calib: 1
robot: {name: tiago, urdf: tiago.urdf}
tracker: {frame: base}
bodies:
  hand: {link: wrist_ft_tool_link, markers: [BL, BR, TR, TL]}
recordings:
  train:
    file: train.csv
    use: static
    columns: &columns
      joint_columns: [arm_1_joint, arm_2_joint, arm_3_joint, arm_4_joint, arm_5_joint, arm_6_joint, arm_7_joint]
      prismatic: {torso_lift_joint: torso_lift_joint}
      markers: {BL: [x1, y1, z1], BR: [x2, y2, z2], TR: [x3, y3, z3], TL: [x4, y4, z4]}
  validation: {file: validation.csv, use: validation, columns: *columns}
solve:
  free: [bodies, tracker, joint_offsets, joint_axes, compliance]
  limits: {held_out_rms_mm: 3.07}
";

fn data() -> Option<PathBuf> {
    let folder = std::env::var_os("CALIB_REAL_DATA")
        .map_or_else(|| root().join("../shared/data"), PathBuf::from);
    if folder.join("tiago_frozen").is_dir() {
        return Some(folder);
    }
    println!("skipped: no measurements of real robots (CALIB_REAL_DATA)");
    None
}

#[test]
fn the_model_that_37_postures_choose_beats_the_field_on_another_day() {
    let Some(data) = data() else { return };
    let read = |path: &str| std::fs::read(data.join(path)).expect("part of the data");
    let dir = Scratch::new()
        .file("tiago.yaml", PROFILE)
        .file("tiago.urdf", read("tiago_qualisys/tiago_48_schunk.urdf"))
        .file("train.csv", read("tiago_frozen/train.csv"))
        .file("validation.csv", read("tiago_frozen/validation.csv"));
    // The choice looks at the 37 postures only.
    let ranking = dir.calib(["run", "tiago.yaml", "--compare-models"]);
    assert_eq!(ranking.code, 0, "{}", ranking.stderr);
    assert!(
        ranking.stdout.contains("* + compliance"),
        "{}",
        ranking.stdout
    );
    let ran = dir.calib(["run", "tiago.yaml", "--out", "out"]);
    assert_eq!(ran.code, 0, "{}{}", ran.stdout, ran.stderr);
    let report = dir.json("out/report.json");
    let rms = report["verification"]["held_out"]["calibrated"]["rms_m"]
        .as_f64()
        .expect("62 postures");
    let registered = report["verification"]["held_out"]["registration_only"]["rms_m"]
        .as_f64()
        .expect("62");
    println!(
        "TIAGo, another day: {:.2} mm rms, registration only {:.2} mm",
        rms * 1e3,
        registered * 1e3
    );
    assert!(
        rms < FIELD && rms < 0.7 * registered,
        "{rms} against {registered}"
    );
    let findings = report["findings"].as_array().expect("a list");
    let has = |id: &str| findings.iter().any(|f| f["id"] == id);
    assert!(
        has("virtual-points"),
        "the four points were computed from one body"
    );
}
