//! Every format read back by something that did not write it, over postures by chance.

use std::process::Command;

use calib_export::{Robot, Target, export};
use calib_model::file::RobotModelFile;
use calib_model::{LinkId, Model, Pose, Under};
use calib_urdf::RobotModel;
use nalgebra::{Matrix4, Vector3};

use crate::common::{Effects, posture, rng, robot};

fn read(file: RobotModelFile) -> Robot {
    Robot {
        model: Model::new(&file).expect("a model"),
        file,
    }
}

/// The robot's geometry alone: no effect but zero offsets.
fn plain(file: &RobotModelFile) -> Model {
    let mut file = file.clone();
    for joint in &mut file.joints {
        joint.effects.retain(|e| e.kind == "offset");
    }
    Model::new(&file).expect("a model")
}

fn at(model: &Model, link: LinkId, q: &[f64]) -> Pose {
    let mut work = model.work();
    model
        .forward(q, &Under::default(), &mut work)
        .expect("poses");
    work.root_from_link(link)
}

fn off(a: &Pose, b: &Pose) -> f64 {
    (a.t - b.t).norm() + (a.r - b.r).norm()
}

#[test]
fn urdf_is_the_geometry_to_its_nine_decimals() {
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
                assert!(off(&seen, &own) < 2e-8, "{k} {:e}", off(&seen, &own));
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

fn list(text: &str, key: &str) -> Vec<f64> {
    let at = text.find(&format!("{key}: [")).expect(key) + key.len() + 3;
    let end = text[at..].find(']').expect("an end") + at;
    text[at..end]
        .split(", ")
        .map(|x| x.parse().expect("a number"))
        .collect()
}

fn matrix(rows: &[f64]) -> Matrix4<f64> {
    let mut out = Matrix4::identity();
    for i in 0..3 {
        for k in 0..4 {
            out[(i, k)] = rows[4 * i + k];
        }
    }
    out
}

/// Elementary matrices, as in a textbook.
fn turned(axis: usize, angle: f64) -> Matrix4<f64> {
    let (s, c) = angle.sin_cos();
    let mut out = Matrix4::identity();
    let (i, k) = ((axis + 1) % 3, (axis + 2) % 3);
    (out[(i, i)], out[(i, k)], out[(k, i)], out[(k, k)]) = (c, -s, s, c);
    out
}

fn moved(axis: usize, by: f64) -> Matrix4<f64> {
    Matrix4::new_translation(&Vector3::ith(axis, by))
}

#[test]
fn tables_of_parameters_are_the_geometry_by_their_own_formulas() {
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
        let tool = model.last_link();
        for target in [Target::Dh, Target::Hayati, Target::Poe] {
            let text = export(&robot, target, None, None).expect("written").text;
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

/// Poses of a link at positions by MuJoCo.
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
    body = data.body(given['link'])
    out.append(list(body.xpos) + list(body.xmat))
print(json.dumps(out))
";

#[test]
fn mujoco_reads_the_mjcf_as_the_geometry() {
    let Some(python) = skipped_tests::checker("mujoco") else {
        return;
    };
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    std::fs::write(path("read.py"), BY_MUJOCO).expect("written");
    for seed in 0..3 {
        let mut r = rng(seed);
        // Mimic joints are constraints of its simulation, not of its kinematics.
        let mut file = robot(&mut r, 7, true, Effects::All);
        file.joints.iter_mut().for_each(|j| j.mimic = None);
        file.joints
            .iter_mut()
            .for_each(|j| j.effects.retain(|e| e.other.is_none()));
        let robot = read(file);
        let model = plain(&robot.file);
        let text = export(&robot, Target::Mjcf, None, None)
            .expect("written")
            .text;
        std::fs::write(path("robot.xml"), text).expect("written");
        let postures: Vec<Vec<f64>> = (0..20)
            .map(|_| posture(&mut r, model.joints().len()))
            .collect();
        let tool = model.last_link();
        let names: Vec<&str> = model.joints().iter().map(|j| j.name.as_str()).collect();
        let given = format!(
            "{{\"q\": {postures:?}, \"joints\": {names:?}, \"link\": {:?}}}",
            model.links()[tool.index()]
        );
        std::fs::write(path("given.json"), given).expect("written");
        let ran = Command::new(&python)
            .args([path("read.py"), path("robot.xml"), path("given.json")])
            .output()
            .expect("Python starts");
        assert!(
            ran.status.success(),
            "{}",
            String::from_utf8_lossy(&ran.stderr)
        );
        let text = String::from_utf8_lossy(&ran.stdout);
        let numbers: Vec<f64> = text
            .split(['[', ']', ',', ' ', '\n'])
            .filter_map(|x| x.parse().ok())
            .collect();
        assert_eq!(numbers.len(), 12 * postures.len());
        for (q, seen) in postures.iter().zip(numbers.chunks(12)) {
            let own = at(&model, tool, q);
            for k in 0..3 {
                assert!(
                    (seen[k] - own.t[k]).abs() < 1e-10,
                    "{} {}",
                    seen[k],
                    own.t[k]
                );
                for c in 0..3 {
                    assert!((seen[3 + 3 * k + c] - own.r[(k, c)]).abs() < 1e-10);
                }
            }
        }
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

#[test]
fn what_is_lost_is_said_in_the_file() {
    let mut r = rng(9);
    let robot = read(robot(&mut r, 5, false, Effects::Smooth));
    for target in [
        Target::Urdf,
        Target::UrdfBest,
        Target::Dh,
        Target::Hayati,
        Target::Poe,
        Target::Mjcf,
        Target::Sdf,
    ] {
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
