//! One forward model in the project: what `calib-model` evaluates is what the solver's graph predicts and what the report's
//! robot does, on robots by chance.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use calib_core::effect::Source;
use calib_core::{Axis, EffectKind, JointState, MarkerObservation, NoiseKind, Problem, Target};
use calib_model::file::{ModelMotion, ModelPose, RobotModelFile};
use calib_model::{Approach, Model, Place, Under};
use calib_pipeline::formulate::kinematics::{Calibration, joint_state};
use calib_pipeline::prepare::conditions::Conditions;
use calib_profile::RobotLoad;
use calib_urdf::RobotModel;
use nalgebra::{Isometry3, Point3, Quaternion, Translation3, Unit, UnitQuaternion, Vector3};
use rand::RngExt as _;

#[path = "../../../calib-model/tests/it/common.rs"]
#[allow(dead_code)]
mod common;

use common::{Effects, WARM, posture, rng, robot};

fn isometry(pose: &ModelPose) -> Isometry3<f64> {
    let [x, y, z, w] = pose.quat_xyzw;
    let turn = UnitQuaternion::new_unchecked(Quaternion::new(w, x, y, z));
    Isometry3::from_parts(Translation3::from(Vector3::from(pose.xyz_m)), turn)
}

/// The nominal robot: names, masses and axes by a URDF, origins as they are in the file.
fn urdf(file: &RobotModelFile) -> RobotModel {
    let mut text = "<robot name=\"robot\">".to_owned();
    for link in &file.links {
        let [x, y, z] = link.first_moment_kg_m.map(|h| h / link.mass_kg);
        let (name, mass) = (&link.name, link.mass_kg);
        let _ = write!(
            text,
            "<link name=\"{name}\"><inertial><origin xyz=\"{x} {y} {z}\"/><mass value=\"{mass}\"/>\
             <inertia ixx=\"1\" iyy=\"1\" izz=\"1\" ixy=\"0\" ixz=\"0\" iyz=\"0\"/></inertial></link>"
        );
    }
    for joint in &file.joints {
        let kind = match joint.motion {
            ModelMotion::Fixed => "fixed",
            ModelMotion::Revolute => "revolute",
            ModelMotion::Prismatic => "prismatic",
        };
        let (name, parent, child) = (&joint.name, &joint.parent, &joint.child);
        let _ = write!(
            text,
            "<joint name=\"{name}\" type=\"{kind}\"><parent link=\"{parent}\"/><child link=\"{child}\"/>"
        );
        if let Some([x, y, z]) = joint.axis {
            let _ = write!(
                text,
                "<axis xyz=\"{x} {y} {z}\"/><limit lower=\"-9\" upper=\"9\" effort=\"1\" velocity=\"1\"/>"
            );
        }
        if let Some(m) = &joint.mimic {
            let (other, multiplier, offset) = (&m.joint, m.multiplier, m.offset);
            let _ = write!(
                text,
                "<mimic joint=\"{other}\" multiplier=\"{multiplier}\" offset=\"{offset}\"/>"
            );
        }
        text.push_str("</joint>");
    }
    text.push_str("</robot>");
    let mut model = RobotModel::from_urdf_text(&text, "robot").expect("a robot");
    for joint in &file.joints {
        let id = model.joint_id(&joint.name).expect("there");
        model = model.with_origin(id, isometry(&joint.load_origin));
    }
    model
}

/// The robot as the report has it.
fn calibration(file: &RobotModelFile) -> Calibration {
    let nominal = urdf(file);
    let mut load = RobotLoad::default();
    for joint in &file.joints {
        let id = nominal.joint_id(&joint.name).expect("there");
        let ratio = joint.effects.iter().find_map(|e| e.gear_ratio);
        let friction = joint.effects.iter().find_map(|e| e.friction);
        load.gear_ratio.extend(ratio.map(|r| (id, r)));
        load.friction.extend(friction.map(|f| (id, f)));
    }
    let place = isometry(&file.tracker_from_root);
    let mut robot = Calibration::nominal(&nominal, &load, place);
    for joint in &file.joints {
        let id = nominal.joint_id(&joint.name).expect("there");
        robot.model = robot
            .model
            .with_origin(id, isometry(&joint.parent_from_joint));
        for effect in &joint.effects {
            let own = &mut robot.effects[id.index()];
            match &effect.other {
                Some(other) => {
                    let other = nominal.joint_id(other).expect("there").index();
                    own.coupling.insert(other, effect.value);
                }
                None => {
                    let kind = EffectKind::all().find(|k| k.term().name == effect.kind);
                    own.coefficients.insert(kind.expect("known"), effect.value);
                }
            }
        }
    }
    robot
}

