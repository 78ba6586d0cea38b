//! Every format read back by something that did not write it, over postures by chance.

use std::path::Path;
use std::process::Command;

use calib_export::{Robot, Target, export};
use calib_model::file::RobotModelFile;
use calib_model::{Model, Place, Pose, Under};
use calib_urdf::RobotModel;
use nalgebra::{Matrix3, Matrix4, Vector3};
use rand_chacha::ChaCha8Rng;

use crate::common::{Effects, posture, rng, robot};

pub(crate) fn read(file: RobotModelFile) -> Robot {
    Robot {
        model: Model::new(&file).expect("a model"),
        file,
    }
}

/// The robot's geometry alone: no effect but zero offsets.
pub(crate) fn plain(file: &RobotModelFile) -> Model {
    let mut file = file.clone();
    for joint in &mut file.joints {
        joint.effects.retain(|e| e.kind == "offset");
    }
    Model::new(&file).expect("a model")
}

pub(crate) fn at(model: &Model, place: impl Into<Place>, q: &[f64]) -> Pose {
    let mut work = model.work();
    model
        .forward(q, &Under::default(), &mut work)
        .expect("poses");
    model.root_from(place.into(), &work).expect("a place")
}

fn off(a: &Pose, b: &Pose) -> f64 {
    (a.t - b.t).norm() + (a.r - b.r).norm()
}

#[test]
fn urdf_is_the_geometry_to_rounding() {
    for seed in 0..10 {
        let mut r = rng(seed);
        let robot = read(robot(&mut r, 7, true, Effects::All));
        let text = export(&robot, Target::Urdf, None, None)
            .expect("written")
            .text;
        let urdf = RobotModel::from_urdf_text(&text, "exported").expect("a URDF");
        let model = plain(&robot.file);
        for _ in 0..5 {
            let q = posture(&mut r, model.joints().len());
            let mut by_joint = urdf.zero_positions();
            for (joint, q) in model.joints().iter().zip(&q) {
                by_joint[urdf.joint_id(&joint.name).expect("there").index()] = *q;
            }
            let poses = urdf.forward_kinematics(&by_joint);
            for (k, name) in model.links().iter().enumerate() {
                let seen = Pose::of(&poses[urdf.link_id(name).expect("there").index()]);
                let own = at(&model, model.link(name).expect("there"), &q);
                assert!(off(&seen, &own) < 1e-12, "{k} {:e}", off(&seen, &own));
            }
        }
    }
}

/// Number behind a key of a line, as it is written.
fn number(line: &str, key: &str) -> f64 {
    let at = line.find(&format!(", {key}: ")).expect(key) + key.len() + 4;
    let rest = &line[at..];
    let end = rest.find([',', '}']).expect("an end");
    rest[..end].parse().expect("a number")
}

pub(crate) fn list(text: &str, key: &str) -> Vec<f64> {
    let at = text.find(&format!("{key}: [")).expect(key) + key.len() + 3;
    let end = text[at..].find(']').expect("an end") + at;
    text[at..end]
        .split(", ")
        .map(|x| x.parse().expect("a number"))
        .collect()
}

pub(crate) fn matrix(rows: &[f64]) -> Matrix4<f64> {
    let mut out = Matrix4::identity();
    for i in 0..3 {
        for k in 0..4 {
            out[(i, k)] = rows[4 * i + k];
        }
    }
    out
}

/// Elementary matrices, as in a textbook.
pub(crate) fn turned(axis: usize, angle: f64) -> Matrix4<f64> {
    let (s, c) = angle.sin_cos();
    let mut out = Matrix4::identity();
    let (i, k) = ((axis + 1) % 3, (axis + 2) % 3);
    (out[(i, i)], out[(i, k)], out[(k, i)], out[(k, k)]) = (c, -s, s, c);
    out
}

pub(crate) fn moved(axis: usize, by: f64) -> Matrix4<f64> {
    Matrix4::new_translation(&Vector3::ith(axis, by))
}

