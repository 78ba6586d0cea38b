//! A robot that nobody programmed for: a six-axis arm by a URDF and a profile, and nothing else.

use crate::scratch;
use crate::truth;

use scratch::Scratch;
use truth::{CHI2_99_SIX, Truth, errors};

/// Six revolute joints: yaw, pitch, pitch, roll, pitch, roll; lengths of a small industrial arm.
fn urdf() -> String {
    let joints = [
        ("j1", "0 0 0.29", "0 0 1"),
        ("j2", "0.03 0 0.11", "0 1 0"),
        ("j3", "0 0 0.35", "0 1 0"),
        ("j4", "0.12 0 0.06", "1 0 0"),
        ("j5", "0.25 0 0", "0 1 0"),
        ("j6", "0.08 0 0", "1 0 0"),
    ];
    let mut text = String::from("<robot name=\"arm\">\n  <link name=\"l0\"/>\n");
    for (i, (name, xyz, axis)) in joints.iter().enumerate() {
        text += &format!(
            "  <link name=\"l{}\"/>\n  <joint name=\"{name}\" type=\"revolute\">\n    <parent link=\"l{i}\"/>\n    <child link=\"l{}\"/>\n    \
             <origin xyz=\"{xyz}\" rpy=\"0 0 0\"/>\n    <axis xyz=\"{axis}\"/>\n    <limit lower=\"-3\" upper=\"3\" effort=\"50\" velocity=\"2\"/>\n  </joint>\n",
            i + 1,
            i + 1
        );
    }
    text + "</robot>\n"
}

const PROFILE: &str = r#"calib: 1
robot: {name: arm, urdf: arm/arm.urdf}
tracker: {frame: lab, marker_sigma_mm: 0.1}
bodies:
  foot: {link: l0, markers: [b1, b2, b3, b4], mount: {}, template_mm: {b1: [-120, -100, 0], b2: [130, -90, 0], b3: [110, 100, 20], b4: [-100, 120, 60]}}
  flange: {link: l6, markers: [f1, f2, f3, f4]}
recordings:
  wrist: {file: arm/wrist.csv, use: sweep, joints: {j5_deg: [-90, 90], j6_deg: [-150, 150]}}
  poses: {file: arm/poses.csv, use: static}
  checks: {file: arm/checks.csv, use: validation}
origins:
  wrist: {joint: j6, body: flange, sweep: wrist, center: sfe, axes: {y: j5, x: j6}}
solve:
  free: [bodies, tracker, joint_offsets, joint_axes]
  limits: {held_out_rms_mm: 1}
outputs: {urdf: arm.calibrated.urdf, scene: arm.scene.json, add_bodies: [flange]}
simulate:
  seed: 6
  tracker_from_root: {xyz_mm: [900, 300, 100], rpy_deg: [0, 0, 40]}
  mounts:
    foot: {markers_mm: {b1: [-120, -100, 0], b2: [130, -90, 0], b3: [110, 100, 20], b4: [-100, 120, 60]}}
    flange: {xyz_mm: [40, 10, 5], rpy_deg: [5, 80, 0], markers_mm: {f1: [0, 0, 0], f2: [70, 0, 0], f3: [20, 60, 0], f4: [40, 20, 45]}}
  errors: {joint_offset_deg: 0.2, axis_mm: 0.5, axis_deg: 0.1, mount_mm: 2, mount_deg: 1}
  noise: {marker_mm: 0.1, joint_deg: 0.005}
  recordings:
    wrist:
      grid: [{joint: j5_deg, from: -90, to: 90, poses: 7}, {joint: j6_deg, from: -150, to: 150, poses: 7}]
      hold: {j2_deg: 20, j3_deg: 30}
    poses: {random: {j1_deg: [-150, 150], j2_deg: [-60, 90], j3_deg: [-60, 60], j4_deg: [-150, 150], j5_deg: [-100, 100], j6_deg: [-170, 170]}, poses: 60}
    checks: {random: {j1_deg: [-150, 150], j2_deg: [-60, 90], j3_deg: [-60, 60], j4_deg: [-150, 150], j5_deg: [-100, 100], j6_deg: [-170, 170]}, poses: 15}
"#;

#[test]
fn a_robot_needs_a_profile_and_a_urdf_and_no_code() {
    let dir = Scratch::new()
        .file("arm/arm.urdf", urdf())
        .file("arm.yaml", PROFILE);
    dir.calib(["simulate", "arm.yaml", "--out", "arm"])
        .expect(0);
    dir.calib(["check", "arm.yaml"]).expect(0);
    dir.calib(["run", "arm.yaml", "--out", "out"]).expect(0);
    let report = dir.json("out/report.json");
    assert_eq!(report["verdict"], "accepted");
    let truth = Truth::read(&dir.json("arm/truth.json"));
    for error in errors(&report, &truth) {
        println!("{}: χ² {:.2}", error.name, error.chi2);
        assert!(
            error.chi2 < CHI2_99_SIX,
            "{}: χ² {:.1}",
            error.name,
            error.chi2
        );
    }
    let held_out = &report["verification"]["held_out"];
    let rms = |what: &str| held_out[what]["rms_m"].as_f64().expect("a number");
    assert!(
        rms("calibrated") < 0.3 * rms("registration_only"),
        "{held_out}"
    );
}
