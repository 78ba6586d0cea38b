//! Clocks of tracker and joints, through the program: two files, and one file whose joint values are late. The bodies are one
//! marker, four markers and a measured pose; the motion goes on all the time, or in holds.

use crate::scratch;

use calib_pipeline::prepare::load::load_robot;
use calib_recording::{Poses, WriteOptions, write_poses};
use calib_sim::{Motion, StreamPlan, Streams, simulate_streams};
use scratch::Scratch;
use serde_json::Value;

const OFFSET: f64 = 3.7;
const DRIFT: f64 = 40e-6;
/// Rate of both streams, Hz.
const RATE: f64 = 50.0;
/// What the simulated tracker is late by, in rows: the two never sample at the same instants.
const BETWEEN: f64 = 0.37;

/// A six-axis arm that is crooked enough for every number to be seen.
fn urdf() -> String {
    let joints = [
        ("0 0 0.23", "0 0 0"),
        ("0.08 0.04 0.16", "-1.57 0.1 0"),
        ("0.51 -0.03 0.03", "0.05 0 0.2"),
        ("0.07 0.2 -0.02", "1.67 0 0"),
        ("0.01 0.04 0.27", "-1.57 0 0.15"),
        ("0.02 -0.12 0.01", "1.57 0.07 0"),
    ];
    let mut text = String::from("<robot name=\"arm\">\n  <link name=\"l0\"/>\n");
    for (i, (xyz, rpy)) in joints.iter().enumerate() {
        let child = i + 1;
        text += &format!(
            "  <link name=\"l{child}\"/>\n  <joint name=\"a{child}\" type=\"revolute\">\n    <parent link=\"l{i}\"/>\n    <child link=\"l{child}\"/>\n    \
             <origin xyz=\"{xyz}\" rpy=\"{rpy}\"/>\n    <axis xyz=\"0 0 1\"/>\n    <limit lower=\"-3\" upper=\"3\" effort=\"50\" velocity=\"3\"/>\n  </joint>\n",
        );
    }
    text + "</robot>\n"
}

#[derive(Clone, Copy, PartialEq, Debug)]
enum Body {
    One,
    Four,
    Pose,
}

const BODIES: [Body; 3] = [Body::One, Body::Four, Body::Pose];

impl Body {
    fn declared(self) -> &'static str {
        match self {
            Self::One => "markers: [m1]",
            Self::Four => "markers: [m1, m2, m3, m4]",
            Self::Pose => "pose: true",
        }
    }

    fn simulated(self) -> &'static str {
        match self {
            Self::One => "markers_mm: {m1: [30, 50, 20]}",
            Self::Four => {
                "markers_mm: {m1: [0, 0, 0], m2: [72, 0, 0], m3: [25, 58, 0], m4: [48, 30, -40]}"
            }
            Self::Pose => "rpy_deg: [10, -5, 25]",
        }
    }
}

/// The profile; `fitted` and `held_out` follow `use` in the recordings.
fn profile(body: Body, fitted: &str, held_out: &str) -> String {
    format!(
        "calib: 1\nrobot: {{name: arm, urdf: arm.urdf}}\n\
         tracker: {{frame: lab, marker_sigma_mm: 0.2, body_sigma_mm: 0.2, body_sigma_deg: 0.05}}\n\
         bodies:\n  tip: {{link: l6, {}}}\n\
         recordings:\n  poses: {{file: poses.csv, use: static{fitted}}}\n  check: {{file: check.csv, use: validation{held_out}}}\n\
         solve:\n  free: [bodies, tracker, joint_offsets, joint_axes]\n  limits: {{held_out_rms_mm: 1.0, held_out_max_mm: 3}}\n\
         simulate:\n  seed: 1\n  tracker_from_root: {{xyz_mm: [1200, -400, 900], rpy_deg: [10, -15, 40]}}\n  \
         mounts:\n    tip: {{xyz_mm: [40, -20, 60], {}}}\n  \
         errors: {{joint_offset_deg: 0.3, axis_mm: 1, axis_deg: 0.2}}\n  \
         noise: {{marker_mm: 0.2, body_mm: 0.2, body_deg: 0.05}}\n  recordings: {{}}\n",
        body.declared(),
        body.simulated(),
    )
}

