//! Robots in memory, with what a profile states of them and nothing recorded.

use std::path::PathBuf;

use calib_pipeline::options::Plugins;
use calib_pipeline::prepare::inputs::{RobotProfile, Written};
use calib_pipeline::prepare::loads::Masses;
use calib_plan::Known;
use calib_urdf::RobotModel;

/// Joint: name, type, origin, axis, lower, upper.
type JointLine = (
    &'static str,
    &'static str,
    &'static str,
    &'static str,
    f64,
    f64,
);

pub const SIX: &[JointLine] = &[
    ("j1", "revolute", "0 0 0.29", "0 0 1", -2.8, 2.8),
    ("j2", "revolute", "0.03 0 0.11", "0 1 0", -1.2, 1.6),
    ("j3", "revolute", "0 0 0.35", "0 1 0", -1.5, 1.2),
    ("j4", "revolute", "0.12 0 0.06", "1 0 0", -2.8, 2.8),
    ("j5", "revolute", "0.25 0 0", "0 1 0", -1.8, 1.8),
    ("j6", "revolute", "0.08 0 0", "1 0 0", -3.0, 3.0),
];

pub const SCARA: &[JointLine] = &[
    ("j1", "revolute", "0 0 0.3", "0 0 1", -2.3, 2.3),
    ("j2", "revolute", "0.35 0 0", "0 0 1", -2.4, 2.4),
    ("j3", "prismatic", "0.3 0 0", "0 0 1", -0.2, 0.0),
    ("j4", "revolute", "0 0 -0.05", "0 0 1", -3.0, 3.0),
];

pub const SEVEN: &[JointLine] = &[
    ("j1", "revolute", "0 0 0.2", "0 0 1", -2.8, 2.8),
    ("j2", "revolute", "0 0 0.15", "0 1 0", -1.9, 1.9),
    ("j3", "revolute", "0 0 0.2", "0 0 1", -2.8, 2.8),
    ("j4", "revolute", "0 0 0.2", "0 1 0", -1.9, 1.9),
    ("j5", "revolute", "0 0 0.2", "0 0 1", -2.8, 2.8),
    ("j6", "revolute", "0 0 0.15", "0 1 0", -1.9, 1.9),
    ("j7", "revolute", "0 0 0.1", "0 0 1", -2.8, 2.8),
];

fn urdf(joints: &[JointLine], shapes: bool) -> String {
    let link = |i: usize| {
        // As long as the way to the next joint, and thinner than it.
        let next = joints.get(i).map_or("0.05 0 0", |j| j.2);
        let v: Vec<f64> = next
            .split(' ')
            .map(|x| x.parse().expect("a number"))
            .collect();
        let length = v.iter().map(|x| x * x).sum::<f64>().sqrt().max(0.04);
        let along = v.iter().map(|x| x / 2.0).collect::<Vec<f64>>();
        let (pitch, yaw) = (v[0].hypot(v[1]).atan2(v[2]), v[1].atan2(v[0]));
        let shape = format!(
            "<collision><origin xyz=\"{} {} {}\" rpy=\"0 {pitch} {yaw}\"/><geometry><cylinder radius=\"0.035\" length=\"{length}\"/></geometry></collision>",
            along[0], along[1], along[2]
        );
        format!(
            "<link name=\"l{i}\">{}</link>\n",
            if shapes { shape } else { String::new() }
        )
    };
    let mut text = format!("<robot name=\"arm\">\n{}", link(0));
    for (i, (name, kind, xyz, axis, lower, upper)) in joints.iter().enumerate() {
        text += &link(i + 1);
        text += &format!(
            "<joint name=\"{name}\" type=\"{kind}\"><parent link=\"l{i}\"/><child link=\"l{}\"/><origin xyz=\"{xyz}\"/><axis xyz=\"{axis}\"/>\
             <limit lower=\"{lower}\" upper=\"{upper}\" effort=\"50\" velocity=\"2\"/></joint>\n",
            i + 1
        );
    }
    text + "</robot>\n"
}

/// What the tracker sees of the last link.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Seen {
    Markers(usize),
    Pose,
}