/// Where the solver's graph has three points of a link in the root, at these readings.
fn by_graph(
    file: &RobotModelFile,
    robot: &Calibration,
    (q, under): (&[f64], &Conditions),
    points: &[Point3<f64>],
) -> Vec<Point3<f64>> {
    let model = &robot.model;
    let loads = robot.masses.at(q);
    let mut problem = Problem::new(1);
    let mut frames = BTreeMap::from([(file.root.clone(), problem.frame(&file.root))]);
    let mut values = Vec::new();
    for joint in &file.joints {
        let id = model.joint_id(&joint.name).expect("there");
        let origin = problem.frame(&format!("{}_origin", joint.name));
        let child = problem.frame(&joint.child);
        let at = isometry(&joint.parent_from_joint);
        let name = format!("{}.origin", joint.name);
        problem.known(&name, frames[&joint.parent], origin, at);
        frames.insert(joint.child.clone(), child);
        let Some(axis) = joint.axis.map(|a| Unit::new_unchecked(Vector3::from(a))) else {
            problem.known(&joint.name, origin, child, Isometry3::identity());
            continue;
        };
        let axis = match joint.motion {
            ModelMotion::Prismatic => Axis::Prismatic(axis),
            _ => Axis::Revolute(axis),
        };
        let state = joint_state(model, id, q, &loads, under);
        let edge = problem.joint(&joint.name, origin, child, axis, vec![state.q]);
        problem.joint_reach(edge, robot.masses.reach()[id.index()]);
        let effects = &robot.effects[id.index()];
        for (kind, value) in &effects.coefficients {
            problem.free_effect_at(edge, *kind, &[state], None);
            values.push(*value);
        }
        for (other, value) in &effects.coupling {
            let coupled = JointState {
                other: q[*other],
                ..state
            };
            problem.free_effect_at(edge, EffectKind::Coupling, &[coupled], None);
            values.push(*value);
        }
    }
    let end = frames[&file.joints[file.joints.len() - 1].child];
    let known: Vec<_> = points
        .iter()
        .enumerate()
        .map(|(i, p)| problem.known_point(&format!("p{i}"), end, *p))
        .collect();
    let root = frames[&file.root];
    // A problem needs something that was measured; it is not looked at.
    let noise = problem.noise_group("markers", NoiseKind::Position, 1e-3, false);
    let position = Point3::origin();
    let seen = MarkerObservation {
        sample: 0,
        point: known[0],
        position,
        shape: None,
    };
    problem.markers("end", root, end, noise, vec![seen]);
    let graph = calib_core::Model::new(&problem).expect("a problem");
    let values = calib_core::Values(values);
    let of = |point| graph.linear_points(&values, (root, Target::Point(point)), 0..1);
    known
        .iter()
        .map(|p| of(*p).expect("a path")[0].position)
        .collect()
}

#[test]
fn the_library_the_solver_and_the_report_have_one_forward_model() {
    /// m, of chains of up to 2 m with seven rotations in matrices or quaternions.
    const SAME: f64 = 1e-13;
    let points = [[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.1, 0.2]].map(Point3::from);
    let mut worst = [0.0_f64; 2];
    for seed in 0..1000 {
        let mut r = rng(seed);
        let n = r.random_range(1..8);
        let file = robot(&mut r, n, seed % 2 == 0, Effects::All);
        let robot = calibration(&file);
        let model = Model::new(&file).expect("a model");
        let (mut work, mut approach) = (model.work(), Approach::new(&model));
        let end = &file.joints[n - 1].child;
        let place = Place::from(model.link(end).expect("there"));
        let mut before: Option<Vec<f64>> = None;
        for _ in 0..2 {
            let own = posture(&mut r, model.joints().len());
            let mut q = robot.model.zero_positions();
            let mut under = Conditions {
                approach: q.clone(),
                torque: None,
                warmth: q.clone(),
            };
            approach.update(&model, &own).expect("finite");
            for (k, joint) in model.joints().iter().enumerate() {
                let id = robot.model.joint_id(&joint.name).expect("there").index();
                q[id] = own[k];
                under.warmth[id] = WARM[k] - 20.0;
                under.approach[id] = before.as_ref().map_or(0.0, |b| (own[k] - b[k]).signum());
            }
            for id in robot.model.joint_ids() {
                let source = robot.model.joint(id).law.source;
                under.warmth[id.index()] = under.warmth[source.index()];
            }
            before = Some(own.clone());
            let given = Under {
                approach: approach.directions(),
                held: None,
                temperature_c: &WARM[..model.joints().len()],
            };
            model.forward(&own, &given, &mut work).expect("poses");
            let here = model.root_from(place, &work).expect("a place");
            let by_graph = by_graph(&file, &robot, (&q, &under), &points);
            let link = robot.model.link_id(end).expect("there");
            let report = robot.root_from_link_under(&q, &under)[link.index()];
            for (p, seen) in points.iter().zip(by_graph) {
                let own = here.r * p.coords + here.t;
                worst[0] = worst[0].max((own - seen.coords).norm());
                worst[1] = worst[1].max((own - (report * p).coords).norm());
            }
        }
    }
    println!(
        "largest difference: solver {:e} m, report {:e} m",
        worst[0], worst[1]
    );
    assert!(worst[0] < SAME && worst[1] < SAME, "{worst:?}");
}

#[test]
fn every_effect_is_among_those_that_are_compared() {
    let mut r = rng(2);
    let file = robot(&mut r, 7, false, Effects::All);
    let there = |name: &str| {
        file.joints
            .iter()
            .any(|j| j.effects.iter().any(|e| e.kind == name))
    };
    for kind in EffectKind::all() {
        let term = kind.term();
        let of_robot = !matches!(term.source, Source::Velocity | Source::Caller);
        assert_eq!(there(term.name), of_robot, "{}", term.name);
    }
}