/// The part of a table from one time to another, s.
fn part(poses: &Poses, from: f64, to: f64) -> Poses {
    let t = poses.t.as_ref().expect("times");
    let rows: Vec<usize> = (0..t.len())
        .filter(|i| t[*i] >= from && t[*i] < to)
        .collect();
    poses.select(&rows)
}

fn text(poses: &Poses) -> String {
    write_poses(poses, &WriteOptions::micro()).expect("plain names")
}

/// Streams of `fitted` + `held_out` s.
fn streams(body: Body, motion: Motion, seconds: f64, clocks: (f64, f64), seed: u64) -> Streams {
    let dir = Scratch::new()
        .file("arm.urdf", urdf())
        .file("arm.yaml", profile(body, "", ""));
    let robot = load_robot(&dir.path("arm.yaml")).expect("a robot");
    let ranges = robot.model.independent_joints().map(|id| (id, (-1.6, 1.6)));
    let plan = StreamPlan {
        motion,
        ranges: ranges.collect(),
        bodies: vec!["tip".to_owned()],
        duration: seconds,
        tracker_hz: RATE,
        robot_hz: RATE,
        offset: clocks.0,
        drift: clocks.1,
    };
    simulate_streams(&robot.profile, &robot.model, &plan, seed).expect("a section")
}

/// Two files for each of the two recordings, two thirds of the time for the first.
fn two_files(body: Body, motion: Motion, seconds: f64, timing: &str, seed: u64) -> Scratch {
    let all = streams(body, motion, seconds, (OFFSET, DRIFT), seed);
    let border = seconds / 1.5;
    let log = |name: &str| format!(", robot_log: {{file: {name}_joints.csv}}, timing: {timing}");
    Scratch::new()
        .file("arm.urdf", urdf())
        .file("arm.yaml", profile(body, &log("poses"), &log("check")))
        .file("poses.csv", text(&part(&all.tracker, 0.0, border + OFFSET)))
        .file("check.csv", text(&part(&all.tracker, border + OFFSET, 1e9)))
        .file("poses_joints.csv", text(&part(&all.robot, 0.0, border)))
        .file("check_joints.csv", text(&part(&all.robot, border, 1e9)))
}

/// One file for each recording: joint values of the row before.
fn late(body: Body, seconds: f64, timing: &str, seed: u64) -> Scratch {
    let all = streams(body, Motion::Continuous, seconds, (0.0, 0.0), seed);
    let rows = all.tracker.len().min(all.robot.len());
    let mut table = all.tracker.select(&(1..rows).collect::<Vec<_>>());
    let before = all.robot.select(&(0..rows - 1).collect::<Vec<_>>());
    (table.joints, table.joint_units) = (before.joints, before.joint_units);
    let border = seconds / 1.5;
    Scratch::new()
        .file("arm.urdf", urdf())
        .file("arm.yaml", profile(body, timing, timing))
        .file("poses.csv", text(&part(&table, 0.0, border)))
        .file("check.csv", text(&part(&table, border, 1e9)))
}

/// How late the joint values of [`late`] are, s.
const LATE: f64 = (1.0 + BETWEEN) / RATE;

fn report(dir: &Scratch) -> (i32, Value) {
    let ran = dir.calib(["run", "arm.yaml", "--out", "out"]);
    assert!(ran.code < 2, "{}{}", ran.stdout, ran.stderr);
    (ran.code, dir.json("out/report.json"))
}

fn clock(report: &Value, recording: &str) -> (f64, f64) {
    let clocks = report["clocks"].as_array().expect("a list");
    let own = clocks.iter().find(|c| c["recording"] == recording);
    let own = own.expect("the recording");
    let number = |key: &str| own[key].as_f64().expect("estimated");
    (number("offset_s"), number("sigma_s"))
}

/// The kinds of the findings about clocks.
fn kinds(report: &Value) -> Vec<&str> {
    let findings = report["findings"].as_array().expect("a list");
    let clocks = findings.iter().filter(|f| f["id"] == "clock-lag");
    clocks.filter_map(|f| f["facts"]["kind"].as_str()).collect()
}

fn held_out_rms(report: &Value) -> f64 {
    let held_out = &report["verification"]["held_out"];
    let rms = held_out["calibrated"]["rms_m"].as_f64();
    rms.unwrap_or_else(|| panic!("{}", held_out["calibrated"]))
}

