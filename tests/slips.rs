//! Two visits to a robot whose neighboring axes are parallel or slide: the first calibration applied to the URDF, and one encoder's zero moved since.

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
const MARKER: f64 = 1e-4;

/// Name, kind, origin, axis and range (m or rad) of each joint, from the base on.
type Joint = (&'static str, &'static str, [f64; 3], [i8; 3], [f64; 2]);

/// An industrial arm: shoulder and elbow are parallel, and the shoulder stands beside the first axis.
const ARM: &[Joint] = &[
    ("a1", "revolute", [0.0, 0.0, 0.4], [0, 0, 1], [-2.6, 2.6]),
    ("a2", "revolute", [0.15, 0.0, 0.05], [0, 1, 0], [-1.4, 1.0]),
    ("a3", "revolute", [0.0, 0.02, 0.6], [0, 1, 0], [-1.0, 2.1]),
    ("a4", "revolute", [0.12, 0.0, 0.1], [1, 0, 0], [-2.6, 2.6]),
    ("a5", "revolute", [0.5, 0.0, 0.0], [0, 1, 0], [-1.7, 1.7]),
    ("a6", "revolute", [0.09, 0.0, 0.0], [1, 0, 0], [-2.9, 2.9]),
];

/// A SCARA: all axes are parallel, and one of them slides.
const SCARA: &[Joint] = &[
    ("s1", "revolute", [0.0, 0.0, 0.3], [0, 0, 1], [-2.0, 2.0]),
    ("s2", "revolute", [0.35, 0.0, 0.05], [0, 0, 1], [-2.2, 2.2]),
    (
        "s3",
        "prismatic",
        [0.3, 0.0, -0.02],
        [0, 0, -1],
        [0.0, 0.18],
    ),
    ("s4", "revolute", [0.0, 0.0, -0.05], [0, 0, -1], [-2.9, 2.9]),
];

/// A gantry with a wrist.
const GANTRY: &[Joint] = &[
    ("gx", "prismatic", [0.0, 0.0, 1.5], [1, 0, 0], [-0.6, 0.6]),
    ("gy", "prismatic", [0.0, 0.0, 0.1], [0, 1, 0], [-0.4, 0.4]),
    ("gz", "prismatic", [0.05, 0.0, -0.1], [0, 0, -1], [0.0, 0.4]),
    ("w1", "revolute", [0.0, 0.0, -0.3], [0, 0, 1], [-2.6, 2.6]),
    ("w2", "revolute", [0.0, 0.0, -0.1], [0, 1, 0], [-1.5, 1.5]),
    ("w3", "revolute", [0.0, 0.0, -0.12], [0, 0, 1], [-2.6, 2.6]),
];

/// The robot with errors of its origins, σ in m and rad; without any it is the nominal one.
fn urdf(joints: &[Joint], (place, turn): (f64, f64), seed: u64) -> String {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut error = |sigma: f64| {
        let n: f64 = StandardNormal.sample(&mut rng);
        sigma * n
    };
    let mut text = String::from("<robot name=\"arm\">\n  <link name=\"l0\"/>\n");
    for (i, (name, kind, xyz, axis, _)) in joints.iter().enumerate() {
        let xyz = xyz.map(|x| format!("{:.9}", x + error(place))).join(" ");
        let rpy = [(); 3].map(|()| format!("{:.9}", error(turn))).join(" ");
        let axis = axis.map(|x| x.to_string()).join(" ");
        let next = i + 1;
        let _ = writeln!(
            text,
            "  <link name=\"l{next}\"/>\n  <joint name=\"{name}\" type=\"{kind}\">\n    <parent link=\"l{i}\"/>\n    \
             <child link=\"l{next}\"/>\n    <origin xyz=\"{xyz}\" rpy=\"{rpy}\"/>\n    <axis xyz=\"{axis}\"/>\n    \
             <limit lower=\"-3\" upper=\"3\" effort=\"50\" velocity=\"2\"/>\n  </joint>"
        );
    }
    text + "</robot>\n"
}

