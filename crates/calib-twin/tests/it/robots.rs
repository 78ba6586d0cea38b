//! Robots in memory with simulated recordings.

use std::fmt::Write as _;
use std::path::PathBuf;

use calib_pipeline::options::Plugins;
use calib_pipeline::prepare::inputs::{Inputs, RobotProfile, Written};
use calib_pipeline::prepare::load::of_tables;
use calib_pipeline::prepare::loads::Masses;
use calib_twin::nalgebra::Vector3;
use calib_urdf::RobotModel;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha12Rng;

/// What the tracker sees of the last link.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Seen {
    Markers(usize),
    Pose,
}

/// One joint: origin and axis.
pub type Line = ([f64; 3], [f64; 3]);

/// Two parallel axes and a wrist.
pub const THREE: &[Line] = &[
    ([0.0, 0.0, 0.3], [0.0, 0.0, 1.0]),
    ([0.3, 0.0, 0.1], [0.0, 1.0, 0.0]),
    ([0.3, 0.0, 0.0], [0.0, 1.0, 0.0]),
];

/// An arm of four to six joints with axes at right angles, drawn.
pub fn arm(seed: u64) -> Vec<Line> {
    let mut rng = ChaCha12Rng::seed_from_u64(seed);
    let axes = [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]];
    let n = 4 + (seed % 3) as usize;
    let mut last = 2;
    let joint = |_| {
        let mut axis = rng.random_range(0..3);
        // Three parallel axes in a row are no arm.
        if axis == last {
            axis = (axis + 1) % 3;
        }
        last = axis;
        let at = Vector3::from_fn(|_, _| rng.random_range(-0.15..0.15));
        ([at.x, at.y, at.z + 0.2], axes[axis])
    };
    (0..n).map(joint).collect()
}

/// `inside`: what every moved link holds.
fn urdf(joints: &[Line], inside: &str) -> String {
    let mut text = String::from("<robot name=\"arm\">\n<link name=\"l0\"/>\n");
    for (i, (at, axis)) in joints.iter().enumerate() {
        let k = i + 1;
        let of = |v: &[f64; 3]| format!("{} {} {}", v[0], v[1], v[2]);
        let _ = writeln!(
            text,
            "<link name=\"l{k}\">{inside}</link><joint name=\"j{k}\" type=\"revolute\"><parent link=\"l{i}\"/><child link=\"l{k}\"/>\
             <origin xyz=\"{}\"/><axis xyz=\"{}\"/><limit lower=\"-2.5\" upper=\"2.5\" effort=\"50\" velocity=\"2\"/></joint>",
            of(at),
            of(axis)
        );
    }
    text + "</robot>\n"
}

/// A profile with random postures and a simulated robot.
pub fn profile(joints: usize, seen: Seen, poses: usize, seed: u64) -> String {
    let places = ["[0, 0, 0]", "[70, 0, 0]", "[20, 60, 0]", "[40, 20, 45]"];
    let (hand, markers) = match seen {
        Seen::Pose => (format!("{{link: l{joints}, pose: true}}"), String::new()),
        Seen::Markers(n) => {
            let names: Vec<String> = (1..=n).map(|i| format!("f{i}")).collect();
            let at: Vec<String> = (0..n)
                .map(|i| format!("f{}: {}", i + 1, places[i]))
                .collect();
            (
                format!("{{link: l{joints}, markers: [{}]}}", names.join(", ")),
                format!(", markers_mm: {{{}}}", at.join(", ")),
            )
        }
    };
    let ranges: Vec<String> = (1..=joints)
        .map(|j| format!("j{j}_deg: [-110, 110]"))
        .collect();
    let random = format!("{{{}}}", ranges.join(", "));
    let foot = "b1: [-120, -100, 0], b2: [130, -90, 0], b3: [110, 100, 20], b4: [-100, 120, 60]";
    format!(
        "calib: 1\nrobot: {{name: arm, urdf: arm.urdf}}\n\
         tracker: {{frame: lab, marker_sigma_mm: 0.1, body_sigma_mm: 0.1, body_sigma_deg: 0.05}}\n\
         bodies:\n  foot: {{link: l0, markers: [b1, b2, b3, b4], mount: {{}}, template_mm: {{{foot}}}}}\n  hand: {hand}\n\
         recordings: {{poses: {{file: poses.csv, use: static}}, checks: {{file: checks.csv, use: validation}}}}\n\
         solve:\n  free: [bodies, tracker, joint_offsets, joint_axes]\n  \
         prior: {{position_mm: 1, angle_deg: 0.2, offset_deg: 0.3}}\n\
         simulate:\n  seed: {seed}\n  tracker_from_root: {{xyz_mm: [900, 300, 100], rpy_deg: [0, 0, 40]}}\n  mounts:\n    \
         foot: {{markers_mm: {{{foot}}}}}\n    hand: {{xyz_mm: [40, 10, 5], rpy_deg: [5, 80, 0]{markers}}}\n  \
         errors: {{joint_offset_deg: 0.3, axis_mm: 1, axis_deg: 0.2}}\n  noise: {{marker_mm: 0.1, body_mm: 0.1, body_deg: 0.05, joint_deg: 0.003}}\n  \
         recordings:\n    poses: {{random: {random}, poses: {poses}}}\n    checks: {{random: {random}, poses: 8}}\n"
    )
}

/// A robot, as the program would read it.
pub fn robot(joints: &[Line], text: &str) -> RobotProfile {
    read(urdf(joints, ""), text)
}

/// A robot whose links have masses, so that compliance is tested for.
pub fn weighted(joints: &[Line], text: &str) -> RobotProfile {
    let inside = "<inertial><origin xyz=\"0.05 0.02 0.1\"/><mass value=\"3\"/>\
                  <inertia ixx=\"0.01\" ixy=\"0\" ixz=\"0\" iyy=\"0.01\" iyz=\"0\" izz=\"0.01\"/></inertial>";
    read(urdf(joints, inside), text)
}

fn read(urdf_text: String, text: &str) -> RobotProfile {
    let model = RobotModel::from_urdf_text(&urdf_text, "arm.urdf").expect("a robot");
    let raw = calib_profile::parse(text, "arm.yaml").unwrap_or_else(|e| panic!("{e}"));
    let profile = calib_profile::check(&raw, text, "arm.yaml", &model);
    let profile = profile.unwrap_or_else(|e| panic!("{e}"));
    RobotProfile {
        file: "arm.yaml".to_owned(),
        written: Written::default(),
        folder: PathBuf::from("/nowhere"),
        masses: Masses::of(&model, &profile.load),
        profile,
        model,
        urdf_text,
        digests: Vec::new(),
    }
}

/// Its simulated recordings.
pub fn recorded(robot: &RobotProfile) -> Inputs {
    let simulated = calib_sim::simulate(&robot.profile, &robot.model, None);
    let tables = simulated.unwrap_or_else(|e| panic!("{e}")).recordings;
    of_tables(robot.clone(), tables, Plugins::Refused).unwrap_or_else(|e| panic!("{e}"))
}

/// Recordings of three joints.
pub fn three(seen: Seen, poses: usize, seed: u64) -> Inputs {
    recorded(&robot(THREE, &profile(3, seen, poses, seed)))
}
