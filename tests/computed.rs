//! Columns that a controller computed from its joints, beside those of a tracker: left out by `calib init`, named by `calib check`.

use crate::scratch;

use calib_urdf::RobotModel;
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use scratch::Scratch;

/// σ of one marker coordinate, m.
const MARKER: f64 = 2e-4;
const TOOL: [[f64; 3]; 4] = [
    [0.05, 0.0, 0.1],
    [0.12, 0.01, 0.06],
    [0.02, 0.08, 0.08],
    [0.0, 0.03, 0.14],
];

/// Axis and origin of each joint, m.
const JOINTS: [(&str, [f64; 3]); 6] = [
    ("0 0 1", [0.0, 0.0, 0.32]),
    ("0 1 0", [0.05, 0.07, 0.1]),
    ("0 1 0", [0.0, -0.03, 0.45]),
    ("0 0 1", [0.04, 0.0, 0.25]),
    ("0 1 0", [0.0, 0.0, 0.22]),
    ("0 0 1", [0.0, 0.0, 0.09]),
];

/// The arm with every origin off by a vector of this size, m, and its axes by as many rad.
pub fn arm(error: f64, seed: u64) -> String {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut text = "<robot name=\"arm\">\n  <link name=\"l0\"/>\n".to_owned();
    for (i, (axis, origin)) in JOINTS.iter().enumerate() {
        let mut off = || -> f64 { error * rng.random_range(-1.0..1.0) };
        let [x, y, z] = origin.map(|c| c + off());
        let [r, p, w] = [off(), off(), off()];
        text += &format!(
            "  <link name=\"l{n}\"/>\n  <joint name=\"j{n}\" type=\"revolute\">\n    <parent link=\"l{i}\"/>\n    <child link=\"l{n}\"/>\n    \
             <origin xyz=\"{x} {y} {z}\" rpy=\"{r} {p} {w}\"/>\n    <axis xyz=\"{axis}\"/>\n    <limit lower=\"-3\" upper=\"3\" effort=\"50\" velocity=\"2\"/>\n  </joint>\n",
            n = i + 1
        );
    }
    text + "</robot>\n"
}

/// A table with the joints, the tool as `controller` computes it, to so many decimals of a millimeter, and the markers of `robot`.
fn table(
    robot: &RobotModel,
    controller: &RobotModel,
    decimals: usize,
    n: usize,
    seed: u64,
) -> String {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let tracker_from_root = Isometry3::from_parts(
        Translation3::new(0.9, 0.3, 0.1),
        UnitQuaternion::from_euler_angles(0.02, -0.03, 0.7),
    );
    let link = robot.link_id("l6").expect("there");
    let mut text = "j1_deg,j2_deg,j3_deg,j4_deg,j5_deg,j6_deg,X,Y,Z,A,B,C".to_owned();
    for k in 1..=4 {
        text += &format!(",t_{k}.x_mm,t_{k}.y_mm,t_{k}.z_mm");
    }
    for _ in 0..n {
        let degrees: Vec<f64> = (0..6)
            .map(|_| f64::from(rng.random_range(-90_000_i32..90_000)) / 1e3)
            .collect();
        let q: Vec<f64> = degrees.iter().map(|d| d.to_radians()).collect();
        let root_from_tool =
            controller.root_from_link(&q, link) * Translation3::new(0.0, 0.0, 0.15);
        let tracker_from_link = tracker_from_root * robot.root_from_link(&q, link);
        let mut cells: Vec<String> = degrees.iter().map(|d| format!("{d:.3}")).collect();
        let tool = root_from_tool.translation.vector.iter();
        cells.extend(tool.map(|v| format!("{:.decimals$}", v * 1e3)));
        let (roll, pitch, yaw) = root_from_tool.rotation.euler_angles();
        cells.extend([yaw, pitch, roll].map(|a| format!("{:.3}", a.to_degrees())));
        for marker in TOOL {
            let noise = Vector3::from_fn(|_, _| {
                let n: f64 = StandardNormal.sample(&mut rng);
                MARKER * n
            });
            let seen = (tracker_from_link * Point3::from(marker)).coords + noise;
            cells.extend(seen.iter().map(|v| format!("{:.4}", v * 1e3)));
        }
        text += "\n";
        text += &cells.join(",");
    }
    text + "\n"
}

/// The nominal arm with tables of a real one, and of a controller whose model is off by `error`.
fn recorded(error: f64, decimals: usize, seed: u64) -> Scratch {
    let model = |text: &str| RobotModel::from_urdf_text(text, "arm").expect("an arm");
    let robot = model(&arm(2e-3, seed));
    let controller = model(&arm(error, seed + 100));
    Scratch::new()
        .file("arm.urdf", arm(0.0, 0))
        .file("poses.csv", table(&robot, &controller, decimals, 40, seed))
        .file(
            "checks.csv",
            table(&robot, &controller, decimals, 12, seed + 200),
        )
}

