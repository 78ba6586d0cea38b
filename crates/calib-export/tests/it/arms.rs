//! Formats of certain arms: UR's, and those with a spherical wrist.

use std::f64::consts::FRAC_PI_2;

use calib_export::{Exported, Robot, Target, export};
use calib_model::file::{ModelJoint, ModelLink, ModelMotion, RobotModelFile};
use calib_model::{Model, Under};
use calib_urdf::{YamlOrigin, yaml_origins};
use nalgebra::{Isometry3, Matrix4, UnitQuaternion, Vector3};
use rand::RngExt as _;
use rand_chacha::ChaCha8Rng;

use crate::common::{Effects, pose, posture, rng, robot, vector, within};
use crate::exports::{at, list, matrix, moved, plain, read, said, turned};

const UR: [&str; 6] = [
    "left_shoulder_pan_joint",
    "left_shoulder_lift_joint",
    "left_elbow_joint",
    "left_wrist_1_joint",
    "left_wrist_2_joint",
    "left_wrist_3_joint",
];

/// A UR arm on a fixed joint, whose calibrated origin is off by `base` m.
fn ur_arm(r: &mut ChaCha8Rng, effects: bool, base: f64) -> RobotModelFile {
    let mut file = robot(r, 6, false, Effects::Smooth);
    for (joint, name) in file.joints.iter_mut().zip(UR) {
        joint.name = name.to_owned();
        joint.axis = Some([0.0, 0.0, 1.0]);
        joint
            .effects
            .retain(|e| e.kind == "offset" || (effects && e.about.is_none() && e.other.is_none()));
    }
    let nominal = Isometry3::new(vector(r, 0.4), vector(r, 1.0));
    file.joints.insert(
        0,
        ModelJoint {
            name: "mount".to_owned(),
            parent: "floor".to_owned(),
            child: "link_0".to_owned(),
            parent_from_joint: pose(&(nominal * Isometry3::translation(base, 0.0, 0.0))),
            load_origin: pose(&nominal),
            ..ModelJoint::default()
        },
    );
    "floor".clone_into(&mut file.root);
    file.links.push(ModelLink {
        name: "floor".to_owned(),
        ..ModelLink::default()
    });
    file
}

/// What `ur_description` makes of the file: its six origins, the nominal ones of all others, no effects.
fn by_ur_description(file: &RobotModelFile, origins: &[YamlOrigin]) -> Model {
    let mut file = file.clone();
    for joint in &mut file.joints {
        let held = origins.iter().find(|o| o.is_of(&joint.name));
        joint.parent_from_joint =
            held.map_or(joint.load_origin, |o| pose(&o.parent_link_from_joint));
        joint.effects.clear();
    }
    Model::new(&file).expect("a model")
}

/// Position error of the tool by another program over postures, rms in m.
fn error(robot: &Robot, r: &mut ChaCha8Rng, other: &mut dyn FnMut(&[f64]) -> Vector3<f64>) -> f64 {
    let tool = robot.model.last_link();
    let mut sum = 0.0;
    for _ in 0..400 {
        // The fitted range of these robots is ±2.5.
        let q: Vec<f64> = posture(r, 6).iter().map(|q| q * 1.25).collect();
        sum += (other(&q) - at(&robot.model, tool, &q).t).norm_squared();
    }
    (sum / 400.0_f64).sqrt()
}

#[test]
fn the_kinematics_of_a_ur_arm_read_back_as_the_geometry() {
    for seed in 0..10 {
        let mut r = rng(seed);
        let (effects, base) = ([false, true][seed as usize % 2], 2e-3 * (seed / 8) as f64);
        let robot = read(ur_arm(&mut r, effects, base));
        let done = export(&robot, Target::Ur, None, None).expect("written");
        let origins = yaml_origins(&done.text, "ur.yaml").expect("YAML");
        assert_eq!(origins.len(), 6);
        let geometry = plain(&robot.file);
        let read_back = by_ur_description(&robot.file, &origins);
        for (joint, origin) in robot.file.joints[1..].iter().zip(&origins) {
            assert!(origin.is_of(&joint.name), "{} {}", origin.key, joint.name);
        }
        assert_eq!(done.lost.contains(&"compliance"), effects);
        assert_eq!(done.lost.contains(&"origins of other joints"), base > 0.0);
        if base == 0.0 {
            let q = posture(&mut r, 6);
            let tool = geometry.last_link();
            let (a, b) = (at(&geometry, tool, &q), at(&read_back, tool, &q));
            assert!((a.t - b.t).norm() + (a.r - b.r).norm() < 1e-13);
        }
        let tool = read_back.last_link();
        let rms = error(&robot, &mut r, &mut |q| at(&read_back, tool, q).t);
        let told = done.cost.rms_m;
        if effects || base > 0.0 {
            assert!((rms / told - 1.0).abs() < 0.15, "{rms:e} {told:e}");
        } else {
            assert!(rms < 1e-12 && told < 1e-12, "{rms:e} {told:e}");
        }
    }
}

