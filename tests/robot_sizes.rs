//! The same robot at 5 cm, 1.2 m and 30 m, with errors and noise of its size: what is said of it is said of all three. And trackers whose unit of
//! length is another one in a recording, or that are far away.

use crate::computed::{arm, points};
use crate::scratch;

use std::fmt::Write as _;

use calib_urdf::RobotModel;
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use scratch::Scratch;
use serde_json::Value;

/// Name, kind, origin (in reaches), axis and range (rad, or reaches).
type Joint = (&'static str, &'static str, [f64; 3], &'static str, [f64; 2]);

/// An arm in a plane with a quill.
const JOINTS: [Joint; 4] = [
    ("j1", "revolute", [0.0, 0.0, 0.3], "0 0 1", [-2.0, 2.0]),
    ("j2", "revolute", [0.4, 0.0, 0.0], "0 0 1", [-2.2, 2.2]),
    ("quill", "prismatic", [0.3, 0.0, 0.0], "0 0 -1", [0.0, 0.18]),
    ("j4", "revolute", [0.0, 0.0, -0.1], "0 0 1", [-2.8, 2.8]),
];

/// A session with such a robot.
#[derive(Clone, Copy)]
struct Session {
    /// All lengths, errors and noise of them are in units of this, m.
    reach: f64,
    markers: usize,
    stated: bool,
    /// From the tracker's origin to the robot, m.
    away: f64,
    /// Of the lengths in the sweep.
    scale: f64,
}

const USUAL: Session = Session {
    reach: 1.2,
    markers: 4,
    stated: true,
    away: 0.5,
    scale: 1.0,
};

impl Session {
    /// σ of one marker coordinate, m.
    fn sigma(&self) -> f64 {
        2.5e-4 * self.reach
    }

    fn urdf(&self, rng: Option<&mut ChaCha8Rng>) -> String {
        let mut errors = Vec::new();
        if let Some(rng) = rng {
            errors.extend((0..12).map(|_| 8e-4 * normal(rng)));
        }
        let mut text = String::from("<robot name=\"arm\">\n  <link name=\"l0\"/>\n");
        for (i, (name, kind, at, axis, _)) in JOINTS.iter().enumerate() {
            let place = |k: usize| self.reach * (at[k] + errors.get(3 * i + k).unwrap_or(&0.0));
            let _ = writeln!(
                text,
                "  <link name=\"l{}\"/>\n  <joint name=\"{name}\" type=\"{kind}\">\n    <parent link=\"l{i}\"/>\n    <child link=\"l{}\"/>\n    \
                 <origin xyz=\"{} {} {}\" rpy=\"0 0 0\"/>\n    <axis xyz=\"{axis}\"/>\n    <limit lower=\"-7\" upper=\"7\" effort=\"1\" velocity=\"1\"/>\n  </joint>",
                i + 1,
                i + 1,
                place(0),
                place(1),
                place(2)
            );
        }
        text + "</robot>\n"
    }

    fn profile(&self) -> String {
        let names: Vec<String> = (1..=self.markers).map(|k| format!("t{k}")).collect();
        let stated = match self.stated {
            true => format!(", marker_sigma_mm: {}", self.sigma() * 1e3),
            false => String::new(),
        };
        format!(
            "calib: 1\nrobot: {{name: arm, urdf: arm/arm.urdf}}\ntracker: {{frame: lab{stated}}}\nbodies:\n  tool: {{link: l4, markers: [{}]}}\n\
             recordings:\n  poses: {{file: arm/poses.csv, use: static}}\n  more: {{file: arm/more.csv, use: static}}\n  checks: {{file: arm/checks.csv, use: validation}}\n\
             solve:\n  free: [bodies, tracker, joint_offsets, joint_axes]\n  prior: {{position_mm: {}}}\n  limits: {{held_out_rms_mm: {}}}\n",
            names.join(", "),
            self.reach * 10.0,
            self.sigma() * 4e3
        )
    }

    fn recording(
        &self,
        robot: &RobotModel,
        rows: usize,
        scale: f64,
        rng: &mut ChaCha8Rng,
    ) -> String {
        let tracker_from_root = Isometry3::from_parts(
            Translation3::new(self.away, 0.3 * self.reach, -0.2 * self.reach),
            UnitQuaternion::from_euler_angles(0.02, -0.03, 0.7),
        );
        let at = [
            [0.03, 0.0, 0.1],
            [0.1, 0.01, 0.06],
            [0.02, 0.07, 0.08],
            [0.05, 0.03, 0.0],
        ];
        let mut text = JOINTS.map(|j| unit(&j)).join(",");
        for k in 1..=self.markers {
            let _ = write!(text, ",t{k}_x_m,t{k}_y_m,t{k}_z_m");
        }
        text.push('\n');
        let link = robot.link_id("l4").expect("there");
        for _ in 0..rows {
            let q = JOINTS.map(|joint| {
                let size = if joint.1 == "prismatic" {
                    self.reach
                } else {
                    1.0
                };
                size * rng.random_range(joint.4[0]..joint.4[1])
            });
            // Zeros that the fit finds.
            let mut true_q = q.to_vec();
            true_q[1] += 0.004;
            true_q[3] -= 0.003;
            for turning in [0, 1, 3] {
                true_q[turning] += 2e-4 * normal(rng);
            }
            let tracker_from_link = tracker_from_root * robot.root_from_link(&true_q, link);
            let mut cells: Vec<String> = q.iter().map(|v| format!("{v:.9}")).collect();
            for p in &at[..self.markers] {
                let noise = Vector3::from_fn(|_, _| self.sigma() * normal(rng));
                let seen =
                    (tracker_from_link * (Point3::from(*p) * self.reach)).coords * scale + noise;
                cells.extend(seen.iter().map(|v| format!("{v:.9}")));
            }
            text += &(cells.join(",") + "\n");
        }
        text
    }

    fn recorded(&self, seed: u64) -> Scratch {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let robot = self.urdf(Some(&mut rng));
        let robot = RobotModel::from_urdf_text(&robot, "true").expect("a robot");
        let mut table = |rows, scale| self.recording(&robot, rows, scale, &mut rng);
        let [poses, more, checks] = [table(45, 1.0), table(25, self.scale), table(15, 1.0)];
        Scratch::new()
            .file("arm/arm.urdf", self.urdf(None))
            .file("arm.yaml", self.profile())
            .file("arm/poses.csv", poses)
            .file("arm/more.csv", more)
            .file("arm/checks.csv", checks)
    }
}

fn unit(joint: &Joint) -> String {
    let unit = if joint.1 == "prismatic" { "m" } else { "rad" };
    format!("{}_{unit}", joint.0)
}

fn normal(rng: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(rng)
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value}"))
}

