//! Simulated recordings: the same seed gives the same numbers, and without errors and noise they are the kinematics.

use std::path::Path;

use calib_profile::{Profile, check, parse};
use calib_sim::simulate;
use calib_urdf::RobotModel;

fn shipped(robot: &str) -> (Profile, RobotModel) {
    let robots = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../robots");
    let text = std::fs::read_to_string(robots.join(format!("{robot}.yaml"))).expect("shipped");
    let raw = parse(&text, robot).expect("a profile");
    let model = RobotModel::from_urdf_file(&robots.join(&raw.robot.urdf)).expect("a robot");
    (
        check(&raw, &text, robot, &model).expect("a good profile"),
        model,
    )
}

#[test]
fn an_arm_that_gives_way_sags() {
    let (mut profile, model) = shipped("justin");
    let plan = profile.simulate.as_mut().expect("a simulate section");
    let compliance = plan.errors.compliance.clone();
    assert!(compliance.values().all(|c| *c > 0.0));
    plan.errors = Default::default();
    plan.noise = Default::default();
    let seen = |profile: &Profile| simulate(profile, &model, None).expect("simulated");
    let stiff = seen(&profile);
    let plan = profile.simulate.as_mut().expect("a simulate section");
    plan.errors.compliance = compliance;
    let up = plan.tracker_from_root * nalgebra::Vector3::z();
    let soft = seen(&profile);
    let (stiff, soft) = (
        &stiff.recordings["arm_poses"],
        &soft.recordings["arm_poses"],
    );
    let heights = stiff.bodies["haT"].iter().zip(&soft.bodies["haT"]);
    let sags: Vec<f64> = heights
        .map(|(stiff, soft)| {
            let [stiff, soft] = [stiff, soft].map(|p| p.expect("in view").translation.vector);
            up.dot(&(stiff - soft))
        })
        .collect();
    // Lower by some millimeters on average, and never higher by more than a joint that swings through can lift it.
    let mean = sags.iter().sum::<f64>() / sags.len() as f64;
    assert!(mean > 2e-3, "{mean}");
    let higher = sags.iter().filter(|s| **s < 0.0).count();
    assert!(higher * 10 < sags.len(), "{higher} of {}", sags.len());
}

#[test]
fn the_seed_decides_everything() {
    let (profile, model) = shipped("ripley");
    let run = |seed| simulate(&profile, &model, Some(seed)).expect("a simulate section");
    let (a, b, c) = (run(5), run(5), run(6));
    assert_eq!(a.recordings, b.recordings);
    assert_eq!(a.truth, b.truth);
    assert_ne!(
        a.recordings["checks"].markers,
        c.recordings["checks"].markers
    );
    assert_ne!(a.truth.joint_offsets_rad, c.truth.joint_offsets_rad);
}

#[test]
fn without_errors_and_noise_the_tracker_sees_the_kinematics() {
    for robot in ["ripley", "justin"] {
        let (mut profile, model) = shipped(robot);
        let plan = profile.simulate.as_mut().expect("a simulate section");
        plan.errors = Default::default();
        plan.noise = Default::default();
        let plan = plan.clone();
        let simulated = simulate(&profile, &model, None).expect("simulated");
        let mut seen = 0;
        for poses in simulated.recordings.values() {
            for row in 0..poses.len() {
                let mut q = model.zero_positions();
                for (joint, column) in &poses.joints {
                    q[model.joint_id(joint).expect("known").index()] =
                        column[row].expect("recorded");
                }
                let root_from_link = model.forward_kinematics(&q);
                for (name, body) in &profile.bodies {
                    let mount = &plan.mounts[name];
                    let expected = plan.tracker_from_root
                        * root_from_link[body.link.index()]
                        * mount.link_from_body;
                    if let Some(track) = poses.bodies.get(name) {
                        let seen_pose = track[row].expect("nothing is occluded");
                        let difference = (expected.inverse() * seen_pose).to_homogeneous()
                            - nalgebra::Matrix4::identity();
                        assert!(difference.amax() < 1e-12, "{robot} {name}: {difference}");
                        seen += 1;
                    }
                    for (marker, p) in &mount.markers {
                        let point = poses.markers[marker][row].expect("nothing is occluded");
                        assert!((point - expected * p).norm() < 1e-12, "{robot} {marker}");
                        seen += 1;
                    }
                }
            }
        }
        assert!(seen > 200, "{robot}: {seen}");
    }
}

#[test]
fn noise_has_the_stated_size() {
    let (mut profile, model) = shipped("ripley");
    let plan = profile.simulate.as_mut().expect("a simulate section");
    plan.errors = Default::default();
    plan.noise = Default::default();
    let clean = simulate(&profile, &model, None).expect("simulated");
    let plan = profile.simulate.as_mut().expect("a simulate section");
    plan.noise.marker = 3e-4;
    let noisy = simulate(&profile, &model, None).expect("simulated");
    let mut squares = Vec::new();
    for (name, poses) in &clean.recordings {
        for (marker, track) in &poses.markers {
            for (a, b) in track.iter().zip(&noisy.recordings[name].markers[marker]) {
                let d = a.expect("seen") - b.expect("seen");
                squares.extend(d.iter().map(|x| x * x));
            }
        }
    }
    let n = squares.len() as f64;
    let sigma = (squares.iter().sum::<f64>() / n).sqrt();
    // Standard error of a standard deviation: σ/√(2n); five of them.
    assert!(
        (sigma / 3e-4 - 1.0).abs() < 5.0 / (2.0 * n).sqrt(),
        "{sigma} from {n}"
    );
}