#[test]
fn the_hash_of_a_ur_file_is_of_its_numbers() {
    let hash = |seed: u64| {
        let robot = read(ur_arm(&mut rng(seed), true, 0.0));
        let text = export(&robot, Target::Ur, None, None)
            .expect("written")
            .text;
        let found = text.lines().find_map(|l| l.strip_prefix("  hash: calib_"));
        found.expect("a hash").parse::<u64>().expect("a number")
    };
    assert_eq!(hash(1), hash(1));
    assert_ne!(hash(1), hash(2));
}

#[test]
fn what_is_no_ur_arm_is_refused_with_the_reason() {
    let refused = |file: RobotModelFile, tool: Option<&str>| {
        let done = export(&read(file), Target::Ur, tool, None);
        done.expect_err("refused").to_string()
    };
    let says = refused(robot(&mut rng(1), 6, false, Effects::All), None);
    assert!(says.contains("0 of the six joints of a UR arm"), "{says}");
    let says = refused(ur_arm(&mut rng(1), true, 0.0), Some("tip"));
    assert!(says.contains("no tool"), "{says}");
    let says = refused(ur_arm(&mut rng(1), true, 0.0), Some("link_4"));
    assert!(says.contains("4 of the six joints"), "{says}");
    let mut file = ur_arm(&mut rng(1), true, 0.0);
    file.joints[3].axis = Some([0.0, 1.0, 0.0]);
    let says = refused(file, None);
    assert!(
        says.contains("left_elbow_joint does not turn about its z axis"),
        "{says}"
    );
}

/// Numbers of an arm with a spherical wrist, as its data sheet has them.
#[derive(Debug)]
struct Sheet {
    /// a1, a2, b, c1, c2, c3, c4, m
    lengths: [f64; 7],
    offsets: [f64; 6],
    signs: [f64; 6],
    root_from_base: Isometry3<f64>,
    flange_from_tool: Isometry3<f64>,
}

fn sheet(r: &mut ChaCha8Rng) -> Sheet {
    // Neither has a rotation about z or a translation along it: c1, c4 and two offsets are those.
    let tilt = |r: &mut ChaCha8Rng| {
        let turn = vector(r, 0.3);
        Isometry3::rotation(Vector3::new(turn.x, turn.y, 0.0))
    };
    let aside = |r: &mut ChaCha8Rng| Isometry3::translation(within(r, 0.1), within(r, 0.1), 0.0);
    let long = |r: &mut ChaCha8Rng| r.random_range(0.2..0.8);
    Sheet {
        lengths: [
            within(r, 0.3),
            within(r, 0.2),
            within(r, 0.1),
            long(r),
            long(r),
            long(r),
            long(r),
        ],
        offsets: [1.0, 3.0, 3.0, 1.0, 3.0, 3.0].map(|size| within(r, size)),
        signs: [0; 6].map(|_| if r.random_bool(0.5) { 1.0 } else { -1.0 }),
        root_from_base: tilt(r) * aside(r),
        flange_from_tool: aside(r) * tilt(r),
    }
}

