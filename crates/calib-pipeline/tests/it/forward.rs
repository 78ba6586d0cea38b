//! One forward model: the robot that predicts, reports and exports is the solver's own, on random robots with random
//! effects.

use std::fmt::Write as _;

use calib_core::effect::Source;
use calib_core::{
    Chart, EFFECTS, EffectKind, JointState, Model, NoiseKind, PoseNoise, PoseObservation, Problem,
};
use calib_pipeline::formulate::kinematics::{Calibration, joint_state, motion_axis};
use calib_pipeline::prepare::conditions::Conditions;
use calib_profile::RobotLoad;
use calib_urdf::{JointId, RobotModel};
use nalgebra::{Isometry3, Translation3, UnitQuaternion};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// m and rad.
const SAME: f64 = 1e-13;
/// Postures of one robot.
const SAMPLES: usize = 6;

/// A chain of joints of both kinds with masses.
fn robot(r: &mut ChaCha8Rng) -> RobotModel {
    let mut text = String::from("<robot name=\"r\">\n  <link name=\"l0\"/>\n");
    for i in 1..=r.random_range(3..8) {
        let mut n = || r.random_range(-0.5..0.5);
        let _ = writeln!(
            text,
            "  <link name=\"l{i}\"><inertial><origin xyz=\"{} {} {}\"/><mass value=\"{}\"/>\
             <inertia ixx=\"1\" iyy=\"1\" izz=\"1\" ixy=\"0\" ixz=\"0\" iyz=\"0\"/></inertial></link>",
            n(),
            n(),
            n(),
            1.0 + n()
        );
        let kind = if n() > 0.3 { "prismatic" } else { "revolute" };
        let _ = writeln!(
            text,
            "  <joint name=\"j{i}\" type=\"{kind}\"><parent link=\"l{}\"/><child link=\"l{i}\"/>\
             <origin xyz=\"{} {} {}\" rpy=\"{} {} {}\"/><axis xyz=\"{} {} {}\"/>\
             <limit lower=\"-3\" upper=\"3\" effort=\"1\" velocity=\"1\"/></joint>",
            i - 1,
            n(),
            n(),
            n(),
            n(),
            n(),
            n(),
            n(),
            n(),
            1.0 + n()
        );
    }
    text.push_str("</robot>\n");
    RobotModel::from_urdf_text(&text, "random").expect("a robot")
}

/// The robot with a coefficient for every effect at every joint.
fn calibrated(model: &RobotModel, r: &mut ChaCha8Rng) -> Calibration {
    let place = Isometry3::from_parts(
        Translation3::new(0.4, -0.2, 0.9),
        UnitQuaternion::from_euler_angles(0.1, 0.2, 0.7),
    );
    let mut load = RobotLoad::default();
    for joint in model.joint_ids() {
        load.gear_ratio.insert(joint, r.random_range(20.0..120.0));
        load.friction.insert(joint, r.random_range(0.0..5.0));
    }
    let mut robot = Calibration::nominal(model, &load, place);
    for joint in model.joint_ids() {
        let Some(axis) = motion_axis(model, joint) else {
            continue;
        };
        let effects = &mut robot.effects[joint.index()];
        for effect in EFFECTS.iter().filter(|e| e.applies_to(&axis)) {
            for term in effect.terms {
                let c = r.random_range(-0.02..0.02);
                match term.source {
                    Source::Velocity | Source::Caller => {}
                    Source::OtherJoint => {
                        let other = (joint.index() + 1) % model.joints().len();
                        effects.coupling.insert(other, c);
                    }
                    _ => {
                        effects.coefficients.insert(term.kind, c);
                    }
                }
            }
        }
    }
    robot
}

/// Adds one joint with the coefficients of `robot` as start values.
fn add_joint(
    p: &mut Problem,
    robot: &Calibration,
    joint: JointId,
    rows: &[(Vec<f64>, Conditions)],
    frames: &[calib_core::FrameId],
) {
    let model = &robot.model;
    let j = model.joint(joint);
    let (parent, child) = (frames[j.parent.index()], frames[j.child.index()]);
    let origin = p.frame(&format!("{}.origin", j.name));
    p.unknown(
        &format!("{}.place", j.name),
        parent,
        origin,
        j.parent_link_from_joint,
        Chart::none(),
    );
    let axis = motion_axis(model, joint).expect("it moves");
    let states: Vec<JointState> = rows
        .iter()
        .map(|(q, under)| {
            joint_state(
                model,
                joint,
                q,
                &robot.masses.under(q, under.torque.as_deref()),
                under,
            )
        })
        .collect();
    let q = states.iter().map(|s| s.q).collect();
    let edge = p.joint(&j.name, origin, child, axis, q);
    p.joint_reach(edge, robot.masses.reach()[joint.index()]);
    let effects = &robot.effects[joint.index()];
    for (kind, c) in &effects.coefficients {
        let id = p.free_effect_at(edge, *kind, &states, None);
        p.parameter_mut(id).start = *c;
    }
    for (other, c) in &effects.coupling {
        let values = rows.iter().map(|(q, _)| q[*other]).collect();
        let id = p.free_effect_with(edge, EffectKind::Coupling, values, None);
        p.parameter_mut(id).start = *c;
    }
}

#[test]
fn the_predicted_pose_of_every_link_is_the_solver_s() {
    for seed in 0..30 {
        let mut r = ChaCha8Rng::seed_from_u64(seed);
        let model = robot(&mut r);
        let calibration = calibrated(&model, &mut r);
        let n = model.joints().len();
        let rows: Vec<(Vec<f64>, Conditions)> = (0..SAMPLES)
            .map(|k| {
                let mut draw = |size: f64| (0..n).map(|_| r.random_range(-size..size)).collect();
                let q: Vec<f64> = draw(1.5);
                let approach: Vec<f64> = draw(1.0);
                let torque = (k % 2 == 0).then(|| draw(10.0));
                let approach = approach.iter().map(|a| f64::signum(*a)).collect();
                let warmth = draw(15.0);
                let under = Conditions {
                    approach,
                    torque,
                    warmth,
                };
                (q, under)
            })
            .collect();
        let mut p = Problem::new(SAMPLES);
        let tracker = p.frame("tracker");
        let frames: Vec<_> = model.links().iter().map(|l| p.frame(&l.name)).collect();
        let root = frames[model.root().index()];
        p.known("place", tracker, root, calibration.tracker_from_root);
        for joint in model.joint_ids() {
            add_joint(&mut p, &calibration, joint, &rows, &frames);
        }
        let group = p.noise_group("one", NoiseKind::Scale, 1.0, false);
        let noise = PoseNoise::Split {
            orientation: group,
            position: group,
        };
        let predicted: Vec<Vec<Isometry3<f64>>> = rows
            .iter()
            .map(|(q, under)| calibration.root_from_link_under(q, under))
            .collect();
        for (link, frame) in model.link_ids().zip(&frames) {
            let seen = predicted.iter().enumerate().map(|(sample, poses)| {
                let pose = calibration.tracker_from_root * poses[link.index()];
                PoseObservation {
                    sample,
                    pose,
                    inverse: false,
                }
            });
            p.poses(
                &model.link(link).name,
                tracker,
                *frame,
                noise,
                seen.collect(),
            );
        }
        let solver = Model::new(&p).expect("a problem");
        let worst = solver.residuals(&solver.start()).amax();
        assert!(worst < SAME, "robot {seed}: {worst:.1e}");
    }
}
