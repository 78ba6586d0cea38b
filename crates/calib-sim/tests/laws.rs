//! Simulated recordings: the same seed gives the same numbers, and without errors and noise they are the kinematics.

use std::path::Path;

use calib_profile::{Error3, Profile, SimNoise, check, parse};
use calib_recording::Poses;
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

/// Standard deviation of what noise adds to one coordinate of the hand's position, per torso position of Justin's `torso_tests`, and of what
/// it adds to the orientation about each axis.
fn scatter(clean: &Poses, noisy: &Poses) -> Vec<(f64, f64)> {
    let pairs = clean.bodies["haT"].iter().zip(&noisy.bodies["haT"]);
    let errors: Vec<(f64, f64)> = pairs
        .map(|(a, b)| {
            let error = a.expect("seen").inverse() * b.expect("seen");
            let angle = error.rotation.scaled_axis().norm_squared();
            (error.translation.vector.norm_squared(), angle)
        })
        .collect();
    let rms = |of: fn(&(f64, f64)) -> f64, group: &[(f64, f64)]| {
        (group.iter().map(of).sum::<f64>() / (3 * group.len()) as f64).sqrt()
    };
    let groups = errors.chunks(errors.len() / 5);
    groups.map(|g| (rms(|e| e.0, g), rms(|e| e.1, g))).collect()
}

/// Justin with this tracker in `torso_tests`, without errors of the robot; 2 000 poses at each of five torso positions.
fn tracked(times: Vec<f64>, noise: SimNoise) -> Poses {
    let (mut profile, model) = shipped("justin");
    let plan = profile.simulate.as_mut().expect("a simulate section");
    plan.errors = Default::default();
    plan.noise = noise;
    let protocol = plan.recordings.get_mut("torso_tests").expect("shipped");
    assert_eq!(protocol.tracker_noise_times, [1.0; 5]);
    protocol.poses = 2000;
    protocol.tracker_noise_times = times;
    let mut simulated = simulate(&profile, &model, None).expect("simulated");
    simulated.recordings.remove("torso_tests").expect("made")
}

#[test]
fn a_factor_scales_the_tracker_s_scatter_where_it_is_stated_and_nowhere_else() {
    let noise = SimNoise {
        body: Error3 {
            position: 4e-4,
            angle: 1e-3,
        },
        ..SimNoise::default()
    };
    let times = vec![1.0, 1.0, 1.0, 3.0, 0.5];
    let clean = tracked(times.clone(), SimNoise::default());
    let noisy = tracked(times.clone(), noise);
    // Standard error of a standard deviation of 6 000 numbers: 1 %; five of them.
    for ((position, angle), times) in scatter(&clean, &noisy).into_iter().zip(&times) {
        assert!(
            (position / (4e-4 * times) - 1.0).abs() < 0.05,
            "{position} {times}"
        );
        assert!(
            (angle / (1e-3 * times) - 1.0).abs() < 0.05,
            "{angle} {times}"
        );
    }
    // Postures and draws stay: where the factor is 1, so does every digit.
    let plain = tracked(vec![1.0; 5], noise);
    assert_eq!(plain.joints, noisy.joints);
    let [plain, noisy] = [&plain, &noisy].map(|poses| &poses.bodies["haT"]);
    assert_eq!(plain[..6000], noisy[..6000]);
    assert_ne!(plain[6000..], noisy[6000..]);
}

#[test]
fn a_factor_of_a_whole_recording_scales_its_markers() {
    let (mut profile, model) = shipped("ripley");
    let seen = |profile: &Profile| simulate(profile, &model, None).expect("simulated");
    let plan = profile.simulate.as_mut().expect("a simulate section");
    let noise = plan.noise;
    plan.noise.marker = 0.0;
    let clean = seen(&profile);
    let plan = profile.simulate.as_mut().expect("a simulate section");
    plan.noise = noise;
    let plain = seen(&profile);
    let plan = profile.simulate.as_mut().expect("a simulate section");
    let protocol = plan.recordings.get_mut("checks").expect("shipped");
    protocol.tracker_noise_times = vec![4.0];
    let worse = seen(&profile);
    for (name, clean) in &clean.recordings {
        let times = if name == "checks" { 4.0 } else { 1.0 };
        for (marker, track) in &clean.markers {
            let [plain, worse] = [&plain, &worse].map(|s| &s.recordings[name].markers[marker]);
            for ((clean, plain), worse) in track.iter().zip(plain).zip(worse) {
                let (Some(clean), Some(plain), Some(worse)) = (clean, plain, worse) else {
                    assert_eq!(
                        plain.is_some(),
                        worse.is_some(),
                        "the same samples are lost"
                    );
                    continue;
                };
                let off = (worse - clean) - (plain - clean) * times;
                assert!(off.norm() < 1e-12, "{name} {marker}: {off}");
            }
        }
    }
}