#[test]
fn tables_of_parameters_are_the_geometry_by_their_own_formulas() {
    let mut far_said = 0;
    for seed in 0..30 {
        let mut r = rng(seed);
        let mut file = robot(&mut r, 6, seed % 3 == 0, Effects::All);
        if seed % 2 == 0 {
            // An arm as they are built: axes parallel to 1 mrad, or to rounding, or meeting.
            for (i, joint) in file.joints.iter_mut().enumerate() {
                let tilt = if i % 2 == 0 { 1e-3 } else { 0.0 };
                joint.parent_from_joint.quat_xyzw =
                    [tilt, 0.0, 0.0, (1.0_f64 - tilt * tilt).sqrt()];
                joint.parent_from_joint.xyz_m = [0.3, 0.0, if i == 2 { 0.0 } else { 0.1 }];
                joint.axis = joint
                    .axis
                    .map(|_| [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0]][i / 3]);
                joint.effects.retain(|e| e.about.is_none());
            }
        }
        let robot = read(file);
        let model = plain(&robot.file);
        // A link or a point.
        let point = (seed % 4 == 3).then_some("tip");
        let tool = match point {
            Some(tip) => model.place(tip).expect("a point"),
            None => model.last_link().into(),
        };
        for target in [Target::Dh, Target::Hayati, Target::Poe] {
            let text = export(&robot, target, point, None).expect("written").text;
            let rows: Vec<&str> = text.lines().filter(|l| l.starts_with("  - {")).collect();
            for _ in 0..3 {
                let q = posture(&mut r, model.joints().len());
                let reading = |line: &str| {
                    let name = line
                        .split("reads: \"")
                        .nth(1)
                        .and_then(|l| l.split('"').next());
                    let joints = model.joints().iter();
                    let k = joints.zip(&q).find(|(j, _)| Some(j.name.as_str()) == name);
                    number(line, "multiplier") * k.expect("a joint").1 + number(line, "offset")
                };
                let mut seen = match target {
                    Target::Poe => Matrix4::identity(),
                    _ => matrix(&list(&text, "\nbase")),
                };
                for line in &rows {
                    let q = reading(line);
                    seen *= if target == Target::Poe {
                        let (w, v) = (list(line, "omega"), list(line, "v"));
                        let s = Matrix4::new(
                            0.0, -w[2], w[1], v[0], w[2], 0.0, -w[0], v[1], -w[1], w[0], 0.0, v[2],
                            0.0, 0.0, 0.0, 0.0,
                        );
                        (s * q).exp()
                    } else {
                        let slides = line.contains("type: prismatic");
                        let (turn, slide) = if slides { (0.0, q) } else { (q, 0.0) };
                        let beta = if target == Target::Hayati {
                            number(line, "beta")
                        } else {
                            0.0
                        };
                        turned(2, number(line, "theta") + turn)
                            * moved(2, number(line, "d") + slide)
                            * moved(0, number(line, "a"))
                            * turned(0, number(line, "alpha"))
                            * turned(1, beta)
                    };
                }
                let last = if target == Target::Poe {
                    "\nhome"
                } else {
                    "\ntool"
                };
                seen *= matrix(&list(&text, last));
                let own = at(&model, tool, &q);
                let seen = Pose {
                    r: seen.fixed_view::<3, 3>(0, 0).into(),
                    t: seen.fixed_view::<3, 1>(0, 3).into(),
                };
                assert!(
                    off(&seen, &own) < 1e-8,
                    "seed {seed} {target:?} {:e}\n{text}",
                    off(&seen, &own)
                );
            }
            // Numbers of a hundred meters are said to be what they are.
            let of_table = target == Target::Dh || target == Target::Hayati;
            let far = of_table && rows.iter().any(|l| number(l, "d").abs() > 100.0);
            let said = text.contains("nearly parallel: their common normal");
            assert!(said || !far, "seed {seed} {target:?}\n{text}");
            assert!(!said || target == Target::Dh && seed % 2 == 0, "{text}");
            far_said += usize::from(said);
            if target == Target::Hayati {
                // Nothing is far away for axes that are nearly parallel.
                let largest = rows
                    .iter()
                    .map(|l| number(l, "d").abs().max(number(l, "a").abs()));
                assert!(
                    seed % 2 != 0 || largest.fold(0.0, f64::max) < 20.0,
                    "{text}"
                );
            }
        }
    }
    assert!(far_said > 0);
}

