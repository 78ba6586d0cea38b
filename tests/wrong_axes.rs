//! Wrong axes in the URDF of a hand: links of a few centimeters, where errors of a centimeter and a degree explain as much as an axis that is off by 90°.

use crate::scratch;

use std::fmt::Write as _;

use calib_urdf::RobotModel;
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use scratch::Scratch;
use serde_json::Value;

/// σ of one coordinate, m.
const SIGMA: f64 = 2e-4;
const FINGERS: [&str; 3] = ["f1", "f2", "f3"];
/// Name, place in the link before, m, axis and range, rad.
const JOINTS: [(&str, [f64; 3], &str, [f64; 2]); 3] = [
    ("abd", [0.07, 0.0, 0.0], "0 0 1", [-0.4, 0.4]),
    ("prox", [0.015, 0.0, 0.0], "0 1 0", [0.0, 1.5]),
    ("mid", [0.045, 0.0, 0.0], "0 1 0", [0.0, 1.5]),
];
const PALM: [[f64; 3]; 4] = [
    [0.0, 0.03, 0.01],
    [-0.04, -0.03, 0.012],
    [0.02, -0.04, 0.03],
    [-0.02, 0.01, 0.05],
];
const TIP: [[f64; 3]; 4] = [
    [0.024, 0.002, 0.007],
    [0.01, 0.009, 0.004],
    [0.012, -0.008, 0.005],
    [0.004, 0.0, 0.013],
];

#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Tip {
    Markers(usize),
    Pose,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Design {
    Random,
    /// One joint after the other.
    Sweeps,
}

/// The hand, each place and each frame off by what `rng` says, with another axis of the joints that are `wrong`.
fn urdf(mut rng: Option<ChaCha8Rng>, wrong: &[(&str, &str)]) -> String {
    let mut text = "<robot name=\"hand\">\n  <link name=\"palm\"/>\n".to_owned();
    for (n, finger) in FINGERS.iter().enumerate() {
        let mut parent = "palm".to_owned();
        for (k, (joint, at, axis, _)) in JOINTS.iter().enumerate() {
            let name = format!("{finger}_{joint}");
            let mut off = |size: f64| rng.as_mut().map_or(0.0, |rng| size * normal(rng));
            let [mut x, y, z] = at.map(|c| c + off(2e-4));
            let y = y + if k == 0 {
                0.035 * (n as f64 - 1.0)
            } else {
                0.0
            };
            // Fingers are not all alike.
            x *= 1.0 + 0.1 * n as f64;
            let [a, b, c] = [(); 3].map(|()| off(3e-3));
            let stated = wrong.iter().find(|(of, _)| *of == name);
            let axis = stated.map_or(*axis, |(_, axis)| *axis);
            let _ = writeln!(
                text,
                "  <link name=\"{name}_link\"/>\n  <joint name=\"{name}\" type=\"revolute\">\n    <parent link=\"{parent}\"/>\n    <child link=\"{name}_link\"/>\n    \
                 <origin xyz=\"{x} {y} {z}\" rpy=\"{a} {b} {c}\"/>\n    <axis xyz=\"{axis}\"/>\n    <limit lower=\"-7\" upper=\"7\" effort=\"1\" velocity=\"1\"/>\n  </joint>"
            );
            parent = format!("{name}_link");
        }
    }
    text + "</robot>\n"
}

fn normal(rng: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(rng)
}

fn postures(design: Design, rng: &mut ChaCha8Rng) -> Vec<Vec<f64>> {
    let ranges: Vec<[f64; 2]> = FINGERS.iter().flat_map(|_| JOINTS.map(|j| j.3)).collect();
    let mut random = || -> Vec<f64> {
        let all = ranges.iter();
        all.map(|[low, high]| rng.random_range(*low..*high))
            .collect()
    };
    if design == Design::Random {
        return (0..40).map(|_| random()).collect();
    }
    let home = random();
    let sweep = |joint: usize| {
        let ([low, high], home) = (ranges[joint], home.clone());
        (0..9).map(move |k| {
            let mut q = home.clone();
            q[joint] = low + (high - low) * f64::from(k) / 8.0;
            q
        })
    };
    (0..ranges.len()).flat_map(sweep).collect()
}