/// Findings that are more than information.
fn warnings(report: &Value) -> Vec<&Value> {
    let all = report["findings"].as_array().expect("findings").iter();
    all.filter(|f| f["severity"] != "info").collect()
}

#[test]
fn what_is_said_of_a_robot_does_not_depend_on_its_size() {
    let all = [
        (0.05, 1),
        (0.2, 1),
        (0.2, 4),
        (1.2, 1),
        (1.2, 4),
        (30.0, 1),
        (30.0, 4),
    ];
    for (i, (reach, markers)) in all.into_iter().enumerate() {
        for stated in [true, false] {
            let session = Session {
                reach,
                markers,
                stated,
                away: 0.4 * reach,
                ..USUAL
            };
            let dir = session.recorded(60 + i as u64);
            let ran = dir.calib(["run", "arm.yaml", "--out", "out"]);
            let what = format!("{reach} m, {markers} markers, {stated}: {}", ran.stdout);
            assert_eq!(ran.code, 0, "{what}{}", ran.stderr);
            let report = dir.json("out/report.json");
            assert!(warnings(&report).is_empty(), "{what}");
            // In units of the robot, all are alike.
            let held_out = &report["verification"]["held_out"]["calibrated"]["rms_m"];
            let held_out = number(held_out) / session.sigma();
            assert!((1.4..2.4).contains(&held_out), "{held_out} {what}");
            let parts = report["accuracy_limits"].as_array().expect("parts");
            for part in parts {
                let sigma = number(&part["sigma_m"]) / session.sigma();
                let tracker = part["kind"] == "tracker_noise";
                let most = if tracker { 2.3 } else { 1.5 };
                assert!(sigma < most, "{part} {what}");
            }
            assert!(ran.stdout.contains("calib apply"), "{what}");
        }
    }
}