/// Random postures, with the tracker and a body of four markers elsewhere in every visit, and the zero of a joint moved by some degrees.
fn table(
    joints: &[Joint],
    truth: &RobotModel,
    visit: u64,
    rows: (usize, u64),
    slip: Option<(&str, f64)>,
) -> String {
    let mut setup = ChaCha8Rng::seed_from_u64(visit);
    let mut place = |range: f64| setup.random_range(-range..range);
    let tracker_from_root = Isometry3::from_parts(
        Translation3::new(place(1.0), place(1.0), place(0.5)),
        UnitQuaternion::from_euler_angles(place(0.1), place(0.1), place(2.0)),
    );
    let tip_from_body = Isometry3::from_parts(
        Translation3::new(place(0.05), place(0.05), place(0.05)),
        UnitQuaternion::from_euler_angles(place(1.0), place(1.0), place(1.0)),
    );
    let markers = [
        [0.0, 0.0, 0.0],
        [0.08, 0.0, 0.0],
        [0.03, 0.07, 0.0],
        [0.05, 0.02, 0.05],
    ];
    let mut rng = ChaCha8Rng::seed_from_u64(1000 * visit + rows.1);
    let unit = |kind: &str| if kind == "prismatic" { "m" } else { "rad" };
    let names = joints.iter().map(|j| format!("{}_{}", j.0, unit(j.1)));
    let columns = (1..=4).flat_map(|k| ["x", "y", "z"].map(|c| format!("t{k}_{c}_m")));
    let mut text = names.chain(columns).collect::<Vec<_>>().join(",") + "\n";
    let tip = truth.link_id(&format!("l{}", joints.len())).expect("there");
    for _ in 0..rows.0 {
        let ranges = joints.iter().map(|joint| joint.4[0]..joint.4[1]);
        let q: Vec<f64> = ranges.map(|range| rng.random_range(range)).collect();
        let moved = |j: &Joint| match slip {
            Some((name, degrees)) if name == j.0 => degrees.to_radians(),
            _ => 0.0,
        };
        let true_q: Vec<f64> = q.iter().zip(joints).map(|(q, j)| q + moved(j)).collect();
        let tracker_from_body =
            tracker_from_root * truth.root_from_link(&true_q, tip) * tip_from_body;
        let mut cells: Vec<String> = q.iter().map(|v| format!("{v:.9}")).collect();
        for p in markers {
            let noise = Vector3::from_fn(|_, _| {
                let n: f64 = StandardNormal.sample(&mut rng);
                MARKER * n
            });
            let seen = (tracker_from_body * Point3::from(p)).coords + noise;
            cells.extend(seen.iter().map(|v| format!("{v:.7}")));
        }
        text += &(cells.join(",") + "\n");
    }
    text
}

/// A month with this slip: the results `may` and `june`.
fn months(joints: &[Joint], seed: u64, slip: Option<(&str, f64)>) -> Scratch {
    let profile = format!(
        "calib: 1
robot: {{name: arm, urdf: arm.urdf}}
tracker: {{frame: hall, marker_sigma_mm: 0.1}}
bodies:
  tool: {{link: l{}, markers: [t1, t2, t3, t4]}}
recordings:
  poses: {{file: poses.csv, use: static}}
  checks: {{file: checks.csv, use: validation}}
solve: {{free: [bodies, tracker, joint_offsets, joint_axes], noise: {{model: white}}, limits: {{held_out_rms_mm: 1}}}}
outputs: {{urdf: arm.calibrated.urdf}}
",
        joints.len()
    );
    let truth = urdf(joints, (6e-4, 2e-3), seed);
    let truth = RobotModel::from_urdf_text(&truth, "true").expect("a robot");
    let mut dir = Scratch::new()
        .file("arm.urdf", urdf(joints, (0.0, 0.0), 0))
        .file("arm.yaml", profile);
    for (visit, slip) in [("may", None), ("june", slip)] {
        let setup = 2 * seed + u64::from(visit == "june");
        dir = dir
            .file("poses.csv", table(joints, &truth, setup, (40, 1), slip))
            .file("checks.csv", table(joints, &truth, setup, (12, 2), slip));
        let ran = dir.calib(["run", "arm.yaml", "--out", visit]).expect(0);
        assert!(ran.stdout.contains("ACCEPTED"), "{}", ran.stdout);
        if visit == "may" {
            dir.calib(["apply", "may", "arm.urdf", "--in-place"])
                .expect(0);
        }
    }
    dir
}

