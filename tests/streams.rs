//! Recordings with time, from two machines with two clocks: Ripley simulated, written as two files, run to the truth.

use crate::scratch;
use crate::truth;

use std::collections::BTreeMap;

use calib_pipeline::prepare::load::{RobotProfile, load_robot};
use calib_recording::{WriteOptions, write_poses};
use calib_sim::{Motion, StreamPlan, Streams, simulate_streams};
use scratch::{Scratch, root};
use serde_json::Value;
use truth::{CHI2_99_SIX, Truth, errors};

/// Seed of the shipped recordings: the streams are of the same robot.
const SEED: u64 = 17;
const OFFSET: f64 = 3.9;
const DRIFT: f64 = 50e-6;

fn ripley() -> RobotProfile {
    load_robot(&root().join("robots/ripley.yaml")).expect("shipped")
}

fn plan(robot: &RobotProfile, motion: Motion, duration: f64) -> StreamPlan {
    let ranges: BTreeMap<&str, (f64, f64)> = [
        ("waist", (-70.0, 170.0)),
        ("shoulder", (-100.0, 20.0)),
        ("elbow", (-20.0, 120.0)),
        ("wrist_pitch", (-90.0, 90.0)),
        ("wrist_roll", (-100.0, 100.0)),
    ]
    .into();
    StreamPlan {
        motion,
        ranges: ranges
            .into_iter()
            .map(|(joint, (low, high))| {
                let id = robot.model.joint_id(joint).expect("of the robot");
                (id, (f64::to_radians(low), f64::to_radians(high)))
            })
            .collect(),
        bodies: robot.profile.bodies.keys().cloned().collect(),
        duration,
        tracker_hz: 100.0,
        robot_hz: 125.0,
        offset: OFFSET,
        drift: DRIFT,
    }
}

/// Ripley with its arm poses replaced by two streams.
fn with_streams(streams: &Streams, timing: &str) -> Scratch {
    let text = |poses| write_poses(poses, &WriteOptions::micro()).expect("plain names");
    Scratch::new()
        .robot("ripley")
        .file("robots/ripley/tracker.csv", text(&streams.tracker))
        .file("robots/ripley/joints.csv", text(&streams.robot))
        .edit(
            "robots/ripley.yaml",
            "arm_poses: {file: ripley/arm_poses.csv, use: static}",
            &format!(
                "arm_poses: {{file: ripley/tracker.csv, use: static, robot_log: {{file: ripley/joints.csv}}, timing: {timing}}}"
            ),
        )
}

fn run(dir: &Scratch) -> Value {
    let ran = dir.calib(["run", "robots/ripley.yaml", "--out", "out"]);
    assert_eq!(ran.code, 0, "{}{}", ran.stdout, ran.stderr);
    dir.json("out/report.json")
}

fn is_true(dir: &Scratch, report: &Value) {
    let truth = Truth::read(&dir.json("robots/ripley/truth.json"));
    for error in errors(report, &truth) {
        println!("{}: χ² {:.1}", error.name, error.chi2);
        assert!(
            error.chi2 < CHI2_99_SIX,
            "{}: χ² {}",
            error.name,
            error.chi2
        );
    }
}

fn clock(report: &Value) -> Value {
    let clocks = report["clocks"].as_array().expect("a list");
    let own = clocks.iter().find(|c| c["recording"] == "arm_poses");
    own.expect("the streams' recording").clone()
}

/// The robot's log repeats its readings for half a second, ten times, on the tracker's clock or on its own: rows of these times are left out, and the robot
/// is the true one.
#[test]
fn a_log_that_hung_in_a_motion_is_named() {
    let robot = ripley();
    for (offset, drift, timing) in [
        (0.0, 0.0, "{poses: continuous, clock: shared}"),
        (OFFSET, DRIFT, "{poses: continuous}"),
    ] {
        let plan = StreamPlan {
            offset,
            drift,
            ..plan(&robot, Motion::Continuous, 60.0)
        };
        let mut streams =
            simulate_streams(&robot.profile, &robot.model, &plan, SEED).expect("a section");
        let rows = streams.robot.rows.len();
        for joint in streams.robot.joints.values_mut() {
            for start in (300..rows - 80).step_by(700) {
                let last = joint[start];
                joint[start..start + 63].fill(last);
            }
        }
        let dir = with_streams(&streams, timing);
        let report = run(&dir);
        let found = report["findings"].as_array().expect("a list");
        let held = found.iter().filter(|f| f["id"] == "joint-readings-held");
        assert_eq!(held.count(), 1, "{timing}: {found:#?}");
        is_true(&dir, &report);
    }
}