#[test]
fn the_best_urdf_predicts_better_than_the_calibrated_one_and_says_how_well() {
    let mut r = rng(8);
    let robot = read(robot(&mut r, 6, false, Effects::Smooth));
    let plain = export(&robot, Target::Urdf, None, None).expect("written");
    let best = export(&robot, Target::UrdfBest, None, None).expect("written");
    assert!(plain.lost.contains(&"compliance") && plain.lost.contains(&"coupling"));
    assert!(
        best.cost.rms_m < 0.8 * plain.cost.rms_m,
        "{:?} {:?}",
        best.cost,
        plain.cost
    );
    // What it says holds on other postures, read by another reader.
    let urdf = RobotModel::from_urdf_text(&best.text, "best").expect("a URDF");
    let tool = robot.model.last_link();
    let link = urdf
        .link_id(&robot.model.links()[tool.index()])
        .expect("there");
    let mut sum = 0.0;
    for _ in 0..400 {
        let q: Vec<f64> = posture(&mut r, 6).iter().map(|q| q * 1.25).collect();
        let seen = urdf.forward_kinematics(&q)[link.index()].translation.vector;
        sum += (seen - at(&robot.model, tool, &q).t).norm_squared();
    }
    let rms = (sum / 400.0_f64).sqrt();
    assert!(
        (rms / best.cost.rms_m - 1.0).abs() < 0.15,
        "{rms:e} {:?}",
        best.cost
    );
    // In a smaller region it is better there.
    let region: Vec<Vec<f64>> = (0..200)
        .map(|_| posture(&mut r, 6).iter().map(|q| 0.2 * q).collect())
        .collect();
    let near = export(&robot, Target::UrdfBest, None, Some(&region)).expect("written");
    assert!(
        near.cost.rms_m < 0.5 * best.cost.rms_m,
        "{:?} {:?}",
        near.cost,
        best.cost
    );
}

/// Poses of all links at positions by MuJoCo.
const BY_MUJOCO: &str = "
import sys, json, mujoco
model = mujoco.MjModel.from_xml_path(sys.argv[1])
data = mujoco.MjData(model)
given = json.load(open(sys.argv[2]))
out = []
for row in given['q']:
    for name, x in zip(given['joints'], row):
        data.qpos[model.joint(name).qposadr[0]] = x
    mujoco.mj_kinematics(model, data)
    for link in given['links']:
        body = data.body(link)
        out.append(list(body.xpos) + list(body.xmat))
print(json.dumps(out))
";

/// The same by Pinocchio.
const BY_PINOCCHIO: &str = "
import sys, json, numpy, pinocchio
model = pinocchio.buildModelFromUrdf(sys.argv[1], mimic=True)
data = model.createData()
given = json.load(open(sys.argv[2]))
out = []
for row in given['q']:
    q = numpy.zeros(model.nq)
    for name, x in zip(given['joints'], row):
        q[model.joints[model.getJointId(name)].idx_q] = x
    pinocchio.framesForwardKinematics(model, data, q)
    for link in given['links']:
        pose = data.oMf[model.getFrameId(link, pinocchio.FrameType.BODY)]
        out.append(list(pose.translation) + list(pose.rotation.ravel()))
print(json.dumps(out))
";

/// Numbers that a script of Python prints.
pub(crate) fn said(python: &Path, script: &str, file: &str, given: &str) -> Vec<f64> {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    for (name, text) in [
        ("read.py", script),
        ("robot.xml", file),
        ("given.json", given),
    ] {
        std::fs::write(path(name), text).expect("written");
    }
    let ran = Command::new(python)
        .args(["read.py", "robot.xml", "given.json"].map(path))
        .output()
        .expect("Python starts");
    assert!(
        ran.status.success(),
        "{}",
        String::from_utf8_lossy(&ran.stderr)
    );
    String::from_utf8_lossy(&ran.stdout)
        .split(['[', ']', ',', ' ', '\n'])
        .filter_map(|x| x.parse().ok())
        .collect()
}

