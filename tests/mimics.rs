//! A finger whose last joint follows the one before by a ratio that the URDF states and only the fingertip's position shows.

use crate::scratch;

use calib_urdf::RobotModel;
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use scratch::Scratch;
use serde_json::Value;

/// σ of one marker coordinate, m.
const MARKER: f64 = 1e-4;
const PALM: [[f64; 3]; 4] = [
    [0.0, 0.03, 0.01],
    [-0.04, -0.03, 0.012],
    [0.02, -0.04, 0.03],
    [-0.02, 0.01, 0.05],
];
/// The first alone, or all.
const TIP: [[f64; 3]; 4] = [
    [0.024, 0.001, 0.006],
    [0.01, 0.008, 0.004],
    [0.012, -0.007, 0.005],
    [0.004, 0.0, 0.012],
];
const FINGERS: usize = 3;

/// Three fingers of four joints; the last follows the third by `ratio`. Links are off by up to this much, m.
fn hand(ratio: f64, error: f64, seed: u64) -> String {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut text = "<robot name=\"hand\">\n  <link name=\"palm\"/>\n".to_owned();
    for finger in 1..=FINGERS {
        let names = ["abd", "prox", "mid", "dist"].map(|name| format!("f{finger}_{name}"));
        let origins = [
            [0.09, 0.04 * (finger as f64 - 2.0), 0.0],
            [0.015, 0.0, 0.0],
            [0.045, 0.0, 0.0],
            [0.03, 0.0, 0.0],
        ];
        for (k, (name, origin)) in names.iter().zip(origins).enumerate() {
            let parent = if k == 0 {
                "palm".to_owned()
            } else {
                format!("{}_link", names[k - 1])
            };
            let [x, y, z] = origin.map(|c| c + error * rng.random_range(-1.0..1.0));
            let (axis, limits) = if k == 0 {
                ("0 0 1", "lower=\"-0.35\" upper=\"0.35\"")
            } else {
                ("0 1 0", "lower=\"0\" upper=\"1.7\"")
            };
            let mimic = if k == 3 {
                format!("<mimic joint=\"{}\" multiplier=\"{ratio}\"/>", names[2])
            } else {
                String::new()
            };
            text += &format!(
                "  <link name=\"{name}_link\"/>\n  <joint name=\"{name}\" type=\"revolute\">\n    <parent link=\"{parent}\"/>\n    <child link=\"{name}_link\"/>\n    \
                 <origin xyz=\"{x} {y} {z}\"/>\n    <axis xyz=\"{axis}\"/>\n    <limit {limits} effort=\"1\" velocity=\"2\"/>{mimic}\n  </joint>\n"
            );
        }
    }
    text + "</robot>\n"
}

fn table(robot: &RobotModel, on_tip: usize, rows: usize, seed: u64) -> String {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let tracker_from_root = Isometry3::from_parts(
        Translation3::new(0.9, 0.3, 0.1),
        UnitQuaternion::from_euler_angles(0.02, -0.03, 0.7),
    );
    let free: Vec<_> = robot.independent_joints().collect();
    let mut names: Vec<String> = free
        .iter()
        .map(|j| format!("{}_rad", robot.joint(*j).name))
        .collect();
    let markers: Vec<(String, String, [f64; 3])> = (1..=4)
        .map(|k| (format!("p{k}"), "palm".to_owned(), PALM[k - 1]))
        .chain((1..=FINGERS).flat_map(|f| {
            let tip = TIP.iter().take(on_tip).enumerate();
            tip.map(move |(k, at)| (format!("t{f}_{}", k + 1), format!("f{f}_dist_link"), *at))
        }))
        .collect();
    names.extend(
        markers
            .iter()
            .flat_map(|(name, ..)| ["x", "y", "z"].map(|c| format!("{name}.{c}_m"))),
    );
    let mut text = names.join(",") + "\n";
    for _ in 0..rows {
        let mut q = vec![0.0; robot.joints().len()];
        for joint in &free {
            let abducts = robot.joint(*joint).name.ends_with("abd");
            q[joint.index()] = if abducts {
                rng.random_range(-0.3..0.3)
            } else {
                rng.random_range(0.05..1.5)
            };
        }
        let mut cells: Vec<String> = free
            .iter()
            .map(|j| format!("{:.6}", q[j.index()]))
            .collect();
        for (_, link, at) in &markers {
            let tracker_from_link =
                tracker_from_root * robot.root_from_link(&q, robot.link_id(link).expect("there"));
            let noise = Vector3::from_fn(|_, _| {
                let n: f64 = StandardNormal.sample(&mut rng);
                MARKER * n
            });
            let seen = (tracker_from_link * Point3::from(*at)).coords + noise;
            cells.extend(seen.iter().map(|v| format!("{v:.7}")));
        }
        text += &(cells.join(",") + "\n");
    }
    text
}