#[test]
fn a_tracker_may_be_a_hundred_meters_away() {
    let dir = Session {
        away: 120.0,
        ..USUAL
    }
    .recorded(71);
    let ran = dir.calib(["run", "arm.yaml", "--out", "out"]);
    assert_eq!(ran.code, 0, "{}{}", ran.stdout, ran.stderr);
    let report = dir.json("out/report.json");
    assert!(warnings(&report).is_empty(), "{}", ran.stdout);
}

#[test]
fn a_recording_with_another_unit_of_length_is_named() {
    let dir = Session {
        scale: 1.02,
        ..USUAL
    }
    .recorded(72);
    let ran = dir.calib(["run", "arm.yaml", "--out", "out"]).expect(3);
    assert!(ran.stderr.contains("tracker-scale"), "{}", ran.stderr);
    assert!(ran.stderr.contains("more: tracker"), "{}", ran.stderr);
    // Less than what is certain is a warning, and named before what follows from it.
    let dir = Session {
        scale: 1.005,
        ..USUAL
    }
    .recorded(73);
    let ran = dir.calib(["run", "arm.yaml", "--out", "out"]);
    let report = dir.json("out/report.json");
    let named = warnings(&report).iter().any(|f| f["id"] == "tracker-scale");
    assert!(named, "{}", ran.stdout);
    let dir = USUAL.recorded(72);
    let ran = dir.calib(["check", "arm.yaml"]).expect(0);
    assert!(!ran.stdout.contains("tracker-scale"), "{}", ran.stdout);
}

#[test]
fn closed_forms_need_an_origin() {
    let dir = USUAL.recorded(74);
    let ran = dir
        .calib(["run", "arm.yaml", "--method", "paper"])
        .expect(2);
    assert!(
        ran.stderr.contains("the profile states none"),
        "{}",
        ran.stderr
    );
}

/// A tracker in a unit of length of its own makes every length of the robot longer, and held-out poses agree.
#[test]
fn a_tracker_with_another_scale_is_named_by_the_lengths_of_the_robot() {
    let scaled = |scale: f64, seed: u64| {
        let robot = RobotModel::from_urdf_text(&arm(5e-4, seed), "arm").expect("an arm");
        let table = |n: usize, seed: u64| -> String {
            let table = points(&robot, 2e-4, 4, n, seed);
            let lines = table.lines().enumerate().map(|(row, line)| {
                let cells = line.split(',').enumerate().map(|(column, cell)| {
                    match (row, column, cell.parse::<f64>()) {
                        (1.., 6.., Ok(at)) => format!("{:.4}", at * scale),
                        _ => cell.to_owned(),
                    }
                });
                cells.collect::<Vec<_>>().join(",") + "\n"
            });
            lines.collect()
        };
        let dir = Scratch::new()
            .file("arm.urdf", arm(0.0, 0))
            .file("poses.csv", table(60, seed + 1))
            .file("checks.csv", table(15, seed + 2));
        dir.calib([
            "init",
            "arm.urdf",
            "poses.csv",
            "checks.csv",
            "-o",
            "arm.yaml",
        ]);
        dir.calib(["run", "arm.yaml", "--out", "out"]);
        let report = dir.json("out/report.json");
        let all = report["findings"].as_array().cloned().unwrap_or_default();
        let of = all.into_iter().find(|f| f["id"] == "lengths-in-one-ratio");
        of.and_then(|f| f["facts"]["scale"]["value"].as_f64())
    };
    for (seed, scale) in [(1, 1.01), (2, 0.992), (3, 1.02), (4, 0.98)] {
        let found = scaled(scale, seed).unwrap_or_else(|| panic!("{seed}: not named"));
        assert!((found - (scale - 1.0)).abs() < 3e-3, "{seed}: {found}");
    }
    for seed in 5..13 {
        assert_eq!(scaled(1.0, seed), None, "{seed}");
    }
}
