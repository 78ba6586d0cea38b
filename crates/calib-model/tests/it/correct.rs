//! Corrected commands on robots whose truth is known, and their bounds.

use calib_model::file::RobotModelFile;
use calib_model::nalgebra::{Isometry3, Quaternion, UnitQuaternion, Vector3};
use calib_model::{Aim, Model, Options, Outcome, Pose, Under};
use rand::RngExt as _;
use rand_chacha::ChaCha8Rng;

use crate::common::{Effects, WARM, pose, posture, rng, robot, vector, within};

/// The same robot as a calibration finds it: every coefficient wrong by up to 5 %, every origin by up to 0.05 mm and 0.1 mrad.
fn found(truth: &RobotModelFile, r: &mut ChaCha8Rng) -> RobotModelFile {
    let mut file = truth.clone();
    for joint in &mut file.joints {
        let [x, y, z, w] = joint.parent_from_joint.quat_xyzw;
        let turn = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
        let at = Isometry3::from_parts(Vector3::from(joint.parent_from_joint.xyz_m).into(), turn);
        joint.parent_from_joint = pose(&(at * Isometry3::new(vector(r, 5e-5), vector(r, 1e-4))));
        for effect in &mut joint.effects {
            effect.value *= 1.0 + within(r, 0.05);
        }
    }
    file
}

fn distance(a: &Pose, b: &Pose) -> f64 {
    (a.t - b.t).norm()
}

#[test]
fn the_true_tool_error_becomes_the_error_of_the_prediction() {
    let (mut before, mut after, mut predicted, mut used) = (0.0, 0.0, 0.0, 0);
    for seed in 0..60 {
        let mut r = rng(seed);
        let truth = robot(&mut r, 6 + (seed % 2) as usize, false, Effects::All);
        let model = Model::new(&found(&truth, &mut r)).expect("a model");
        let truth = Model::new(&truth).expect("a model");
        let dof = truth.joints().len();
        let (mut own, mut work) = (model.work(), truth.work());
        let tool = truth.last_link();
        for _ in 0..20 {
            let q = posture(&mut r, dof);
            let approach: Vec<f64> = (0..dof).map(|_| within(&mut r, 1.0).signum()).collect();
            let under = Under {
                approach: &approach,
                held: None,
                temperature_c: &WARM[..model.joints().len()],
            };
            let mut command = vec![0.0; dof];
            let done = model
                .correct(
                    &q,
                    tool,
                    &Options::default(),
                    &under,
                    &mut own,
                    &mut command,
                )
                .expect("a correction");
            if done.outcome != Outcome::Reached {
                continue;
            }
            used += 1;
            truth.forward_nominal(&q, &mut work).expect("poses");
            let wanted = work.root_from_link(tool);
            truth.forward(&q, &under, &mut work).expect("poses");
            before += distance(&work.root_from_link(tool), &wanted).powi(2);
            truth.forward(&command, &under, &mut work).expect("poses");
            let there = work.root_from_link(tool);
            after += distance(&there, &wanted).powi(2);
            model.forward(&command, &under, &mut own).expect("poses");
            predicted += distance(&own.root_from_link(tool), &there).powi(2);
        }
    }
    let rms = |sum: f64| (sum / f64::from(used)).sqrt();
    let (before, after, predicted) = (rms(before), rms(after), rms(predicted));
    println!(
        "{used} of 1200: {before:.2e} m before, {after:.2e} m after, {predicted:.2e} m of the prediction"
    );
    // The others are near singular postures, and marked.
    assert!(used > 1000, "{used}");
    assert!(
        after <= 1.2 * predicted && 5.0 * after <= before,
        "{before:e} {after:e} {predicted:e}"
    );
}