/// Every link of a robot at 20 postures by another program, against the geometry; the largest difference.
fn differs(python: &Path, script: &str, robot: &Robot, target: Target, r: &mut ChaCha8Rng) -> f64 {
    let model = plain(&robot.file);
    let text = export(robot, target, None, None).expect("written").text;
    let dof = model.joints().len();
    let postures: Vec<Vec<f64>> = (0..20).map(|_| posture(r, dof)).collect();
    let names: Vec<&str> = model.joints().iter().map(|j| j.name.as_str()).collect();
    let links = model.links();
    let given = format!("{{\"q\": {postures:?}, \"joints\": {names:?}, \"links\": {links:?}}}");
    let numbers = said(python, script, &text, &given);
    assert_eq!(numbers.len(), 12 * postures.len() * links.len());
    let mut seen = numbers.chunks(12);
    let mut largest = 0.0_f64;
    for q in &postures {
        for link in links {
            let own = at(&model, model.link(link).expect("there"), q);
            let seen = seen.next().expect("a pose");
            let there = Pose {
                t: Vector3::from_column_slice(&seen[..3]),
                r: Matrix3::from_row_slice(&seen[3..]),
            };
            largest = largest.max(off(&there, &own));
        }
    }
    largest
}

#[test]
fn mujoco_reads_the_mjcf_as_the_geometry() {
    let Some(python) = skipped_tests::checker("mujoco") else {
        return;
    };
    for seed in 0..3 {
        let mut r = rng(seed);
        // Mimic joints are constraints of its simulation, not of its kinematics.
        let mut file = robot(&mut r, 7, true, Effects::All);
        file.joints.iter_mut().for_each(|j| j.mimic = None);
        file.joints
            .iter_mut()
            .for_each(|j| j.effects.retain(|e| e.other.is_none()));
        let off = differs(&python, BY_MUJOCO, &read(file), Target::Mjcf, &mut r);
        assert!(off < 1e-12, "{off:e}");
    }
}

#[test]
fn pinocchio_reads_the_urdf_as_the_geometry() {
    let Some(python) = skipped_tests::checker("pinocchio") else {
        return;
    };
    for seed in 0..3 {
        let mut r = rng(seed);
        let robot = read(robot(&mut r, 7, true, Effects::All));
        let off = differs(&python, BY_PINOCCHIO, &robot, Target::Urdf, &mut r);
        assert!(off < 1e-12, "{off:e}");
    }
}

#[test]
fn sdformat_and_urdfdom_accept_what_is_written() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut r = rng(4);
    let robot = read(robot(&mut r, 7, true, Effects::All));
    for (checker, target, name) in [
        ("sdf", Target::Sdf, "robot.sdf"),
        ("urdf", Target::Urdf, "robot.urdf"),
    ] {
        let Some(program) = skipped_tests::checker(checker) else {
            continue;
        };
        let path = folder.path().join(name);
        let text = export(&robot, target, None, None).expect("written").text;
        std::fs::write(&path, text).expect("written");
        let ran = Command::new(program)
            .arg(&path)
            .output()
            .expect("it starts");
        let said = String::from_utf8_lossy(&ran.stdout).into_owned()
            + &String::from_utf8_lossy(&ran.stderr);
        assert!(ran.status.success(), "{said}");
    }
}

