//! Joint effects and limits that a profile names: backlash, measured torque, an origin inside its housing.

use crate::scratch;

use std::fmt::Write as _;

use calib_urdf::RobotModel;
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use scratch::Scratch;
use serde_json::Value;

/// σ of one marker coordinate, m.
pub(crate) const MARKER: f64 = 1e-4;

/// Three joints; the shoulder stands `shift` m off its place along x.
fn urdf(shift: f64) -> String {
    let joint = |i: usize, xyz: &str, axis: &str| {
        format!(
            "  <link name=\"l{i}\"/>\n  <joint name=\"j{i}\" type=\"revolute\">\n    <parent link=\"l{}\"/>\n    <child link=\"l{i}\"/>\n    \
             <origin xyz=\"{xyz}\" rpy=\"0 0 0\"/>\n    <axis xyz=\"{axis}\"/>\n    <limit lower=\"-3\" upper=\"3\" effort=\"50\" velocity=\"2\"/>\n  </joint>\n",
            i - 1
        )
    };
    format!(
        "<robot name=\"arm\">\n  <link name=\"l0\"/>\n{}{}{}</robot>\n",
        joint(1, "0 0 0.3", "0 0 1"),
        joint(2, &format!("{} 0 0.1", 0.05 + shift), "0 1 0"),
        joint(3, "0 0 0.4", "0 1 0"),
    )
}

/// What the true joint turns more than its encoder says, from the direction it came, the torque that it holds and the reading.
pub(crate) type Effect = fn(joint: usize, approach: f64, torque: f64, q: f64) -> f64;

/// Markers of foot and hand, joint readings and torques over random postures, in the order of recording.
fn recording(arm: &RobotModel, effect: Effect, n: usize, seed: u64) -> String {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let foot = [
        [-0.12, -0.1, 0.0],
        [0.13, -0.09, 0.0],
        [0.11, 0.1, 0.02],
        [-0.1, 0.12, 0.06],
    ];
    let hand = [
        [0.05, 0.0, 0.3],
        [0.12, 0.01, 0.33],
        [0.06, 0.07, 0.31],
        [0.07, 0.03, 0.37],
    ];
    let tracker_from_root = Isometry3::from_parts(
        Translation3::new(0.9, 0.3, 0.1),
        UnitQuaternion::from_euler_angles(0.0, 0.0, 0.7),
    );
    let mut text = String::from("j1_rad,j2_rad,j3_rad,j1_nm,j2_nm,j3_nm");
    for body in ["b", "f"] {
        for k in 1..=4 {
            let _ = write!(text, ",{body}{k}_x_mm,{body}{k}_y_mm,{body}{k}_z_mm");
        }
    }
    text.push('\n');
    let mut before: Option<[f64; 3]> = None;
    for _ in 0..n {
        let q = [(-2.0, 2.0), (-1.0, 1.2), (-1.5, 1.5)].map(|(l, h)| rng.random_range(l..h));
        let torque = [(-1.0, 1.0), (-20.0, 20.0), (-9.0, 9.0)].map(|(l, h)| rng.random_range(l..h));
        let mut true_q = q.to_vec();
        for k in 0..3 {
            let approach = before.map_or(0.0, |b| (q[k] - b[k]).signum());
            true_q[k] += effect(k + 1, approach, torque[k], q[k]);
        }
        before = Some(q);
        let cells: Vec<String> = q
            .iter()
            .chain(&torque)
            .map(|v| format!("{v:.12}"))
            .collect();
        text += &cells.join(",");
        for (link, points) in [("l0", &foot), ("l3", &hand)] {
            let link = arm.link_id(link).expect("there");
            let tracker_from_link = tracker_from_root * arm.root_from_link(&true_q, link);
            for p in points {
                let noise = Vector3::from_fn(|_, _| {
                    let n: f64 = StandardNormal.sample(&mut rng);
                    MARKER * n
                });
                let seen = (tracker_from_link * Point3::from(*p)).coords + noise;
                let _ = write!(
                    text,
                    ",{:.6},{:.6},{:.6}",
                    seen.x * 1e3,
                    seen.y * 1e3,
                    seen.z * 1e3
                );
            }
        }
        text.push('\n');
    }
    text
}

pub(crate) const PROFILE: &str = r#"calib: 1
robot: {name: arm, urdf: arm/arm.urdf}
tracker: {frame: lab, marker_sigma_mm: 0.1}
bodies:
  foot: {link: l0, markers: [b1, b2, b3, b4], mount: {}, template_mm: {b1: [-120, -100, 0], b2: [130, -90, 0], b3: [110, 100, 20], b4: [-100, 120, 60]}}
  hand: {link: l3, markers: [f1, f2, f3, f4]}
recordings:
  poses: {file: arm/poses.csv, use: static}
  checks: {file: arm/checks.csv, use: validation}
solve:
  free: [bodies, tracker, joint_offsets, joint_axes]
  limits: {held_out_rms_mm: 0.3}
"#;

pub(crate) fn laboratory(profile: &str, shift: f64, effect: Effect) -> Scratch {
    let arm = RobotModel::from_urdf_text(&urdf(shift), "true").expect("a robot");
    Scratch::new()
        .file("arm/arm.urdf", urdf(0.0))
        .file("arm.yaml", profile)
        .file("arm/poses.csv", recording(&arm, effect, 80, 1))
        .file("arm/checks.csv", recording(&arm, effect, 30, 2))
}