/// What `calib drift` says of it.
fn drift(joints: &[Joint], seed: u64, slip: Option<(&str, f64)>) -> Value {
    let dir = months(joints, seed, slip);
    dir.calib(["drift", "may", "june", "--json"]).json()
}

#[test]
fn what_is_no_evidence_of_the_robot_is_said() {
    let dir = months(SCARA, 21, None);
    let same = dir.calib(["drift", "may", "may"]).expect(0);
    assert!(
        same.stdout.contains("the same recordings"),
        "{}",
        same.stdout
    );
    let other = dir.calib(["drift", "may", "june"]).expect(0);
    assert!(!other.stdout.contains("warning"), "{}", other.stdout);
    let mut report: Value = serde_json::from_str(&dir.read("june/report.json")).expect("JSON");
    report["verdict"] = "rejected".into();
    let dir = dir.file("june/report.json", report.to_string());
    let said = dir.calib(["drift", "may", "june"]).expect(0);
    assert!(
        said.stdout.contains("june/report.json is of a rejected"),
        "{}",
        said.stdout
    );
    let history = dir.calib(["history", "may", "june"]).expect(0);
    assert!(history.stdout.contains("REJECTED"), "{}", history.stdout);
}

#[test]
fn a_slip_of_an_axis_with_parallel_or_sliding_neighbors_is_found() {
    for (joints, seed, slipped) in [
        (ARM, 1, "a2"),
        (ARM, 2, "a3"),
        (ARM, 3, "a3"),
        (GANTRY, 4, "w1"),
        (GANTRY, 5, "w2"),
    ] {
        let found = drift(joints, seed, Some((slipped, 0.2)));
        assert_eq!(found["changed"], true, "{slipped} {seed}: {found:#}");
        let numbers = found["numbers"].as_array().expect("a list");
        let significant: Vec<&Value> = numbers
            .iter()
            .filter(|n| n["significant"] == true)
            .collect();
        assert_eq!(significant.len(), 1, "{slipped} {seed}: {significant:#?}");
        let zero = significant[0];
        assert_eq!(zero["name"], format!("zero.{slipped}"), "{seed}");
        let of = |key: &str| zero[key].as_f64().expect("a number");
        let off = of("change").abs() - 0.2_f64.to_radians();
        assert!(off.abs() < 4.0 * of("sigma"), "{slipped} {seed}: {zero}");
        assert!(
            of("sigma") < 0.05_f64.to_radians(),
            "{slipped} {seed}: {zero}"
        );
    }
    // How far a SCARA's axes are from each other depends on the height, which nobody knows: that something changed is known, not which number.
    for seed in [6, 7] {
        let found = drift(SCARA, seed, Some(("s2", 0.5)));
        assert_eq!(found["changed"], true, "s2 {seed}: {found:#}");
        let numbers = found["numbers"].as_array().expect("a list").iter();
        let mut wrong = numbers.filter(|n| n["significant"] == true && n["name"] != "zero.s2");
        assert!(wrong.next().is_none(), "s2 {seed}: {found:#}");
    }
}

#[test]
fn a_month_without_a_slip_is_no_change() {
    for (joints, seed) in [
        (ARM, 11),
        (ARM, 12),
        (SCARA, 13),
        (SCARA, 14),
        (SCARA, 15),
        (GANTRY, 16),
    ] {
        let found = drift(joints, seed, None);
        assert_eq!(found["changed"], false, "{seed}: {found:#}");
        let numbers = found["numbers"].as_array().expect("a list");
        // Zeros that have neighbors on both sides are compared.
        assert!(
            numbers
                .iter()
                .any(|n| n["name"].as_str().is_some_and(|n| n.starts_with("zero.")))
        );
    }
}