#[test]
fn a_motion_with_two_clocks_gives_offset_drift_and_the_truth() {
    if !skipped_tests::thorough() {
        return;
    }
    let robot = ripley();
    let plan = plan(&robot, Motion::Continuous, 60.0);
    let streams = simulate_streams(&robot.profile, &robot.model, &plan, SEED).expect("a section");
    let dir = with_streams(&streams, "{poses: continuous}");
    let checked = dir.calib(["check", "robots/ripley.yaml"]);
    assert_eq!(checked.code, 0, "{}{}", checked.stdout, checked.stderr);
    println!("{}", checked.stdout);
    assert!(
        checked.words().contains("second peak"),
        "{}",
        checked.stdout
    );
    let report = run(&dir);
    is_true(&dir, &report);
    let clock = clock(&report);
    println!("{clock}");
    let offset = clock["offset_s"].as_f64().expect("estimated");
    let sigma = clock["sigma_s"].as_f64().expect("estimated");
    assert!((offset - OFFSET).abs() < 2e-3, "{offset}");
    assert!((offset - OFFSET).abs() < 5.0 * sigma, "{offset} ± {sigma}");
    let drift = clock["drift"].as_f64().expect("estimated");
    // Half a minute from the middle, offset and drift together stay within 2 ms.
    assert!(
        (offset - OFFSET).abs() + 30.0 * (drift - DRIFT).abs() < 2e-3,
        "{drift}"
    );
    let freed = report["parameters"].as_array().expect("a list");
    assert!(freed.iter().any(|p| p["name"] == "arm_poses.clock_offset"));
}

#[test]
fn holds_with_two_clocks_become_poses() {
    let robot = ripley();
    let motion = Motion::StopAndGo {
        hold: 1.2,
        travel: 1.3,
    };
    let plan = plan(&robot, motion, 75.0);
    let streams = simulate_streams(&robot.profile, &robot.model, &plan, SEED).expect("a section");
    let dir = with_streams(&streams, "{poses: settle, hold_s: 0.8}");
    let checked = dir.calib(["check", "robots/ripley.yaml"]);
    println!("{}", checked.stdout);
    assert_eq!(checked.code, 0, "{}{}", checked.stdout, checked.stderr);
    assert!(checked.words().contains("30 holds"), "{}", checked.stdout);
    let report = run(&dir);
    is_true(&dir, &report);
    let offset = clock(&report)["offset_s"].as_f64().expect("estimated");
    assert!((offset - OFFSET).abs() < 2e-3, "{offset}");
}

/// In every fourth frame a marker is its mirror image in a window: what is seen of the robot stands still all the same, and the means of the holds contain
/// no reflection.
#[test]
fn holds_are_found_beside_reflections() {
    let robot = ripley();
    let motion = Motion::StopAndGo {
        hold: 1.2,
        travel: 1.3,
    };
    let plan = plan(&robot, motion, 75.0);
    let mut streams =
        simulate_streams(&robot.profile, &robot.model, &plan, SEED).expect("a section");
    let ghosts = streams.tracker.markers.get_mut("gripM_3");
    for point in ghosts
        .expect("of the robot")
        .iter_mut()
        .step_by(4)
        .flatten()
    {
        point.y = 2.6 - point.y;
    }
    let dir = with_streams(&streams, "{poses: settle, hold_s: 0.8}");
    let report = run(&dir);
    is_true(&dir, &report);
    let found = report["findings"].as_array().expect("a list");
    assert!(
        found.iter().any(|f| f["id"] == "marker-outlier"),
        "{found:#?}"
    );
    assert!(found.iter().all(|f| f["severity"] != "error"), "{found:#?}");
}

/// No column of the tracker's stream has a name of the profile: that is said, and nothing of the clocks, which no body could tell.
#[test]
fn a_stream_without_a_body_of_the_profile_is_named_as_such() {
    let robot = ripley();
    let plan = plan(&robot, Motion::Continuous, 20.0);
    let mut streams =
        simulate_streams(&robot.profile, &robot.model, &plan, SEED).expect("a section");
    let renamed = std::mem::take(&mut streams.tracker.markers).into_iter();
    streams.tracker.markers = renamed
        .map(|(name, track)| (format!("cell_{name}"), track))
        .collect();
    let dir = with_streams(&streams, "{poses: continuous}");
    let refused = dir.calib(["check", "robots/ripley.yaml"]);
    assert_eq!(refused.code, 3, "{}", refused.stdout);
    let said = &refused.stderr;
    assert!(
        said.contains("has no column of") && said.contains("Did you mean `cell_"),
        "{said}"
    );
}