/// The arm as a model, its joint frames turned at random; lengths and axes off by `off` m and rad, with effects or without.
fn arm(r: &mut ChaCha8Rng, of: &Sheet, off: f64, effects: bool) -> RobotModelFile {
    let mut file = robot(r, 6, false, Effects::Smooth);
    let [a1, a2, b, c1, c2, c3, c4] = of.lengths;
    let t = Isometry3::translation;
    let (y, z) = (Vector3::y(), Vector3::z());
    let links = [
        (of.root_from_base, z),
        (t(a1, b, c1), y),
        (t(0.0, 0.0, c2), y),
        (t(a2, 0.0, c3), z),
        (Isometry3::identity(), y),
        (Isometry3::identity(), z),
    ];
    let mut back = UnitQuaternion::identity();
    for (i, (joint, (by, axis))) in file.joints.iter_mut().zip(links).enumerate() {
        let turn = UnitQuaternion::from_scaled_axis(vector(r, 1.0));
        let zero = Isometry3::rotation(axis * -of.offsets[i]);
        let nominal = back.inverse() * by * zero * turn;
        let error = match off > 0.0 {
            true => Isometry3::new(vector(r, off), vector(r, off)),
            false => Isometry3::identity(),
        };
        joint.load_origin = pose(&nominal);
        joint.parent_from_joint = pose(&(nominal * error));
        joint.axis = Some((turn.inverse() * axis * of.signs[i]).into());
        joint
            .effects
            .retain(|e| effects && e.about.is_none() && e.other.is_none());
        back = turn;
    }
    let flange = back.inverse() * t(0.0, 0.0, c4) * of.flange_from_tool;
    file.joints.push(ModelJoint {
        name: "flange".to_owned(),
        parent: "link_6".to_owned(),
        child: "tool0".to_owned(),
        motion: ModelMotion::Fixed,
        parent_from_joint: pose(&flange),
        load_origin: pose(&flange),
        ..ModelJoint::default()
    });
    file.links.push(ModelLink {
        name: "tool0".to_owned(),
        ..ModelLink::default()
    });
    file
}

/// Number of a line of a YAML.
fn value(text: &str, key: &str) -> f64 {
    let line = text.lines().find_map(|l| l.strip_prefix(key));
    line.expect(key).parse().expect("a number")
}

fn lengths(text: &str) -> [f64; 7] {
    ["a1", "a2", "b", "c1", "c2", "c3", "c4"].map(|name| value(text, &format!("  {name}: ")))
}

/// What the file says, by elementary matrices.
fn by_the_file(text: &str, q: &[f64]) -> Matrix4<f64> {
    let [a1, a2, b, c1, c2, c3, c4] = lengths(text);
    let offsets = list(text, "\nopw_kinematics_joint_offsets");
    let signs = list(text, "\nopw_kinematics_joint_sign_corrections");
    let p = |i: usize| q[i] * signs[i] - offsets[i];
    matrix(&list(text, "\nroot_from_base"))
        * turned(2, p(0))
        * moved(0, a1)
        * moved(1, b)
        * moved(2, c1)
        * turned(1, p(1))
        * moved(2, c2)
        * turned(1, p(2))
        * moved(0, a2)
        * moved(2, c3)
        * turned(2, p(3))
        * turned(1, p(4))
        * turned(2, p(5))
        * moved(2, c4)
        * matrix(&list(text, "\nflange_from_tool"))
}

fn opw(robot: &Robot) -> Exported {
    export(robot, Target::Opw, None, None).expect("written")
}

#[test]
fn an_arm_with_a_spherical_wrist_has_the_numbers_of_its_data_sheet() {
    for seed in 0..10 {
        let mut r = rng(seed);
        let sheet = sheet(&mut r);
        let robot = read(arm(&mut r, &sheet, 0.0, false));
        let done = opw(&robot);
        assert!(done.cost.largest_m < 1e-11, "{:?}", done.cost);
        let found = lengths(&done.text);
        for (found, own) in found.iter().zip(&sheet.lengths) {
            assert!((found - own).abs() < 1e-9, "{sheet:?}\n{}", done.text);
        }
        let signs = list(&done.text, "\nopw_kinematics_joint_sign_corrections");
        assert_eq!(signs, sheet.signs);
        let offsets = list(&done.text, "\nopw_kinematics_joint_offsets");
        for (found, own) in offsets.iter().zip(&sheet.offsets) {
            assert!((found - own).abs() < 1e-9, "{sheet:?}\n{}", done.text);
        }
        let rms = error(&robot, &mut r, &mut |q| {
            by_the_file(&done.text, q).fixed_view::<3, 1>(0, 3).into()
        });
        assert!(rms < 1e-11, "{rms:e}");
    }
}