/// A table of the robot; `moves` is what the joints do where they read `q`.
fn table(
    robot: &RobotModel,
    tip: Tip,
    postures: &[Vec<f64>],
    moves: &dyn Fn(&mut [f64]),
    rng: &mut ChaCha8Rng,
) -> String {
    let tracker_from_root = Isometry3::from_parts(
        Translation3::new(0.9, 0.3, 0.1),
        UnitQuaternion::from_euler_angles(0.1, -0.2, 0.7),
    );
    let mount = Isometry3::from_parts(
        Translation3::new(0.02, 0.004, 0.009),
        UnitQuaternion::from_euler_angles(1.1, -0.4, 0.6),
    );
    let joints = robot.joints().iter();
    let mut header: Vec<String> = joints.map(|j| format!("{}_rad", j.name)).collect();
    let xyz = |name: String| ["x", "y", "z"].map(|c| format!("{name}.{c}_m"));
    header.extend((1..=4).flat_map(|k| xyz(format!("p{k}"))));
    for finger in FINGERS {
        match tip {
            Tip::Markers(n) => header.extend((1..=n).flat_map(|k| xyz(format!("{finger}t{k}")))),
            Tip::Pose => {
                header.extend(xyz(format!("t_{finger}")));
                header.extend(["qx", "qy", "qz", "qw"].map(|c| format!("t_{finger}.{c}")));
            }
        }
    }
    let mut text = header.join(",") + "\n";
    for read in postures {
        let mut q = read.clone();
        moves(&mut q);
        let at = |link: &str| {
            let link = robot.link_id(link).expect("there");
            tracker_from_root * robot.root_from_link(&q, link)
        };
        let mut cells: Vec<f64> = read.clone();
        let mut seen = |point: Vector3<f64>, cells: &mut Vec<f64>| {
            cells.extend(point.iter().map(|c| c + SIGMA * normal(rng)));
        };
        for p in PALM {
            seen((at("palm") * Point3::from(p)).coords, &mut cells);
        }
        for finger in FINGERS {
            let link = at(&format!("{finger}_mid_link"));
            match tip {
                Tip::Markers(n) => TIP[..n]
                    .iter()
                    .for_each(|p| seen((link * Point3::from(*p)).coords, &mut cells)),
                Tip::Pose => {
                    let pose = link * mount;
                    seen(pose.translation.vector, &mut cells);
                    let mut turn = Vec::new();
                    seen(Vector3::zeros(), &mut turn);
                    // 0.17° at 0.2 mm.
                    let turn = Vector3::from_iterator(turn) * 15.0;
                    let turned = pose.rotation * UnitQuaternion::from_scaled_axis(turn);
                    cells.extend(turned.coords.iter());
                }
            }
        }
        let cells: Vec<String> = cells.iter().map(|v| format!("{v:.7}")).collect();
        text += &(cells.join(",") + "\n");
    }
    text
}

/// A folder with the hand's profile `hand.yaml`, its URDF and recordings.
pub fn hand(
    tip: Tip,
    design: Design,
    wrong: &[(&str, &str)],
    moves: &dyn Fn(&mut [f64]),
    seed: u64,
) -> Scratch {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let robot = urdf(Some(ChaCha8Rng::seed_from_u64(seed + 100)), &[]);
    let robot = RobotModel::from_urdf_text(&robot, "hand").expect("a hand");
    let poses = postures(design, &mut rng);
    let checks: Vec<_> = postures(Design::Random, &mut rng).drain(..12).collect();
    let body = |finger: &str| match tip {
        Tip::Markers(n) => {
            let markers: Vec<String> = (1..=n).map(|k| format!("{finger}t{k}")).collect();
            format!(
                "t_{finger}: {{link: {finger}_mid_link, markers: [{}]}}",
                markers.join(", ")
            )
        }
        Tip::Pose => format!("t_{finger}: {{link: {finger}_mid_link, pose: true}}"),
    };
    let bodies = FINGERS.map(body).join("\n  ");
    Scratch::new()
        .file("hand.urdf", urdf(None, wrong))
        .file("poses.csv", table(&robot, tip, &poses, moves, &mut rng))
        .file("checks.csv", table(&robot, tip, &checks, moves, &mut rng))
        .file(
            "hand.yaml",
            format!(
                "calib: 1\nrobot: {{name: hand, urdf: hand.urdf}}\ntracker: {{frame: lab, marker_sigma_mm: 0.2}}\nbodies:\n  palm: {{link: palm, markers: [p1, p2, p3, p4]}}\n  \
                 {bodies}\nrecordings:\n  poses: {{file: poses.csv, use: static}}\n  checks: {{file: checks.csv, use: validation}}\n\
                 solve:\n  free: [bodies, tracker, joint_offsets, joint_axes]\n"
            ),
        )
}