#[test]
fn five_steps_reach_the_tolerance() {
    let mut r = rng(7);
    let model = Model::new(&robot(&mut r, 7, false, Effects::All)).expect("a model");
    let mut work = model.work();
    let (tool, mut steps, mut reached) = (model.last_link(), 0, 0);
    for _ in 0..500 {
        let q = posture(&mut r, 7);
        let mut command = [0.0; 7];
        let done = model
            .correct(
                &q,
                tool,
                &Options::default(),
                &Under::default(),
                &mut work,
                &mut command,
            )
            .expect("a correction");
        if done.outcome == Outcome::Reached {
            assert!(done.after_m <= 1e-9 && done.after_rad <= 1e-8);
            reached += 1;
            steps = steps.max(done.iterations);
        }
    }
    assert!(reached >= 475 && steps <= 5, "{reached} {steps}");
}

/// Postures at random, singular ones among them: no command is further from what was desired than the bound, and none that is used
/// brings the tool further away.
fn bounded(targets: usize) {
    let mut refused = 0;
    let mut r = rng(11);
    for _ in 0..targets / 100 {
        let n = r.random_range(1..9);
        let mixed = r.random_bool(0.5);
        let model = Model::new(&robot(&mut r, n, mixed, Effects::All)).expect("a model");
        let dof = model.joints().len();
        let (mut work, tool) = (model.work(), model.last_link());
        let mut command = vec![0.0; dof];
        let aim = if r.random_bool(0.5) {
            Aim::Pose
        } else {
            Aim::Position
        };
        let options = Options {
            aim,
            ..Options::default()
        };
        for k in 0..100 {
            let mut q = posture(&mut r, dof);
            if k % 4 == 0 {
                // Where axes are often parallel or meet; and far away.
                q.iter_mut()
                    .for_each(|q| *q = [0.0, 1e-9, 3.0, -3.1, 100.0][r.random_range(0..5)]);
            }
            let done = model
                .correct(
                    &q,
                    tool,
                    &options,
                    &Under::default(),
                    &mut work,
                    &mut command,
                )
                .expect("a correction");
            for (i, joint) in model.joints().iter().enumerate() {
                let bound = if joint.prismatic {
                    options.largest_m
                } else {
                    options.largest_rad
                };
                let step = (command[i] - q[i]).abs();
                assert!(step <= bound && command[i].is_finite(), "{step} {done:?}");
            }
            let weigh = |m: f64, rad: f64| m.hypot(options.lever_m * rad);
            let (before, after) = (
                weigh(done.before_m, done.before_rad),
                weigh(done.after_m, done.after_rad),
            );
            assert!(
                after <= before && (done.outcome.is_usable() || command == q),
                "{done:?}"
            );
            refused += usize::from(!done.outcome.is_usable());
        }
    }
    println!("{refused} of {targets} refused");
}

#[test]
fn no_command_is_wild() {
    bounded(10_000);
}

#[test]
#[ignore = "a million targets: about half a minute"]
fn no_command_of_a_million_is_wild() {
    bounded(1_000_000);
}

#[test]
fn a_stretched_arm_is_marked_and_bounded() {
    // Two parallel joints and a tool that is wanted outside of their reach.
    let mut file: RobotModelFile =
        RobotModelFile::from_json(include_str!("arm.model.json").as_bytes()).expect("a file");
    file.joints[1].parent_from_joint.xyz_m[0] = 0.49;
    let model = Model::new(&file).expect("a model");
    let mut work = model.work();
    let tool = model.link("tool").expect("a link");
    let options = Options {
        aim: Aim::Position,
        ..Options::default()
    };
    let mut command = [0.0; 2];
    let done = model
        .correct(
            &[0.0, 0.0],
            tool,
            &options,
            &Under::default(),
            &mut work,
            &mut command,
        )
        .expect("a correction");
    assert!(
        matches!(done.outcome, Outcome::Nearer | Outcome::NotReached),
        "{done:?}"
    );
    assert!(done.after_m > 8e-3 && done.step <= 0.1, "{done:?}");
    // Beyond its limits nothing is commanded.
    file.joints[0].limits = Some([-2.0, 0.3]);
    let model = Model::new(&file).expect("a model");
    let done = model
        .correct(
            &[0.3, 1.0],
            tool,
            &options,
            &Under::default(),
            &mut work,
            &mut command,
        )
        .expect("a correction");
    match done.outcome {
        Outcome::BeyondLimits(0) => assert_eq!(command, [0.3, 1.0]),
        _ => assert!(command[0] <= 0.3, "{done:?}"),
    }
    // Outside of the fitted range it is marked.
    let coarse = Options {
        tolerance_m: 1e-3,
        ..options
    };
    let done = Model::from_json(include_str!("arm.model.json").as_bytes())
        .expect("a model")
        .correct(
            &[1.7, 1.0],
            tool,
            &coarse,
            &Under::default(),
            &mut work,
            &mut command,
        )
        .expect("a correction");
    assert_eq!(done.outcome, Outcome::OutOfScope(0));
}