#[test]
fn two_files_in_motion_are_accepted_with_true_offsets() {
    if !skipped_tests::thorough() {
        return;
    }
    let (mut all, mut covered) = (0, 0);
    for body in BODIES {
        for seed in 0..2 {
            let what = format!("{body:?}, seed {seed}");
            let dir = two_files(body, Motion::Continuous, 60.0, "{poses: continuous}", seed);
            let (code, report) = report(&dir);
            assert_eq!(code, 0, "{what}: {}", report["reasons"]);
            // A marker's noise of 0.2 mm in three coordinates is 0.35 mm.
            let rms = held_out_rms(&report);
            assert!((3.2e-4..4.2e-4).contains(&rms), "{what}: {rms}");
            let seen = kinds(&report);
            assert!(
                seen.iter().all(|kind| *kind == "offset"),
                "{what}: {seen:?}"
            );
            // The middle of the two recordings on the robot's clock, against that of the whole.
            for (recording, middle) in [("poses", 20.0), ("check", 50.0)] {
                let (offset, sigma) = clock(&report, recording);
                let error = offset - OFFSET - DRIFT * (middle - 30.0);
                println!(
                    "{what}, {recording}: {:.4} ± {:.4} ms",
                    error * 1e3,
                    sigma * 1e3
                );
                assert!(
                    error.abs() < 2e-4 && sigma < 2e-4,
                    "{what}: {error} ± {sigma}"
                );
                assert!(error.abs() < 5.0 * sigma, "{what}: {error} ± {sigma}");
                all += 1;
                covered += i32::from(error.abs() < 2.0 * sigma);
            }
        }
    }
    // 95 % are expected, twelve are few.
    assert!(covered * 4 >= all * 3, "{covered} of {all} within 2 σ");
}

#[test]
fn holds_of_one_marker_in_two_files_become_poses() {
    let motion = Motion::StopAndGo {
        hold: 1.2,
        travel: 1.3,
    };
    let dir = two_files(Body::One, motion, 180.0, "{hold_s: 0.8}", 3);
    let (code, report) = report(&dir);
    assert_eq!(code, 0, "{}", report["reasons"]);
    let (offset, sigma) = clock(&report, "poses");
    assert!((offset - OFFSET).abs() < 5e-3, "{offset} ± {sigma}");
}

#[test]
fn late_joint_values_are_named_and_the_remedy_works() {
    if !skipped_tests::thorough() {
        return;
    }
    let shared = ", timing: {poses: continuous, clock: shared}";
    for (body, timing) in [
        (Body::One, shared),
        (Body::Four, shared),
        (Body::Pose, shared),
        (Body::Pose, ""),
    ] {
        let what = format!("{body:?} {timing}");
        let dir = late(body, 45.0, timing, 5);
        let (code, rejected) = report(&dir);
        assert_eq!(code, 1, "{what}: {}", rejected["reasons"]);
        assert_eq!(
            rejected["diagnosis"]["kind"], "clock_offset",
            "{what}: {}",
            rejected["diagnosis"]
        );
        assert_eq!(rejected["diagnosis"]["recording"], "poses", "{what}");
        // What the diagnosis asks for, in both recordings.
        let page = dir.read("out/report.md");
        let (_, remedy) = page.split_once("Set `timing: ").expect("a remedy");
        let (remedy, _) = remedy.split_once('`').expect("a key and its value");
        let remedy = format!(", timing: {remedy}");
        let dir = dir.file("arm.yaml", profile(body, &remedy, &remedy));
        let (code, accepted) = report(&dir);
        assert_eq!(code, 0, "{what}: {}", accepted["reasons"]);
        assert_eq!(kinds(&accepted), ["corrected_behind"; 2], "{what}");
        for recording in ["poses", "check"] {
            let (offset, sigma) = clock(&accepted, recording);
            // The robot's clock shows the event later.
            let error = offset + LATE;
            println!(
                "{what}, {recording}: {:.4} ± {:.4} ms",
                error * 1e3,
                sigma * 1e3
            );
            assert!(
                error.abs() < 2e-4 && error.abs() < 5.0 * sigma,
                "{what}: {error} ± {sigma}"
            );
        }
    }
}