/// Findings of `calib check` that are more than information.
fn named(
    tip: Tip,
    design: Design,
    wrong: &[(&str, &str)],
    moves: &dyn Fn(&mut [f64]),
    seed: u64,
) -> Vec<Value> {
    let dir = hand(tip, design, wrong, moves, seed);
    let ran = dir.calib(["check", "hand.yaml", "--json"]);
    let report: Value = serde_json::from_str(&ran.stdout).expect("JSON");
    let all = report["findings"].as_array().expect("a list").iter();
    let of_model = |f: &&Value| f["severity"] != "info" && f["id"] != "row-outlier";
    all.filter(of_model).cloned().collect()
}

/// (joint, axis) of findings that are all about axes.
fn axes(findings: &[Value]) -> Vec<(String, String)> {
    let text = |f: &Value, key: &str| f["facts"][key].as_str().unwrap_or("none").to_owned();
    let axis = |f: &Value| {
        assert_eq!(f["id"], "joint-axis", "{findings:#?}");
        (text(f, "joint"), text(f, "axis"))
    };
    let mut axes: Vec<_> = findings.iter().map(axis).collect();
    axes.sort();
    axes
}

fn as_read(_: &mut [f64]) {}

const TIPS: [Tip; 3] = [Tip::Markers(1), Tip::Markers(4), Tip::Pose];
const DESIGNS: [Design; 2] = [Design::Random, Design::Sweeps];

#[test]
fn an_axis_of_a_finger_is_named_and_nothing_else() {
    let faults = [
        ("f2_abd", "1 0 0", "0 0 1"),
        ("f2_prox", "0 0 1", "0 1 0"),
        ("f2_mid", "1 0 0", "0 1 0"),
        ("f2_mid", "0 0 1", "0 1 0"),
    ];
    for tip in TIPS {
        for design in DESIGNS {
            for (joint, stated, real) in faults {
                let found = named(tip, design, &[(joint, stated)], &as_read, 1);
                let real = (joint.to_owned(), real.to_owned());
                assert_eq!(axes(&found), [real], "{tip:?} {design:?} {joint} {stated}");
            }
        }
    }
}

/// A macro of a URDF writes the same mistake into every finger.
#[test]
fn the_same_wrong_axis_in_every_finger_is_named_in_all() {
    let wrong = [
        ("f1_mid", "0 0 1"),
        ("f2_mid", "0 0 1"),
        ("f3_mid", "0 0 1"),
    ];
    let real = wrong.map(|(joint, _)| (joint.to_owned(), "0 1 0".to_owned()));
    for tip in TIPS {
        for design in DESIGNS {
            let found = named(tip, design, &wrong, &as_read, 2);
            assert_eq!(axes(&found), real, "{tip:?} {design:?}");
        }
    }
    // Two of three, which are less than half of the residual each.
    for tip in TIPS {
        let found = named(tip, Design::Random, &wrong[..2], &as_read, 3);
        assert_eq!(axes(&found), real[..2], "{tip:?}");
    }
}

#[test]
fn a_finger_that_is_right_is_given_no_name_and_a_coupling_its_own() {
    for tip in TIPS {
        for design in DESIGNS {
            let found = named(tip, design, &[], &as_read, 4);
            assert!(found.is_empty(), "{tip:?} {design:?}: {found:#?}");
            let coupled = |q: &mut [f64]| q[5] += q[4];
            let found = named(tip, design, &[], &coupled, 5);
            let [found] = &found[..] else {
                panic!("{tip:?} {design:?}: {found:#?}");
            };
            assert_eq!(found["id"], "joint-coupling", "{tip:?} {design:?}");
            assert_eq!(found["facts"]["joint"], "f2_mid", "{tip:?} {design:?}");
        }
    }
}