/// A profile whose only recording does not exist, with `extra` sections.
fn profile(last: usize, seen: Seen, extra: &str) -> String {
    let foot = "{link: l0, markers: [b1, b2, b3, b4], mount: {}, template_mm: {b1: [-120, -100, 0], b2: [130, -90, 0], b3: [110, 100, 20], b4: [-100, 120, 60]}}";
    let places = ["[0, 0, 0]", "[70, 0, 0]", "[20, 60, 0]", "[40, 20, 45]"];
    let (hand, markers) = match seen {
        Seen::Pose => (format!("{{link: l{last}, pose: true}}"), String::new()),
        Seen::Markers(n) => {
            let names: Vec<String> = (1..=n).map(|i| format!("f{i}")).collect();
            let at = (0..n).map(|i| format!("f{}: {}", i + 1, places[i]));
            let at: Vec<String> = at.collect();
            (
                format!("{{link: l{last}, markers: [{}]}}", names.join(", ")),
                format!(", markers_mm: {{{}}}", at.join(", ")),
            )
        }
    };
    format!(
        "calib: 1\nrobot: {{name: arm, urdf: arm.urdf}}\n\
         tracker: {{frame: lab, marker_sigma_mm: 0.1, body_sigma_mm: 0.1, body_sigma_deg: 0.05}}\n\
         bodies:\n  foot: {foot}\n  hand: {hand}\n\
         recordings: {{poses: {{file: poses.csv, use: static}}}}\n\
         solve:\n  free: [bodies, tracker, joint_offsets, joint_axes]\n  noise: {{joint_deg: 0.003, known: true}}\n  \
         prior: {{position_mm: 1, angle_deg: 0.2, offset_deg: 0.3}}\n\
         simulate:\n  seed: 6\n  tracker_from_root: {{xyz_mm: [900, 300, 100], rpy_deg: [0, 0, 40]}}\n  mounts:\n    \
         foot: {{markers_mm: {{b1: [-120, -100, 0], b2: [130, -90, 0], b3: [110, 100, 20], b4: [-100, 120, 60]}}}}\n    \
         hand: {{xyz_mm: [40, 10, 5], rpy_deg: [5, 80, 0]{markers}}}\n  \
         errors: {{joint_offset_deg: 0.3, axis_mm: 1, axis_deg: 0.2}}\n  noise: {{marker_mm: 0.1, body_mm: 0.1, body_deg: 0.05, joint_deg: 0.003}}\n  \
         recordings: {{poses: {{random: {{j1_deg: [-10, 10]}}, poses: 2}}}}\n{extra}"
    )
}

/// A robot of the test, as the program would read it.
pub fn robot(joints: &[JointLine], seen: Seen, shapes: bool, extra: &str) -> RobotProfile {
    of_text(urdf(joints, shapes), &profile(joints.len(), seen, extra))
}

/// A robot from the texts of its files.
pub fn of_text(urdf_text: String, text: &str) -> RobotProfile {
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

pub fn known(robot: RobotProfile) -> Known {
    Known::of(robot, Plugins::Refused).unwrap_or_else(|e| panic!("{e}"))
}

/// An arm whose elbow folds the forearm onto the upper arm: both have shapes that end before the elbow.
pub fn folding() -> Known {
    let joints = [
        ("j1", "revolute", "0 0 0.3", "0 0 1", -2.0, 2.0),
        ("j2", "revolute", "0.5 0 0", "0 1 0", -3.1, 3.1),
        ("j3", "revolute", "0.5 0 0", "1 0 0", -2.0, 2.0),
    ];
    let shape = |link: &str, at: f64| {
        format!(
            "<link name=\"{link}\"><collision><origin xyz=\"{at} 0 0\" rpy=\"0 1.5707963 0\"/><geometry><cylinder radius=\"0.03\" length=\"0.3\"/></geometry></collision></link>"
        )
    };
    let text = urdf(&joints, false)
        .replace("<link name=\"l1\"></link>", &shape("l1", 0.2))
        .replace("<link name=\"l2\"></link>", &shape("l2", 0.3));
    known(of_text(text, &profile(3, Seen::Markers(4), "")))
}

pub fn six(seen: Seen, extra: &str) -> Known {
    known(robot(SIX, seen, true, extra))
}

/// Five robots: joints of three kinds, one, two, three and four markers, and a body that is stated as a pose.
pub fn five() -> Vec<(&'static str, Known)> {
    vec![
        (
            "6R, 4 markers",
            known(robot(SIX, Seen::Markers(4), false, "")),
        ),
        (
            "6R, 1 marker",
            known(robot(SIX, Seen::Markers(1), false, "")),
        ),
        ("6R, 6-DoF body", known(robot(SIX, Seen::Pose, false, ""))),
        (
            "SCARA, 2 markers",
            known(robot(SCARA, Seen::Markers(2), false, "")),
        ),
        (
            "7R, 3 markers",
            known(robot(SEVEN, Seen::Markers(3), false, "")),
        ),
    ]
}