/// Three slides: nothing turns, and only places tell the offset.
#[test]
fn streams_of_a_robot_that_turns_nothing_are_brought_together() {
    for body in [Body::Four, Body::Pose] {
        let slides = |text: String| {
            let text = text.replace("revolute", "prismatic");
            text.replace("\"-3\" upper=\"3\"", "\"-1\" upper=\"1\"")
        };
        // The first three joints of the arm, the others fixed.
        let urdf = urdf();
        let (first, last) = urdf.split_once("<link name=\"l4\"/>").expect("a fourth");
        let last = last.replace("revolute", "fixed");
        let urdf = format!("{}<link name=\"l4\"/>{last}", slides(first.to_owned()));
        let profile = |fitted: &str, held_out: &str| {
            let text = profile(body, fitted, held_out);
            let text = text.replace("joint_offset_deg: 0.3, ", "");
            text.replace(
                "[bodies, tracker, joint_offsets, joint_axes]",
                "[bodies, tracker]",
            )
            .replace("axis_mm: 1, axis_deg: 0.2", "axis_mm: 0, axis_deg: 0")
        };
        let dir = Scratch::new()
            .file("arm.urdf", urdf.clone())
            .file("arm.yaml", profile("", ""));
        let robot = load_robot(&dir.path("arm.yaml")).expect("a robot");
        let ranges = robot.model.independent_joints().map(|id| (id, (-0.8, 0.8)));
        let plan = StreamPlan {
            motion: Motion::Continuous,
            ranges: ranges.collect(),
            bodies: vec!["tip".to_owned()],
            duration: 60.0,
            tracker_hz: RATE,
            robot_hz: RATE,
            offset: OFFSET,
            drift: DRIFT,
        };
        let all = simulate_streams(&robot.profile, &robot.model, &plan, 1).expect("a section");
        let log = |name: &str| {
            format!(", robot_log: {{file: {name}_joints.csv}}, timing: {{poses: continuous}}")
        };
        let dir = Scratch::new()
            .file("arm.urdf", urdf)
            .file("arm.yaml", profile(&log("poses"), &log("check")))
            .file("poses.csv", text(&part(&all.tracker, 0.0, 40.0 + OFFSET)))
            .file("check.csv", text(&part(&all.tracker, 40.0 + OFFSET, 1e9)))
            .file("poses_joints.csv", text(&part(&all.robot, 0.0, 40.0)))
            .file("check_joints.csv", text(&part(&all.robot, 40.0, 1e9)));
        let (code, report) = report(&dir);
        assert_eq!(code, 0, "{body:?}: {}", report["reasons"]);
        for (recording, middle) in [("poses", 20.0), ("check", 50.0)] {
            let (offset, sigma) = clock(&report, recording);
            let error = offset - OFFSET - DRIFT * (middle - 30.0);
            assert!(error.abs() < 5e-4, "{body:?}: {error} ± {sigma}");
        }
    }
}

/// Clocks that are stated to be one and are not: times without anything in common, as of two time zones, are refused, and holds of the bodies in which the
/// joints move are counted.
#[test]
fn clocks_that_are_not_shared_are_named_where_they_are_stated_to_be() {
    let motion = Motion::StopAndGo {
        hold: 1.2,
        travel: 1.3,
    };
    let dir = two_files(Body::Four, motion, 120.0, "{clock: shared, hold_s: 0.8}", 5);
    let said = dir.calib(["check", "arm.yaml"]).stdout;
    assert!(said.contains("The bodies stand still"), "{said}");
    let mut dir = dir;
    for file in ["poses_joints.csv", "check_joints.csv"] {
        let text = dir.read(file);
        let mut column = 0;
        let rows = text.lines().map(|row| {
            let mut cells: Vec<String> = row.split(',').map(str::to_owned).collect();
            match cells.iter().position(|cell| cell == "t_s") {
                Some(found) => column = found,
                None if !row.starts_with('#') => {
                    let t: f64 = cells[column].parse().expect("a time");
                    cells[column] = (t + 7200.0).to_string();
                }
                None => {}
            }
            cells.join(",")
        });
        let rows: Vec<String> = rows.collect();
        dir = dir.file(file, rows.join("\n") + "\n");
    }
    for command in ["check", "run"] {
        let said = dir.calib([command, "arm.yaml"]).expect(3).stderr;
        assert!(said.contains("have nothing in common"), "{said}");
        assert!(said.contains("max_offset_s: 7"), "{said}");
    }
}
