//! Two routes to one number: the robot that the pipeline predicts with, and the solver's own frame graph.

use std::path::Path;

use calib_core::{Configuration, EffectKind, Settings, effect};
use calib_pipeline::estimate::start::start;
use calib_pipeline::formulate::formulation::FreeSet;
use calib_pipeline::formulate::kinematics::joint_state;
use calib_pipeline::formulate::ml::{fit, state};
use calib_pipeline::options::Plugins;
use calib_pipeline::prepare::conditions::Conditions;
use calib_pipeline::prepare::load::{load_recordings, load_robot};
use calib_pipeline::prepare::tracks::body_tracks;
use calib_profile::Free;

/// Rounding of a chain of a dozen rotations.
const SAME: f64 = 1e-12;

#[test]
fn the_calibrated_robot_is_the_solution() {
    for robot in ["ripley", "justin"] {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../../robots/{robot}.yaml"));
        let mut profile = load_robot(&path).expect("shipped");
        // Every effect that exists, so that every term of the prediction is exercised.
        profile.profile.solve.free.extend([
            Free::Effect(&effect::gain::EFFECT),
            Free::Effect(&effect::eccentricity::EFFECT),
            Free::Effect(&effect::lateral_compliance::EFFECT),
        ]);
        let inputs = load_recordings(profile, Plugins::Refused).expect("shipped");
        let mut findings = Vec::new();
        let tracks = body_tracks(&inputs, &mut findings).expect("bodies");
        let start = start(&inputs, &tracks);
        let stated = state(&inputs, &tracks, &start, FreeSet::Profile);
        let fit = fit(stated, &inputs, &Settings::plain()).expect("a problem");
        let model = &inputs.robot.model;
        let masses = &inputs.robot.masses;
        let effects = fit
            .calibration
            .effects
            .iter()
            .filter(|e| e.of(EffectKind::Gain) != 0.0)
            .count();
        assert!(effects >= 4, "{robot}: {effects} joints with a gain");
        for loaded in inputs.recordings.values() {
            let q = loaded.q[loaded.q.len() / 2].as_ref().expect("recorded");
            let loads = masses.at(q);
            let unknown = Conditions::default();
            let mut at = Configuration::zero();
            for joint in model.joint_ids() {
                let Some(edge) = fit.formulation.joints[joint.index()] else {
                    continue;
                };
                at = at.at(edge, &joint_state(model, joint, q, &loads, &unknown));
            }
            let root_from_link = fit.calibration.root_from_link(q);
            for (name, frame) in &fit.formulation.bodies {
                let body = &inputs.robot.profile.bodies[name];
                let predicted = fit.calibration.tracker_from_root
                    * root_from_link[body.link.index()]
                    * fit.calibration.mounts[name];
                let solved = fit
                    .solution
                    .relative_pose(fit.formulation.tracker, *frame, &at)
                    .expect("a path")
                    .pose;
                let difference =
                    (predicted.inverse() * solved).to_homogeneous() - nalgebra::Matrix4::identity();
                assert!(
                    difference.amax() < SAME,
                    "{robot} {name} in {}: {difference}",
                    loaded.name
                );
            }
        }
    }
}

#[test]
fn the_load_of_a_joint_is_what_it_holds_against() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../robots/justin.yaml");
    let robot = load_robot(&path).expect("shipped");
    let mut q = robot.model.zero_positions();
    for (i, q) in q.iter_mut().enumerate() {
        *q = (i as f64 * 0.37).sin();
    }
    let loads = robot.masses.at(&q);
    let held = robot
        .model
        .gravity_torques(&q, &robot.profile.load.gravity());
    for joint in robot.model.independent_joints() {
        let (a, b) = (loads.about_axis[joint.index()], -held[joint.index()]);
        assert!(
            (a - b).abs() < 1e-9 * (1.0 + b.abs()),
            "{}: {a} against {b}",
            robot.model.joint(joint).name
        );
    }
}