/// Joints of a KUKA KR 6 R700 sixx as in ROS-Industrial's `kuka_kr6_support`: origin, m, and axis; the tool is turned by 90° about y.
const KUKA: [([f64; 3], [f64; 3]); 6] = [
    ([0.0, 0.0, 0.4], [0.0, 0.0, -1.0]),
    ([0.025, 0.0, 0.0], [0.0, 1.0, 0.0]),
    ([0.315, 0.0, 0.0], [0.0, 1.0, 0.0]),
    ([0.0, 0.0, 0.035], [-1.0, 0.0, 0.0]),
    ([0.365, 0.0, 0.0], [0.0, 1.0, 0.0]),
    ([0.08, 0.0, 0.0], [-1.0, 0.0, 0.0]),
];

#[test]
fn a_kuka_has_the_parameters_that_are_published_for_it() {
    let mut file = robot(&mut rng(1), 6, false, Effects::Smooth);
    for (joint, (origin, axis)) in file.joints.iter_mut().zip(KUKA) {
        joint.parent_from_joint = pose(&Isometry3::translation(origin[0], origin[1], origin[2]));
        joint.load_origin = joint.parent_from_joint;
        joint.axis = Some(axis);
        joint.effects.clear();
    }
    let tool = pose(&Isometry3::rotation(Vector3::y() * FRAC_PI_2));
    file.joints.push(ModelJoint {
        name: "flange-tool0".to_owned(),
        parent: "link_6".to_owned(),
        child: "tool0".to_owned(),
        parent_from_joint: tool,
        load_origin: tool,
        ..ModelJoint::default()
    });
    file.links.push(ModelLink {
        name: "tool0".to_owned(),
        ..ModelLink::default()
    });
    let text = opw(&read(file)).text;
    // The example in the documentation of MoveIt's plugin for these parameters.
    let published = [0.025, -0.035, 0.0, 0.4, 0.315, 0.365, 0.08];
    for (found, own) in lengths(&text).iter().zip(published) {
        assert!((found - own).abs() < 1e-10, "{text}");
    }
    let offsets = list(&text, "\nopw_kinematics_joint_offsets");
    for (found, own) in offsets.iter().zip([0.0, -FRAC_PI_2, 0.0, 0.0, 0.0, 0.0]) {
        assert!((found - own).abs() < 1e-10, "{text}");
    }
    let signs = list(&text, "\nopw_kinematics_joint_sign_corrections");
    assert_eq!(signs, [-1.0, 1.0, 1.0, -1.0, 1.0, -1.0]);
    let nothing = Matrix4::<f64>::identity();
    for transform in ["\nroot_from_base", "\nflange_from_tool"] {
        assert!(
            (matrix(&list(&text, transform)) - nothing).norm() < 1e-10,
            "{text}"
        );
    }
}

#[test]
fn what_seven_lengths_cost_is_stated_as_it_is() {
    for seed in 0..6 {
        let mut r = rng(seed);
        let sheet = sheet(&mut r);
        let robot = read(arm(&mut r, &sheet, 1e-3, seed % 2 == 0));
        let done = opw(&robot);
        let rms = error(&robot, &mut r, &mut |q| {
            by_the_file(&done.text, q).fixed_view::<3, 1>(0, 3).into()
        });
        let told = done.cost.rms_m;
        assert!((rms / told - 1.0).abs() < 0.15, "{rms:e} {told:e}");
        let says = format!("{:.3} mm rms", 1e3 * told);
        assert!(done.text.contains(&says), "{says}\n{}", done.text);
        // The numbers of the data sheet are worse.
        let nominal = robot.file.joints.iter().map(|j| j.load_origin);
        let mut file = robot.file.clone();
        for (joint, origin) in file.joints.iter_mut().zip(nominal) {
            joint.parent_from_joint = origin;
            joint.effects.clear();
        }
        let sheet = Model::new(&file).expect("a model");
        let tool = sheet.last_link();
        let before = error(&robot, &mut r, &mut |q| at(&sheet, tool, q).t);
        assert!(told < before, "{told:e} {before:e}");
    }
}

/// Poses of the tool by an independent implementation of these parameters.
const BY_OPW: &str = "
import sys, json, numpy
from py_opw_kinematics._internal import KinematicModel, Robot
text = dict(l.strip().split(': ', 1) for l in open(sys.argv[1]) if ': ' in l and l[0] != '#')
text = {k: json.loads(v) for k, v in text.items() if v[0] in '-[0123456789'}
square = lambda name: numpy.vstack([numpy.reshape(text[name], (3, 4)), [0, 0, 0, 1]])
lengths = {k: text[k] for k in ('a1', 'a2', 'b', 'c1', 'c2', 'c3', 'c4')}
robot = Robot(KinematicModel(**lengths, offsets=tuple(text['opw_kinematics_joint_offsets']),
    flip_axes=tuple(s < 0 for s in text['opw_kinematics_joint_sign_corrections'])), False)