#[test]
fn a_declared_clock_is_believed_and_an_undeclared_one_is_not() {
    let robot = ripley();
    let motion = Motion::StopAndGo {
        hold: 1.2,
        travel: 1.3,
    };
    let mut plan = plan(&robot, motion, 40.0);
    (plan.offset, plan.drift) = (0.0, 0.0);
    let streams = simulate_streams(&robot.profile, &robot.model, &plan, SEED).expect("a section");
    let dir = with_streams(&streams, "{clock: shared, hold_s: 0.8}");
    let report = run(&dir);
    is_true(&dir, &report);
    assert!(
        clock(&report)["text"]
            .as_str()
            .is_some_and(|t| t.contains("stated to be the same")),
    );
    // Two files without a word about time.
    let silent = with_streams(&streams, "{}").edit("robots/ripley.yaml", ", timing: {}", "");
    let refused = silent.calib(["check", "robots/ripley.yaml"]);
    assert_eq!(refused.code, 2, "{}", refused.stderr);
    assert!(refused.stderr.contains("timing: {}"), "{}", refused.stderr);
}

#[test]
fn the_log_of_another_motion_is_refused() {
    if !skipped_tests::thorough() {
        return;
    }
    let robot = ripley();
    let plan = plan(&robot, Motion::Continuous, 30.0);
    let mut streams =
        simulate_streams(&robot.profile, &robot.model, &plan, SEED).expect("a section");
    // The log of another motion.
    let other = simulate_streams(&robot.profile, &robot.model, &plan, SEED + 1).expect("a section");
    streams.robot = other.robot;
    let dir = with_streams(&streams, "{poses: continuous}");
    let refused = dir.calib(["run", "robots/ripley.yaml", "--out", "out"]);
    assert_eq!(refused.code, 3, "{}", refused.stdout);
    assert!(
        ["correlate", "equally well", "fit the nominal robot to"]
            .iter()
            .any(|words| refused.stderr.contains(words)),
        "{}",
        refused.stderr
    );
    assert!(!dir.path("out").exists());
}

/// A ROS 2 bag of joint states and body poses: MCAP without compression, messages in CDR, as rosbag2 writes them.
fn bag(streams: &Streams) -> Vec<u8> {
    fn text(text: &str) -> Vec<u8> {
        [&(text.len() as u32).to_le_bytes(), text.as_bytes()].concat()
    }
    fn record(kind: u8, content: &[&[u8]]) -> Vec<u8> {
        let content = content.concat();
        [
            &[kind],
            (content.len() as u64).to_le_bytes().as_slice(),
            &content,
        ]
        .concat()
    }
    /// CDR, little endian: every number on a multiple of its size.
    struct Cdr(Vec<u8>);
    impl Cdr {
        fn put(&mut self, bytes: &[u8]) {
            self.0.resize(self.0.len().next_multiple_of(bytes.len()), 0);
            self.0.extend(bytes);
        }
        fn text(&mut self, text: &str) {
            self.put(&(text.len() as u32 + 1).to_le_bytes());
            self.0.extend(text.bytes());
            self.0.push(0);
        }
        fn header(t: f64) -> Self {
            let mut cdr = Self(Vec::new());
            let t = t + 1000.0;
            cdr.put(&(t.floor() as u32).to_le_bytes());
            cdr.put(&((t.fract() * 1e9).round() as u32).to_le_bytes());
            cdr.text("world");
            cdr
        }
        fn numbers(&mut self, values: &[f64]) {
            values.iter().for_each(|v| self.put(&v.to_le_bytes()));
        }
    }
    let names: Vec<&String> = streams.robot.joints.keys().collect();
    // (topic, type, time, CDR)
    let mut messages: Vec<(String, &str, f64, Vec<u8>)> = Vec::new();
    for (row, t) in streams.robot.t.iter().flatten().enumerate() {
        let mut cdr = Cdr::header(*t);
        cdr.put(&(names.len() as u32).to_le_bytes());
        names.iter().for_each(|name| cdr.text(name));
        cdr.put(&(names.len() as u32).to_le_bytes());
        let q: Vec<f64> = streams
            .robot
            .joints
            .values()
            .filter_map(|q| q[row])
            .collect();
        cdr.numbers(&q);
        cdr.put(&0u32.to_le_bytes());
        cdr.put(&0u32.to_le_bytes());
        messages.push((
            "/joint_states".into(),
            "sensor_msgs/msg/JointState",
            *t,
            cdr.0,
        ));
    }
    for (body, track) in &streams.tracker.bodies {
        for (t, pose) in streams.tracker.t.iter().flatten().zip(track) {
            let Some(pose) = pose else { continue };
            let mut cdr = Cdr::header(*t);
            let (p, r) = (pose.translation.vector, pose.rotation.coords);
            cdr.numbers(&[p.x, p.y, p.z, r.x, r.y, r.z, r.w]);
            let topic = format!("/vrpn_client_node/{body}/pose");
            messages.push((topic, "geometry_msgs/msg/PoseStamped", *t, cdr.0));
        }
    }
    let topics: BTreeMap<&str, &str> = messages.iter().map(|m| (m.0.as_str(), m.1)).collect();
    let mut file = b"\x89MCAP0\r\n".to_vec();
    file.extend(record(1, &[&text("ros2"), &text("test")]));
    let mut ids = BTreeMap::new();
    for (i, (topic, kind)) in topics.iter().enumerate() {
        let id = (i as u16 + 1).to_le_bytes();
        ids.insert(*topic, id);
        let none = 0u32.to_le_bytes();
        file.extend(record(3, &[&id, &text(kind), &text("ros2msg"), &none]));
        file.extend(record(4, &[&id, &id, &text(topic), &text("cdr"), &none]));
    }
    for (topic, _, t, data) in &messages {
        let time = ((t + 1000.0) * 1e9) as u64;
        let time = time.to_le_bytes();
        let head = [
            ids[topic.as_str()].as_slice(),
            &[0; 4],
            &time,
            &time,
            &[0, 1, 0, 0],
        ]
        .concat();
        file.extend(record(5, &[&head, data]));
    }
    file.extend(record(15, &[&[0; 4]]));
    file.extend(record(2, &[&[0; 20]]));
    file.extend(b"\x89MCAP0\r\n");
    file
}