pub(crate) fn parameter<'a>(report: &'a Value, name: &str) -> Option<&'a Value> {
    let all = report["parameters"].as_array()?;
    all.iter().find(|p| p["name"] == name)
}

pub(crate) fn number(v: &Value) -> f64 {
    v.as_f64().expect("a number")
}

fn says(report: &Value, id: &str) -> bool {
    let findings = report["findings"].as_array().expect("findings");
    findings.iter().any(|f| f["id"] == id)
}

/// Half of joint 2's backlash, rad.
const BACKLASH: f64 = 0.002;

#[test]
fn backlash_is_found_and_taken_out_of_the_prediction() {
    // It stays behind: short of where it goes.
    let effect: Effect = |joint, approach, _, _| {
        if joint == 2 {
            -BACKLASH * approach
        } else {
            0.0
        }
    };
    let without = laboratory(PROFILE, 0.0, effect);
    without.calib(["run", "arm.yaml", "--out", "out"]).expect(1);
    let rejected = without.json("out/report.json");
    let missing = rejected["findings"].as_array().expect("findings");
    let named =
        |f: &Value| f["id"] == "missing-physics" && f["text"].to_string().contains("backlash");
    assert!(missing.iter().any(named), "{missing:?}");

    let freed = PROFILE.replace("joint_axes]", "joint_axes, backlash]");
    let dir = laboratory(&freed, 0.0, effect);
    dir.calib(["run", "arm.yaml", "--out", "out"]).expect(0);
    let report = dir.json("out/report.json");
    for (joint, truth) in [("j1", 0.0), ("j2", BACKLASH), ("j3", 0.0)] {
        let p = parameter(&report, &format!("{joint}.backlash")).expect("freed");
        let (value, sigma) = (number(&p["value"]), number(&p["sigma"]));
        assert!((value - truth).abs() < 4.0 * sigma && sigma < 2e-4, "{p}");
    }
    let held_out = &report["verification"]["held_out"]["calibrated"]["rms_m"];
    assert!(number(held_out) < 2.0 * MARKER, "{held_out}");
    // The URDF cannot hold the backlash: what it predicts alone stands beside, and the verdict says so.
    let alone = number(&report["verification"]["held_out"]["urdf_alone"]["rms_m"]);
    assert!(alone > 5.0 * number(held_out), "{alone}");
    let reasons = report["reason_ids"].as_array().expect("a list");
    assert!(reasons.iter().any(|r| r == "urdf-alone"), "{reasons:?}");
    assert_eq!(report["verdict"], "accepted_with_warnings");
    let yaml = dir.read("out/arm.calibrated.calibration.yaml");
    assert!(yaml.contains("backlash_rad:"), "{yaml}");
    assert!(!says(&report, "missing-physics"), "{}", report["findings"]);
}

/// rad per N m.
const SOFT: f64 = 1e-4;

#[test]
fn compliance_follows_measured_torques_where_the_urdf_has_no_masses() {
    // It gives way to the load, which is minus what the drive holds.
    let effect: Effect = |joint, _, torque, _| if joint == 2 { -SOFT * torque } else { 0.0 };
    let freed = PROFILE
        .replace("joint_axes]", "joint_axes, compliance]")
        .replace("solve:\n", "solve:\n  load: measured\n");
    let dir = laboratory(&freed, 0.0, effect);
    dir.calib(["run", "arm.yaml", "--out", "out"]).expect(0);
    let report = dir.json("out/report.json");
    let p = parameter(&report, "j2.compliance").expect("freed");
    let (value, sigma) = (number(&p["value"]), number(&p["sigma"]));
    assert!((value - SOFT).abs() < 4.0 * sigma && sigma < 1e-5, "{p}");
    let held_out = &report["verification"]["held_out"]["calibrated"]["rms_m"];
    assert!(number(held_out) < 2.0 * MARKER, "{held_out}");

    let renamed = dir.read("arm/poses.csv").replace("j2_nm", "torque_nm");
    let dir = dir.file("arm/poses.csv", renamed);
    dir.calib(["run", "arm.yaml", "--out", "again"]).expect(1);
    let report = dir.json("again/report.json");
    assert!(says(&report, "torque-missing"), "{}", report["findings"]);
}

#[test]
fn an_origin_stays_inside_its_housing_and_the_report_says_that_the_data_disagree() {
    let none: Effect = |_, _, _, _| 0.0;
    // The shoulder is 2 mm off; its housing leaves 1 mm.
    let limited = PROFILE.replace(
        "solve:\n",
        "solve:\n  joints: {j2: {free: [offset, origin], within_mm: 1}}\n",
    );
    let dir = laboratory(&limited, 0.002, none);
    dir.calib(["run", "arm.yaml", "--out", "out"]).expect(1);
    let report = dir.json("out/report.json");
    assert!(says(&report, "on-its-limit"), "{}", report["findings"]);
    for axis in ["x", "y", "z"] {
        let p = parameter(&report, &format!("j2.origin.{axis}")).expect("freed");
        assert!(number(&p["value"]).abs() <= 1e-3 + 1e-9, "{p}");
    }
    let wide = limited.replace("within_mm: 1", "within_mm: 5");
    let dir = laboratory(&wide, 0.002, none);
    dir.calib(["run", "arm.yaml", "--out", "out"]).expect(0);
    let report = dir.json("out/report.json");
    assert!(!says(&report, "on-its-limit"), "{}", report["findings"]);
}
