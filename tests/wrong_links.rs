//! Recordings in which a body seems to be on another link than it is: a joint that stood while its values change, and a column in another unit.

use crate::computed::arm;
use crate::scratch::Scratch;

use calib_urdf::RobotModel;
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// σ of one marker coordinate, m.
const MARKER: f64 = 2e-4;
const TOOL: [[f64; 3]; 3] = [[0.05, 0.0, 0.1], [0.02, 0.08, 0.08], [0.0, 0.03, 0.14]];
const BASE: [[f64; 3]; 3] = [[0.2, 0.1, 0.0], [0.3, 0.0, 0.05], [0.25, -0.1, 0.1]];

/// What is wrong with a joint, from 0.
#[derive(Clone, Copy)]
enum Fault {
    Nothing,
    /// It stood, and its column says that it moved.
    Stood(usize),
    /// Its column is in rad under the name of one in degrees.
    InRadians(usize),
}

/// Joints in degrees, markers on the last link and on the base.
fn table(robot: &RobotModel, fault: Fault, n: usize, seed: u64) -> String {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let link = robot.link_id("l6").expect("there");
    let tracker_from_root = Isometry3::from_parts(
        Translation3::new(0.9, 0.3, 0.1),
        UnitQuaternion::from_euler_angles(0.02, -0.03, 0.7),
    );
    let mut text = (1..=6).map(|j| format!("j{j}_deg,")).collect::<String>();
    let markers = ["tool", "foot"].iter();
    let markers = markers.flat_map(|body| (1..=3).map(move |m| format!("{body}_{m}")));
    let names = markers.flat_map(|m| ["x", "y", "z"].map(|axis| format!("{m}.{axis}_mm")));
    text += &names.collect::<Vec<_>>().join(",");
    for _ in 0..n {
        let mut q: Vec<f64> = (0..6).map(|_| rng.random_range(-1.5..1.5)).collect();
        let mut cells: Vec<String> = q.iter().map(|q| format!("{:.3}", q.to_degrees())).collect();
        match fault {
            Fault::Nothing => {}
            Fault::Stood(joint) => q[joint] = 0.3,
            Fault::InRadians(joint) => cells[joint] = format!("{:.5}", q[joint]),
        }
        let root_from_link = robot.root_from_link(&q, link);
        let tool = TOOL.map(|p| root_from_link * Point3::from(p));
        for point in tool.into_iter().chain(BASE.map(Point3::from)) {
            let seen = tracker_from_root * point;
            cells.extend(seen.iter().map(|v| {
                let n: f64 = StandardNormal.sample(&mut rng);
                format!("{:.3}", (v + MARKER * n) * 1e3)
            }));
        }
        text += "\n";
        text += &cells.join(",");
    }
    text + "\n"
}

/// What `calib init` writes and says, and the code of `calib run`.
fn read(fault: Fault, seed: u64) -> (String, String, i32) {
    let robot = RobotModel::from_urdf_text(&arm(4e-3, seed), "arm").expect("an arm");
    let dir = Scratch::new()
        .file("arm.urdf", arm(0.0, 0))
        .file("poses.csv", table(&robot, fault, 40, seed + 1))
        .file("checks.csv", table(&robot, fault, 15, seed + 2));
    let said = dir.calib([
        "init",
        "arm.urdf",
        "poses.csv",
        "checks.csv",
        "-o",
        "arm.yaml",
    ]);
    let ran = dir.calib(["run", "arm.yaml", "--out", "out"]);
    (dir.read("arm.yaml"), said.words(), ran.code)
}

/// The body follows the link before the joint as well as its own: which of the two carries it is for a person to say.
#[test]
fn a_joint_that_stood_while_its_values_change_is_one_to_check() {
    for seed in 1..=3 {
        let (profile, words, _) = read(Fault::Stood(5), seed);
        let says = "The values of `j6` change, and no body moves with it. If `tool` is mounted beyond it, the joint stood still";
        let checks = words.split("To check").nth(1).expect("something to check");
        assert!(checks.contains(says), "{seed}: {words}");
        assert!(profile.contains("{link: l5, markers: [tool"), "{profile}");
        let (_, words, code) = read(Fault::Nothing, seed);
        assert!(!words.contains("no body moves"), "{seed}: {words}");
        assert_eq!(code, 0, "{seed}");
    }
}

/// On a link that it does not follow, a body is registered at any distance, and from there a degree explained a third of a meter: the recordings agreed.
#[test]
fn a_column_in_another_unit_does_not_put_a_body_far_from_another_link() {
    for seed in 1..=6 {
        for joint in [0, 1, 2, 4] {
            let (profile, words, code) = read(Fault::InRadians(joint), seed);
            let name = format!("j{}", joint + 1);
            let says = format!("The column of `{name}` is in rad. Corrected");
            assert!(words.contains(&says), "{seed} {name}: {words}");
            assert!(profile.contains("{link: l6, markers: [tool"), "{profile}");
            assert_eq!(code, 0, "{seed} {name}: {words}");
        }
    }
}