/// Joints that follow others, and the mass of every link, the root's too; masses that the fit assumed are in no file.
#[test]
fn mimics_and_masses_are_in_the_sdf_and_no_masses_that_were_assumed() {
    let mut r = rng(6);
    let mut file = robot(&mut r, 5, true, Effects::All);
    let leader = read(file.clone()).model.joints()[0].name.clone();
    let moves = |j: &&mut calib_model::file::ModelJoint| j.name != leader && j.axis.is_some();
    let follower = file.joints.iter_mut().rfind(moves).expect("one more");
    follower.effects.clear();
    follower.mimic = Some(calib_model::file::ModelMimic {
        joint: leader,
        multiplier: -1.5,
        offset: 0.25,
    });
    for link in &mut file.links {
        (link.mass_kg, link.first_moment_kg_m) = (1.5, [0.0, 0.0, 0.15]);
    }
    let total = 1.5 * file.links.len() as f64;
    let sdf = |file: &RobotModelFile| {
        let text = export(&read(file.clone()), Target::Sdf, None, None)
            .expect("written")
            .text;
        let masses: f64 = roxmltree::Document::parse(&text)
            .expect("XML")
            .descendants()
            .filter(|n| n.has_tag_name("mass"))
            .map(|n| {
                n.text()
                    .expect("a number")
                    .parse::<f64>()
                    .expect("a number")
            })
            .sum();
        (text, masses)
    };
    let (text, masses) = sdf(&file);
    assert!((masses - total).abs() < 1e-9, "{masses} of {total} kg");
    assert!(text.contains("<sdf version=\"1.11\">"), "{text}");
    let document = roxmltree::Document::parse(&text).expect("XML");
    for joint in file.joints.iter().filter(|j| j.mimic.is_some()) {
        let mimic = joint.mimic.as_ref().expect("filtered");
        let of = |n: &roxmltree::Node<'_, '_>| {
            n.has_tag_name("joint") && n.attribute("name") == Some(&joint.name)
        };
        let written = document.descendants().find(of).expect("the joint");
        let written = written
            .descendants()
            .find(|n| n.has_tag_name("mimic"))
            .expect("its mimic");
        assert_eq!(written.attribute("joint"), Some(mimic.joint.as_str()));
        let number = |name: &str| {
            let of = written
                .children()
                .find(|n| n.has_tag_name(name))
                .expect("there");
            of.text()
                .expect("a number")
                .parse::<f64>()
                .expect("a number")
        };
        assert_eq!(
            [number("multiplier"), number("offset"), number("reference")],
            [mimic.multiplier, mimic.offset, 0.0]
        );
    }
    file.masses_assumed = true;
    for target in [Target::Urdf, Target::UrdfBest, Target::Mjcf, Target::Sdf] {
        let text = export(&read(file.clone()), target, None, None)
            .expect("written")
            .text;
        assert!(
            !text.contains("<mass") && !text.contains(" mass="),
            "{text}"
        );
        assert!(text.contains("none are written"), "{text}");
    }
}

#[test]
fn a_point_as_tool_is_a_link_of_what_is_written() {
    let mut r = rng(2);
    let robot = read(robot(&mut r, 6, true, Effects::All));
    let done = export(&robot, Target::Urdf, Some("tip"), None).expect("written");
    assert_eq!(done.tool, "tip");
    let urdf = RobotModel::from_urdf_text(&done.text, "exported").expect("a URDF");
    let model = plain(&robot.file);
    let q = posture(&mut r, model.joints().len());
    let mut by_joint = urdf.zero_positions();
    for (joint, q) in model.joints().iter().zip(&q) {
        by_joint[urdf.joint_id(&joint.name).expect("there").index()] = *q;
    }
    let tip = urdf.link_id("tip").expect("there").index();
    let seen = Pose::of(&urdf.forward_kinematics(&by_joint)[tip]);
    let own = at(&model, model.place("tip").expect("a point"), &q);
    assert!(off(&seen, &own) < 1e-12, "{:e}", off(&seen, &own));
    // A body is no tool, and what is none of them is refused.
    for (name, says) in [
        ("body", "body is not a link or point"),
        ("claw", "claw is not"),
    ] {
        let refused = export(&robot, Target::Urdf, Some(name), None).expect_err("refused");
        assert!(refused.to_string().contains(says), "{refused}");
    }
}

#[test]
fn a_region_of_one_posture_states_no_error() {
    let robot = read(robot(&mut rng(2), 6, false, Effects::All));
    let refused = export(&robot, Target::UrdfBest, None, Some(&[vec![0.0; 6]]));
    let refused = refused.expect_err("refused").to_string();
    assert!(refused.contains("fewer than two postures"), "{refused}");
}

#[test]
fn what_is_lost_is_said_in_the_file() {
    let mut r = rng(9);
    let robot = read(robot(&mut r, 5, false, Effects::Smooth));
    // The others hold certain arms only.
    let any = |t: &Target| !matches!(t, Target::Ur | Target::Opw);
    for target in Target::ALL.into_iter().filter(any) {
        let done = export(&robot, target, None, None).expect("written");
        assert!(
            done.text.contains("Not in this file: gain, eccentricity"),
            "{}",
            done.text
        );
        let rms = format!("{:.3} mm rms", 1e3 * done.cost.rms_m);
        assert!(done.text.contains(&rms), "{rms}\n{}", done.text);
        assert!(done.cost.largest_m > done.cost.rms_m && done.cost.rms_m > 1e-4);
    }
}