base, tool = square('root_from_base'), square('flange_from_tool')
out = []
for q in json.load(open(sys.argv[2]))['q']:
    pose = base @ robot.forward(tuple(q)) @ tool
    out.append(list(pose[:3].ravel()))
print(json.dumps(out))
";

#[test]
fn another_implementation_reads_the_parameters_of_a_spherical_wrist_alike() {
    let Some(python) = skipped_tests::checker("opw") else {
        return;
    };
    for seed in 0..2 {
        let mut r = rng(seed);
        let sheet = sheet(&mut r);
        let exact = seed == 0;
        let robot = read(arm(&mut r, &sheet, if exact { 0.0 } else { 1e-3 }, false));
        let text = opw(&robot).text;
        let postures: Vec<Vec<f64>> = (0..20).map(|_| posture(&mut r, 6)).collect();
        let given = format!("{{\"q\": {postures:?}}}");
        let numbers = said(&python, BY_OPW, &text, &given);
        assert_eq!(numbers.len(), 12 * postures.len());
        let tool = robot.model.last_link();
        for (q, seen) in postures.iter().zip(numbers.chunks(12)) {
            let off = (matrix(seen) - by_the_file(&text, q)).norm();
            assert!(off < 1e-12, "{off:e}");
            let off = Vector3::new(seen[3], seen[7], seen[11]) - at(&robot.model, tool, q).t;
            assert!(off.norm() < if exact { 1e-11 } else { 2e-2 }, "{off}");
        }
    }
}

#[test]
fn arms_of_another_kind_are_refused_with_what_they_are() {
    let refused = |file: RobotModelFile| {
        let done = export(&read(file), Target::Opw, None, None);
        done.expect_err("refused").to_string()
    };
    // A wrist whose axes pass each other, as a UR arm's.
    let mut r = rng(3);
    let sheet = sheet(&mut r);
    let mut file = arm(&mut r, &sheet, 0.0, false);
    let aside = Isometry3::translation(0.1, 0.0, 0.0);
    let origin = file.joints[4].parent_from_joint;
    let turn = UnitQuaternion::from_quaternion(origin.quat_xyzw.into());
    file.joints[4].parent_from_joint =
        pose(&(Isometry3::from_parts(Vector3::from(origin.xyz_m).into(), turn) * aside));
    let says = refused(file);
    assert!(says.contains("mm of a common point"), "{says}");
    assert!(says.contains("`dh`, `hayati` or `poe`"), "{says}");
    // Axes 2 and 3 that cross.
    let mut file = arm(&mut r, &sheet, 0.0, false);
    file.joints[2].axis = file.joints[2].axis.map(|a| [a[1], a[2], a[0]]);
    let says = refused(file);
    assert!(says.contains("from parallel"), "{says}");
    let says = refused(robot(&mut r, 7, false, Effects::All));
    assert!(says.contains("7 joints that move, and not six"), "{says}");
    let mut file = robot(&mut r, 6, false, Effects::All);
    file.joints[2].motion = ModelMotion::Prismatic;
    file.joints[2].effects.clear();
    let says = refused(file);
    assert!(says.contains("joint_2 is a sliding joint"), "{says}");
}

#[test]
fn a_point_as_tool_of_a_spherical_wrist_is_in_the_transform_behind_the_flange() {
    let mut r = rng(5);
    let sheet = sheet(&mut r);
    let robot = read(arm(&mut r, &sheet, 0.0, false));
    let done = export(&robot, Target::Opw, Some("tip"), None).expect("written");
    assert_eq!(done.tool, "tip");
    let tip = robot.model.place("tip").expect("a point");
    let mut work = robot.model.work();
    let q = posture(&mut r, 6);
    robot
        .model
        .forward(&q, &Under::default(), &mut work)
        .expect("poses");
    let own = robot.model.root_from(tip, &work).expect("there");
    let seen = by_the_file(&done.text, &q);
    assert!((seen.fixed_view::<3, 1>(0, 3) - own.t).norm() < 1e-11);
}