#[test]
fn the_inverse_finds_what_the_forward_gave() {
    let mut reached = 0;
    for seed in 0..40 {
        let mut r = rng(200 + seed);
        let model = Model::new(&robot(&mut r, 7, false, Effects::All)).expect("a model");
        let (mut work, tool) = (model.work(), model.last_link());
        let q = posture(&mut r, 7);
        model
            .forward(&q, &Under::default(), &mut work)
            .expect("poses");
        let wanted = work.root_from_link(tool);
        let seed: Vec<f64> = q.iter().map(|q| q + within(&mut r, 0.3)).collect();
        let mut out = [0.0; 7];
        let done = model
            .ik(
                &wanted,
                &seed,
                tool,
                &Options::inverse(),
                &Under::default(),
                (&mut work, &mut out),
            )
            .expect("a position");
        if matches!(done.outcome, Outcome::Reached | Outcome::OutOfScope(_)) {
            model
                .forward(&out, &Under::default(), &mut work)
                .expect("poses");
            assert!(distance(&work.root_from_link(tool), &wanted) < 2e-9);
            reached += 1;
        }
    }
    assert!(reached >= 36, "{reached}");
}

/// A limit on the way to the target stops the joint, not the correction.
#[test]
fn a_limit_on_the_way_is_kept_and_the_tool_comes_nearer() {
    let text = include_str!("arm.model.json");
    let free = Model::from_json(text.as_bytes()).expect("a model");
    let options = Options {
        aim: Aim::Position,
        ..Options::default()
    };
    let corrected = |model: &Model, q: &[f64]| {
        let (mut work, mut command) = (model.work(), vec![0.0; q.len()]);
        let tool = model.link("tool").expect("a link");
        let done = model.correct(
            q,
            tool,
            &options,
            &Under::default(),
            &mut work,
            &mut command,
        );
        (done.expect("a correction"), command)
    };
    let (mut tried, mut nearer) = (0, 0);
    for k in 0..40 {
        let q = [0.3 + 0.01 * f64::from(k), 1.2 - 0.015 * f64::from(k)];
        let (done, command) = corrected(&free, &q);
        let joint = usize::from((command[1] - q[1]).abs() > (command[0] - q[0]).abs());
        let half = (command[joint] - q[joint]).abs() / 2.0;
        if !done.outcome.is_usable() || half < 1e-6 {
            continue;
        }
        let mut file = RobotModelFile::from_json(text.as_bytes()).expect("a file");
        file.joints[joint].limits = Some([q[joint] - half, q[joint] + half]);
        let (kept, command) = corrected(&Model::new(&file).expect("a model"), &q);
        tried += 1;
        nearer += usize::from(kept.outcome == Outcome::Nearer && kept.after_m < kept.before_m);
        assert!((command[joint] - q[joint]).abs() <= half + 1e-9, "{kept:?}");
    }
    assert!(tried >= 20, "{tried}");
    assert!(10 * nearer >= 9 * tried, "{nearer} of {tried}");
}