/// The report of a hand whose joints really follow by `ratio`, and the robot; the URDF says 1.
fn report(ratio: f64, on_tip: usize, free: &str, seed: u64) -> (Value, RobotModel) {
    let robot = RobotModel::from_urdf_text(&hand(ratio, 5e-4, seed), "hand").expect("a hand");
    let tip = |finger: usize| {
        let markers: Vec<String> = (1..=on_tip).map(|k| format!("t{finger}_{k}")).collect();
        let markers = markers.join(", ");
        format!("t{finger}: {{link: f{finger}_dist_link, markers: [{markers}]}}")
    };
    let tips = [1, 2, 3].map(tip).join("\n  ");
    let dir = Scratch::new()
        .file("hand.urdf", hand(1.0, 0.0, 0))
        .file("poses.csv", table(&robot, on_tip, 50, seed + 10))
        .file("checks.csv", table(&robot, on_tip, 20, seed + 20))
        .file(
            "hand.yaml",
            format!(
                "calib: 1\nrobot: {{name: hand, urdf: hand.urdf}}\ntracker: {{frame: lab, marker_sigma_mm: 0.1}}\nbodies:\n  palm: {{link: palm, markers: [p1, p2, p3, p4]}}\n  \
                 {tips}\n\
                 recordings:\n  poses: {{file: poses.csv, use: static}}\n  checks: {{file: checks.csv, use: validation}}\n\
                 solve:\n  free: [bodies, tracker, joint_offsets, joint_axes]\n{free}  limits: {{held_out_rms_mm: 0.5}}\n"
            ),
        );
    let ran = dir.calib(["run", "hand.yaml", "--out", "out"]);
    let report = dir.json("out/report.json");
    let accepted = report["verdict"] == "accepted" || report["verdict"] == "accepted_with_warnings";
    assert_eq!(ran.code, i32::from(!accepted), "{}", ran.stderr);
    (report, robot)
}

/// Value, σ and truth, m, of the length of each finger's third link.
fn lengths(report: &Value, robot: &RobotModel) -> Vec<[f64; 3]> {
    let of_finger = |finger: usize| {
        let name = format!("distance.f{finger}_mid.f{finger}_dist");
        let mut changes = report["robot_changes"].as_array().expect("a list").iter();
        let change = changes.find(|c| c["name"] == name.as_str()).expect("there");
        let joint = robot
            .joints()
            .iter()
            .find(|j| j.name == format!("f{finger}_dist"));
        let origin = joint
            .expect("there")
            .parent_link_from_joint
            .translation
            .vector;
        [
            change["value"].as_f64().expect("a number"),
            change["sigma"].as_f64().expect("a number"),
            origin.xz().norm(),
        ]
    };
    (1..=FINGERS).map(of_finger).collect()
}

fn ratios(report: &Value) -> Vec<(String, f64, f64)> {
    let findings = report["findings"].as_array().expect("a list").iter();
    let number = |f: &Value, key: &str| f["facts"][key]["value"].as_f64().expect("a number");
    findings
        .filter(|f| f["id"] == "mimic-ratio")
        .map(|f| {
            (
                f["facts"]["kind"].as_str().expect("a word").to_owned(),
                number(f, "ratio"),
                number(f, "sigma"),
            )
        })
        .collect()
}

#[test]
fn a_ratio_that_is_wrong_is_named_and_no_length_is_known_by_it() {
    let mut named = 0;
    for seed in [1, 2] {
        let (report, robot) = report(0.8, 1, "", seed);
        for (kind, ratio, sigma) in ratios(&report) {
            named += usize::from(kind == "another");
            assert!((ratio - 0.8).abs() < 4.0 * sigma, "{ratio} ± {sigma}");
        }
        for [value, sigma, truth] in lengths(&report, &robot) {
            // With the ratio taken as exact it was wrong by more than 30 σ.
            assert!(
                (value - truth).abs() < 5.0 * sigma,
                "{value} ± {sigma}, {truth}"
            );
        }
    }
    assert!(named >= 5, "{named}");
}

/// Two markers and more on the last link show the ratio itself: lengths that were fitted with another one are accepted nowhere, and the remedy is right.
#[test]
fn a_ratio_that_the_markers_refute_is_an_error() {
    for on_tip in [2, 3, 4] {
        let (report, _) = report(0.8, on_tip, "", 1);
        let refused = ["rejected", "not_evaluated"].map(Value::from);
        assert!(refused.contains(&report["verdict"]), "{on_tip}");
        let found = ratios(&report);
        assert_eq!(found.len(), FINGERS, "{found:?}");
        for (kind, ratio, sigma) in found {
            assert_eq!(kind, "another");
            assert!((ratio - 0.8).abs() < 4.0 * sigma, "{ratio} ± {sigma}");
        }
        assert_eq!(report["diagnosis"]["evidence"], "mimic-ratio", "{on_tip}");
    }
}

#[test]
fn the_remedy_makes_the_lengths_right() {
    let free = "  joints: {f1_dist: {free: [offset, axis, gain]}, f2_dist: {free: [offset, axis, gain]}, f3_dist: {free: [offset, axis, gain]}}\n  prior: {gain_percent: 25}\n";
    for on_tip in 1..=4 {
        let (report, robot) = report(0.8, on_tip, free, 1);
        assert_eq!(
            report["verdict"].as_str().map(|v| &v[..8]),
            Some("accepted")
        );
        assert!(ratios(&report).is_empty());
        for [value, sigma, truth] in lengths(&report, &robot) {
            assert!(
                (value - truth).abs() < 4.0 * sigma,
                "{value} ± {sigma}, {truth}"
            );
        }
    }
}

#[test]
fn a_ratio_that_is_right_is_not_called_wrong() {
    for (on_tip, seed) in [(1, 1), (1, 2), (1, 3), (4, 1), (4, 2)] {
        let (report, robot) = report(1.0, on_tip, "", seed);
        assert!(
            ratios(&report).iter().all(|(kind, ..)| kind == "taken"),
            "{:?}",
            ratios(&report)
        );
        for [value, sigma, truth] in lengths(&report, &robot) {
            assert!(
                (value - truth).abs() < 3.0 * sigma,
                "{value} ± {sigma}, {truth}"
            );
        }
    }
}
