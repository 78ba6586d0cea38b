//! A torso with two arms, and a column of one arm that stays at its last value from the middle on.

use crate::scratch;

use calib_urdf::RobotModel;
use nalgebra::{Isometry3, Translation3, UnitQuaternion};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use scratch::Scratch;

/// Axis and origin of the joints of each arm, m.
const ARM: [(&str, [f64; 3]); 6] = [
    ("0 1 0", [0.0, 0.0, 0.1]),
    ("1 0 0", [0.05, 0.0, 0.0]),
    ("0 0 1", [0.0, 0.0, -0.25]),
    ("0 1 0", [0.02, 0.0, -0.05]),
    ("0 0 1", [0.0, 0.0, -0.22]),
    ("1 0 0", [0.0, 0.03, -0.06]),
];

/// The robot with every origin off by up to this much, m and rad.
pub fn torso(error: f64, seed: u64) -> String {
    torso_with(error, seed, ("", [0.0; 3]))
}

/// The same where the origin of one joint moved.
pub fn torso_with(error: f64, seed: u64, (moved, by): (&str, [f64; 3])) -> String {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut text = "<robot name=\"torso\">\n  <link name=\"base\"/>\n".to_owned();
    let mut joint = |name: &str, parent: &str, axis: &str, origin: [f64; 3]| {
        let mut off = || -> f64 { error * rng.random_range(-1.0..1.0) };
        let mut at = origin.map(|c| c + off());
        if name == moved {
            at.iter_mut().zip(by).for_each(|(c, by)| *c += by);
        }
        let [x, y, z] = at;
        let [r, p, w] = [off(), off(), off()];
        text += &format!(
            "  <link name=\"{name}_link\"/>\n  <joint name=\"{name}\" type=\"revolute\">\n    <parent link=\"{parent}\"/>\n    <child link=\"{name}_link\"/>\n    \
             <origin xyz=\"{x} {y} {z}\" rpy=\"{r} {p} {w}\"/>\n    <axis xyz=\"{axis}\"/>\n    <limit lower=\"-3\" upper=\"3\" effort=\"1\" velocity=\"2\"/>\n  </joint>\n"
        );
    };
    joint("waist", "base", "0 0 1", [0.0, 0.0, 0.3]);
    for (side, y) in [("left", 0.2), ("right", -0.2)] {
        let mut parent = "waist_link".to_owned();
        for (k, (axis, mut origin)) in ARM.into_iter().enumerate() {
            if k == 0 {
                origin = [0.0, y, 0.4];
            }
            let name = format!("{side}_{}", k + 1);
            joint(&name, &parent, axis, origin);
            parent = format!("{name}_link");
        }
    }
    text + "</robot>\n"
}

/// What is special about a table.
#[derive(Clone, Copy)]
pub struct Special<'a> {
    /// A column that stays from the middle on.
    pub frozen: Option<&'a str>,
    /// σ of the readings, rad.
    pub joint_noise: f64,
    /// A joint that stands further than it is read, rad.
    pub zero: (&'a str, f64),
    /// A body that is elsewhere on its link, along its x axis, m.
    pub body: (&'a str, f64),
    /// How far the tracker moved along its x axis, m.
    pub tracker: f64,
}

impl Special<'_> {
    pub const NOTHING: Self = Self {
        frozen: None,
        joint_noise: 0.0,
        zero: ("", 0.0),
        body: ("", 0.0),
        tracker: 0.0,
    };
}

/// A table whose column of `frozen` stays from the middle on.
fn table(robot: &RobotModel, frozen: Option<&str>, rows: usize, seed: u64) -> String {
    let special = Special {
        frozen,
        ..Special::NOTHING
    };
    table_with(robot, &special, rows, seed)
}

/// Random postures of both arms, with three bodies.
pub fn table_with(robot: &RobotModel, special: &Special<'_>, rows: usize, seed: u64) -> String {
    let frozen = special.frozen;
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let tracker_from_root = Isometry3::from_parts(
        Translation3::new(0.9, 0.3, 0.1),
        UnitQuaternion::from_euler_angles(0.02, -0.03, 0.7),
    );
    let names = robot.joints().iter().map(|joint| joint.name.clone());
    let names: Vec<String> = names.collect();
    let bodies = [
        ("lw", "left_6_link"),
        ("rw", "right_6_link"),
        ("chest", "waist_link"),
    ];
    let mut header: Vec<String> = names.iter().map(|name| format!("{name}_rad")).collect();
    for (body, _) in bodies {
        header.extend(["x_m", "y_m", "z_m", "qx", "qy", "qz", "qw"].map(|c| format!("{body}.{c}")));
    }
    let mut text = header.join(",") + "\n";
    let mut held = 0.0;
    for row in 0..rows {
        let q: Vec<f64> = names.iter().map(|_| rng.random_range(-1.2..1.2)).collect();
        let mut read = q.clone();
        if let Some(at) = names.iter().position(|name| Some(name.as_str()) == frozen) {
            if row < rows / 2 {
                held = q[at];
            }
            read[at] = held;
        }
        let mut cells: Vec<String> = read.iter().map(|q| format!("{q:.6}")).collect();
        let mut stands = q.clone();
        for (q, name) in stands.iter_mut().zip(&names) {
            if special.joint_noise > 0.0 {
                let n: f64 = StandardNormal.sample(&mut rng);
                *q += special.joint_noise * n;
            }
            if name == special.zero.0 {
                *q += special.zero.1;
            }
        }
        for (body, link) in bodies {
            let mut noise = |sigma: f64| {
                let n: f64 = StandardNormal.sample(&mut rng);
                sigma * n
            };
            let noise = Isometry3::from_parts(
                Translation3::new(noise(2e-4), noise(2e-4), noise(2e-4)),
                UnitQuaternion::from_euler_angles(noise(1e-3), noise(1e-3), noise(1e-3)),
            );
            let by = if body == special.body.0 {
                special.body.1
            } else {
                0.0
            };
            let seen = Translation3::new(special.tracker, 0.0, 0.0)
                * tracker_from_root
                * robot.root_from_link(&stands, robot.link_id(link).expect("there"))
                * Translation3::new(by, 0.0, 0.0)
                * noise;
            let values = seen
                .translation
                .vector
                .iter()
                .chain(seen.rotation.coords.iter());
            cells.extend(values.map(|v| format!("{v:.7}")));
        }
        text += &(cells.join(",") + "\n");
    }
    text
}

/// `calib init` puts each body on its own arm, and the column is named; it put a body on the other arm beside the words "0.0 times as much".
#[test]
fn a_column_that_stays_does_not_put_a_body_on_the_other_arm() {
    for (frozen, seed) in [("right_3", 1), ("right_2", 2), ("left_3", 5), ("left_2", 3)] {
        let robot = RobotModel::from_urdf_text(&torso(4e-3, seed), "torso").expect("a robot");
        let dir = Scratch::new()
            .file("torso.urdf", torso(0.0, 0))
            .file("poses.csv", table(&robot, Some(frozen), 50, seed + 10))
            .file("checks.csv", table(&robot, None, 20, seed + 20));
        let said = dir.calib([
            "init",
            "torso.urdf",
            "poses.csv",
            "checks.csv",
            "-o",
            "torso.yaml",
        ]);
        let profile = dir.read("torso.yaml");
        for line in [
            "lw: {link: left_6_link",
            "rw: {link: right_6_link",
            "chest: {link: waist_link",
        ] {
            assert!(profile.contains(line), "{frozen}: {profile}");
        }
        let words = said.words();
        assert!(words.contains(&format!("`{frozen}`")), "{words}");
    }
}