const PROFILE: &str = "calib: 1
robot: {name: arm, urdf: arm.urdf}
tracker: {frame: lab, marker_sigma_mm: 0.2}
bodies:
  tool: {link: l6, markers: [t_1, t_2, t_3, t_4]}
  flange: {link: l6, markers: [f]}
recordings:
  poses: {file: poses.csv, use: static, columns: &map {joints: {j1: j1_deg, j2: j2_deg, j3: j3_deg, j4: j4_deg, j5: j5_deg, j6: j6_deg}, lengths: mm, markers: \
{f: [X, \"Y\", Z], t_1: [t_1.x_mm, t_1.y_mm, t_1.z_mm], t_2: [t_2.x_mm, t_2.y_mm, t_2.z_mm], t_3: [t_3.x_mm, t_3.y_mm, t_3.z_mm], t_4: [t_4.x_mm, t_4.y_mm, t_4.z_mm]}}}
  checks: {file: checks.csv, use: validation, columns: *map}
solve:
  free: [bodies, tracker, joint_offsets, joint_axes]
  limits: {held_out_rms_mm: 1}
";

#[test]
fn init_leaves_out_what_a_controller_computed() {
    for (decimals, seed) in [(3, 1), (2, 2), (1, 3)] {
        let dir = recorded(0.0, decimals, seed);
        let said = dir.calib([
            "init",
            "arm.urdf",
            "poses.csv",
            "checks.csv",
            "-o",
            "arm.yaml",
        ]);
        let words = said.words();
        assert!(
            words.contains("`X`, `Y`, `Z`, `A`, `B` and `C` are left out"),
            "{words}"
        );
        assert!(!words.contains("Euler"), "{words}");
        let ran = dir.calib(["run", "arm.yaml", "--out", "out"]);
        assert_eq!(ran.code, 0, "{decimals}: {}{}", ran.stdout, ran.stderr);
    }
}

#[test]
fn the_body_that_a_controller_computed_is_named() {
    for seed in [11, 12, 13] {
        // The nominal arm, and one of the controller's own.
        for (error, decimals, id, kind) in [
            (0.0, 2, "not-measured", "body"),
            (0.0, 1, "not-measured", "body"),
            (3e-4, 3, "model-disagrees", "frames"),
        ] {
            let dir = recorded(error, decimals, seed).file("arm.yaml", PROFILE);
            let checked = dir.calib(["check", "arm.yaml", "--json"]);
            assert_eq!(checked.code, 3);
            let json = checked.json();
            let all = json["findings"].as_array().expect("a list");
            let errors: Vec<_> = all.iter().filter(|f| f["severity"] == "error").collect();
            let [one] = errors.as_slice() else {
                panic!("{seed} {id}: {errors:#?}");
            };
            assert_eq!(
                (&one["id"], &one["facts"]["kind"]),
                (&id.into(), &kind.into())
            );
            assert_eq!(one["facts"]["body"], "flange");
            // The remedy works.
            let dir = dir
                .edit("arm.yaml", "  flange: {link: l6, markers: [f]}\n", "")
                .edit("arm.yaml", "f: [X, \"Y\", Z], ", "");
            let ran = dir.calib(["run", "arm.yaml", "--out", "out"]);
            assert_eq!(ran.code, 0, "{seed}: {}{}", ran.stdout, ran.stderr);
        }
    }
}

/// A table with the joints and one point behind the last, seen with noise, m, and written with so many decimals of a millimeter.
pub fn points(robot: &RobotModel, noise: f64, decimals: usize, n: usize, seed: u64) -> String {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let link = robot.link_id("l6").expect("there");
    let mut text = "j1_deg,j2_deg,j3_deg,j4_deg,j5_deg,j6_deg,X_mm,Y_mm,Z_mm".to_owned();
    for _ in 0..n {
        let q: Vec<f64> = (0..6).map(|_| rng.random_range(-1.5..1.5)).collect();
        let mut cells: Vec<String> = q.iter().map(|q| format!("{:.3}", q.to_degrees())).collect();
        let at = robot.root_from_link(&q, link) * Point3::new(0.02, -0.01, 0.15);
        cells.extend(at.iter().map(|v| {
            let n: f64 = StandardNormal.sample(&mut rng);
            format!("{:.decimals$}", (v + noise * n) * 1e3)
        }));
        text += "\n";
        text += &cells.join(",");
    }
    text + "\n"
}

/// The code of `calib run` of what `calib init` makes of such tables, and the kinds of `not-measured` that it names.
fn alone(error: f64, noise: f64, decimals: usize, seed: u64) -> (i32, Vec<String>) {
    let robot = RobotModel::from_urdf_text(&arm(error, seed), "arm").expect("an arm");
    let dir = Scratch::new()
        .file("arm.urdf", arm(0.0, 0))
        .file("poses.csv", points(&robot, noise, decimals, 60, seed + 1))
        .file("checks.csv", points(&robot, noise, decimals, 15, seed + 2));
    dir.calib([
        "init",
        "arm.urdf",
        "poses.csv",
        "checks.csv",
        "-o",
        "arm.yaml",
    ]);
    let dir = dir.edit(
        "arm.yaml",
        "# limits: {held_out_rms_mm: 1}",
        "limits: {held_out_rms_mm: 1}",
    );
    let ran = dir.calib(["run", "arm.yaml", "--out", "out", "--json"]);
    // A run that stops before the fit says what `check` says.
    let json = match ran.code {
        3 => dir.calib(["check", "arm.yaml", "--json"]).json(),
        _ => ran.json(),
    };
    let all = json["findings"].as_array().cloned().unwrap_or_default();
    let of = all.iter().filter(|f| f["id"] == "not-measured");
    let kinds = of.map(|f| f["facts"]["kind"].as_str().unwrap_or("").to_owned());
    (ran.code, kinds.collect())
}

/// Nothing but the decimals of the file is left of the position that a controller shows, and nobody else measured.
#[test]
fn what_a_controller_computed_is_named_where_it_stands_alone() {
    for (decimals, seed) in [(1, 41), (2, 42), (1, 43), (2, 44)] {
        // With the model of the URDF nothing is left to calibrate.
        let (code, kinds) = alone(0.0, 0.0, decimals, seed);
        assert_eq!((code, kinds), (3, vec!["all".to_owned()]), "{decimals}");
        // A controller that knows its own calibration.
        let (code, kinds) = alone(2e-3, 0.0, decimals, seed);
        assert_eq!((code, kinds), (0, vec!["fitted".to_owned()]), "{decimals}");
    }
}

/// A tracker that scatters by half a step of the file, and by five.
#[test]
fn what_a_tracker_measured_is_not_called_computed() {
    for (decimals, noise) in [(1, 5e-5), (2, 5e-5), (3, 1e-5)] {
        for seed in 51..55 {
            let (code, kinds) = alone(1e-3, noise, decimals, seed);
            assert_eq!((code, kinds), (0, vec![]), "{decimals}: {seed}");
        }
    }
}

/// A marker behind a single joint moves on a circle, whatever the robot is: it fits as closely as a precise tracker measures, and was measured.
#[test]
fn a_body_behind_one_joint_that_a_precise_tracker_saw_is_a_measurement() {
    const PRECISE: f64 = 1e-5;
    let robot = RobotModel::from_urdf_text(&arm(2e-3, 21), "arm").expect("an arm");
    let [first, last] = ["l1", "l6"].map(|link| robot.link_id(link).expect("there"));
    let table = |n: usize, seed: u64| {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut text = "j1_deg,j2_deg,j3_deg,j4_deg,j5_deg,j6_deg".to_owned();
        for name in ["b", "t_1", "t_2", "t_3", "t_4"] {
            text += &format!(",{name}.x_mm,{name}.y_mm,{name}.z_mm");
        }
        for _ in 0..n {
            let q: Vec<f64> = (0..6).map(|_| rng.random_range(-1.5..1.5)).collect();
            let mut cells: Vec<String> =
                q.iter().map(|q| format!("{:.9}", q.to_degrees())).collect();
            let on = [first, last, last, last, last];
            for (link, marker) in on.iter().zip([[0.2, 0.1, 0.0]].iter().chain(&TOOL)) {
                let place = robot.root_from_link(&q, *link) * Point3::from(*marker);
                cells.extend(place.iter().map(|v| {
                    let n: f64 = StandardNormal.sample(&mut rng);
                    format!("{:.6}", (v + PRECISE * n) * 1e3)
                }));
            }
            text += "\n";
            text += &cells.join(",");
        }
        text + "\n"
    };
    let (_, rest) = PROFILE.split_once("solve:").expect("a block");
    let profile = format!(
        "calib: 1\nrobot: {{name: arm, urdf: arm.urdf}}\ntracker: {{frame: lab}}\nbodies:\n  tool: {{link: l6, markers: [t_1, t_2, t_3, t_4]}}\n  \
         base: {{link: l1, markers: [b]}}\nrecordings:\n  poses: {{file: poses.csv, use: static}}\n  checks: {{file: checks.csv, use: validation}}\nsolve:{rest}"
    );
    let dir = Scratch::new()
        .file("arm.urdf", arm(0.0, 0))
        .file("poses.csv", table(40, 31))
        .file("checks.csv", table(12, 32))
        .file("arm.yaml", &profile);
    let checked = dir.calib(["check", "arm.yaml"]);
    assert_eq!(checked.code, 0, "{}", checked.stdout);
    let said = dir.calib([
        "init",
        "arm.urdf",
        "poses.csv",
        "checks.csv",
        "-o",
        "first.yaml",
    ]);
    assert!(!said.words().contains("left out"), "{}", said.words());
    let ran = dir.calib(["run", "arm.yaml", "--out", "out"]);
    assert_eq!(ran.code, 0, "{}{}", ran.stdout, ran.stderr);
}