#[test]
fn a_bag_with_joints_and_bodies_in_motion_gives_the_truth() {
    if !skipped_tests::thorough() {
        return;
    }
    let robot = load_robot(&root().join("robots/justin.yaml")).expect("shipped");
    let ranges = [
        ("torso_0", -60.0, 60.0),
        ("torso_1", -20.0, -20.0),
        ("torso_2", 40.0, 40.0),
        ("torso_3", -20.0, -20.0),
        ("right_0", -100.0, 100.0),
        ("right_1", -90.0, 90.0),
        ("right_2", -100.0, 100.0),
        ("right_3", -100.0, 100.0),
        ("right_4", -120.0, 120.0),
        ("right_5", -45.0, 80.0),
        ("right_6", -45.0, 135.0),
        ("head_pan", -90.0, 90.0),
        ("head_tilt", -20.0, 40.0),
    ];
    let plan = StreamPlan {
        motion: Motion::Continuous,
        ranges: ranges
            .into_iter()
            .map(|(joint, low, high)| {
                let id = robot.model.joint_id(joint).expect("of the robot");
                (id, (f64::to_radians(low), f64::to_radians(high)))
            })
            .collect(),
        bodies: robot.profile.bodies.keys().cloned().collect(),
        duration: 40.0,
        tracker_hz: 60.0,
        robot_hz: 100.0,
        offset: -1.7,
        drift: -30e-6,
    };
    // The seed of Justin's shipped recordings.
    let streams = simulate_streams(&robot.profile, &robot.model, &plan, 4).expect("a section");
    let dir = Scratch::new()
        .robot("justin")
        .file("robots/justin/motion.mcap", bag(&streams))
        .edit(
            "robots/justin.yaml",
            "arm_poses: {file: justin/arm_poses.csv, use: static}",
            "arm_poses: {file: justin/motion.mcap, use: static, timing: {poses: continuous}}",
        );
    let ran = dir.calib(["run", "robots/justin.yaml", "--out", "out"]);
    assert_eq!(ran.code, 0, "{}{}", ran.stdout, ran.stderr);
    let report = dir.json("out/report.json");
    let truth = Truth::read(&dir.json("robots/justin/truth.json"));
    for error in errors(&report, &truth) {
        println!("{}: χ² {:.1}", error.name, error.chi2);
        assert!(
            error.chi2 < CHI2_99_SIX,
            "{}: χ² {}",
            error.name,
            error.chi2
        );
    }
    let offset = clock(&report)["offset_s"].as_f64().expect("estimated");
    assert!((offset + 1.7).abs() < 2e-3, "{offset}");
    // What the bag could not say is on record.
    let own = report["recordings"].as_array().expect("a list");
    let own = own
        .iter()
        .find(|r| r["name"] == "arm_poses")
        .expect("there");
    assert!(
        own["conversions"].to_string().contains("joint positions"),
        "{own}"
    );
}
